//! The commands `lightpath hologram …`.

use super::failure::Failure;
use super::jobs::optimize_hologram::{Optimize, Save};
use super::jobs::verify_hologram::Verify;
use super::session::Session;
use clap::Subcommand;

/// Commands for holograms.
// Each variant takes its help from the struct of its arguments. A comment here would hide all but its first line.
#[derive(Debug, Subcommand)]
pub(crate) enum HologramCommand {
    Optimize(Box<Optimize>),
    Save(Save),
    Verify(Verify),
}

impl HologramCommand {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        match self {
            Self::Optimize(optimize) => optimize.run(session).await,
            Self::Save(save) => save.run(session).await,
            Self::Verify(verify) => verify.run(session).await,
        }
    }
}
