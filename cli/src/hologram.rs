//! The commands `lightpath hologram …`.

use super::failure::Failure;
use super::jobs::optimize_hologram::{Optimize, Save};
use super::jobs::verify_hologram::Verify;
use super::session::Session;

commands! {
    /// Commands for holograms.
    HologramCommand {
        Optimize(Box<Optimize>),
        Save(Save),
        Verify(Verify),
    }
}
