//! The commands `lightpath hologram …`.

use super::failure::Failure;
use super::jobs::optimize_hologram::{Evaluate, Optimize, Save};
use super::jobs::verify_hologram::Verify;
use super::session::Session;

commands! {
    /// Commands for holograms.
    HologramCommand {
        Optimize(Box<Optimize>),
        Evaluate(Box<Evaluate>),
        Save(Save),
        Verify(Verify),
    }
}
