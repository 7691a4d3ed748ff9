//! The commands `lightpath kernel …`.

mod alias;
mod compare;
mod gate;
mod interpolate;
mod manifest;
mod mirror;
mod moves;
mod nearest;
mod origin;
mod show;
mod transfer;
mod watch;

use super::failure::Failure;
use super::jobs::{evaluate_kernel, learn_kernel, report_kernel};
use super::session::Session;

commands! {
    /// Commands for kernels.
    KernelCommand {
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
        Mirror(mirror::Mirror),
        Import(transfer::Import),
        Report(report_kernel::Report),
    }
}
