//! The commands `lightpath kernel …`.

mod alias;
mod compare;
mod gate;
mod interpolate;
mod manifest;
mod moves;
mod nearest;
mod show;
mod transfer;
mod watch;

use super::failure::Failure;
use super::jobs::{evaluate_kernel, learn_kernel, report_kernel};
use super::session::Session;
use clap::Subcommand;

/// Commands for kernels.
// Each variant takes its help from the struct of its arguments. A comment here would hide all but its first line.
#[derive(Debug, Subcommand)]
pub(crate) enum KernelCommand {
    Learn(learn_kernel::Learn),
    Interpolate(interpolate::Interpolate),
    Evaluate(evaluate_kernel::Evaluate),
    List(show::List),
    Show(show::Show),
    Versions(show::Versions),
    Gate(gate::Gate),
    Check(gate::Check),
    Promote(moves::Promote),
    Rollback(moves::Rollback),
    History(moves::History),
    Alias(alias::Alias),
    Deprecate(alias::Deprecate),
    Compare(compare::Compare),
    Nearest(nearest::Nearest),
    Watch(watch::Watch),
    Fetch(transfer::Fetch),
    Export(transfer::Export),
    Manifest(manifest::Manifest),
    Import(transfer::Import),
    Report(report_kernel::Report),
}

impl KernelCommand {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        match self {
            Self::Learn(learn) => learn.run(session).await,
            Self::Interpolate(interpolate) => interpolate.run(session).await,
            Self::Evaluate(evaluate) => evaluate.run(session).await,
            Self::List(list) => list.run(session).await,
            Self::Show(show) => show.run(session).await,
            Self::Versions(versions) => versions.run(session).await,
            Self::Gate(gate) => gate.run(session).await,
            Self::Check(check) => check.run(session).await,
            Self::Alias(alias) => alias.run(session).await,
            Self::Deprecate(deprecate) => deprecate.run(session).await,
            Self::Compare(compare) => compare.run(session).await,
            Self::Nearest(nearest) => nearest.run(session).await,
            Self::Promote(promote) => promote.run(session).await,
            Self::Rollback(rollback) => rollback.run(session).await,
            Self::History(history) => history.run(session).await,
            Self::Watch(watch) => watch.run(session).await,
            Self::Fetch(fetch) => fetch.run(session).await,
            Self::Export(export) => export.run(session).await,
            Self::Manifest(manifest) => manifest.run(session).await,
            Self::Import(import) => import.run(session).await,
            Self::Report(report) => report.run(session).await,
        }
    }
}
