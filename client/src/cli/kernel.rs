//! `lightpath kernel …`

mod learn;
mod moves;
mod show;
mod transfer;

use super::failure::Failure;
use super::session::Session;
use clap::Subcommand;

/// What can be done with kernels.
#[derive(Debug, Subcommand)]
pub(crate) enum KernelCommand {
    /// Learn a display's light transport from photographs
    Learn(learn::Learn),
    /// Measure how well a kernel predicts a dataset's photographs
    Evaluate(learn::Evaluate),
    /// List kernels
    List(show::List),
    /// Show a kernel and its versions, or one version in full
    Show(show::Show),
    /// List the versions of a kernel, newest first
    Versions(show::Versions),
    /// Make a version the active one, which holograms and firmware use
    Promote(moves::Promote),
    /// Make the version active again that was before the last move
    Rollback(moves::Rollback),
    /// List every move of the active version, newest first
    History(moves::History),
    /// Write the active version (or another one) as a safetensors file
    Fetch(transfer::Fetch),
    /// Write a certain version as a safetensors file
    Export(transfer::Export),
    /// Store a safetensors file as a kernel's next version
    Import(transfer::Import),
}

impl KernelCommand {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        match self {
            Self::Learn(learn) => learn.run(session).await,
            Self::Evaluate(evaluate) => evaluate.run(session).await,
            Self::List(list) => list.run(session).await,
            Self::Show(show) => show.run(session).await,
            Self::Versions(versions) => versions.run(session).await,
            Self::Promote(promote) => promote.run(session).await,
            Self::Rollback(rollback) => rollback.run(session).await,
            Self::History(history) => history.run(session).await,
            Self::Fetch(fetch) => fetch.run(session).await,
            Self::Export(export) => export.run(session).await,
            Self::Import(import) => import.run(session).await,
        }
    }
}
