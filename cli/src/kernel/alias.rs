//! The commands `lightpath kernel alias` and `deprecate`.

use super::show::{kernel_facts, version_facts};
use crate::failure::Failure;
use crate::kernel_choice::KernelChoice;
use crate::session::Session;
use clap::Args;
use lightpath::{names, v1};

/// Give a version a name besides active, such as candidate, or remove the name.
///
/// Holograms can use the name: hologram optimize --kernel candidate. Devices follow only active.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath kernel alias candidate --display lab-2 --distance 150mm --version 4
  lightpath kernel alias candidate --display lab-2 --distance 150mm --remove")]
pub(crate) struct Alias {
    /// The name: a-z, 0-9 and '-'
    #[arg(value_name = "ALIAS")]
    alias: String,

    #[command(flatten)]
    kernel: KernelChoice,

    /// Name this version
    #[arg(long, value_name = "N", required_unless_present = "remove")]
    version: Option<u32>,

    /// Remove the name
    #[arg(long, conflicts_with = "version")]
    remove: bool,

    /// Record this reason in the history, at most 1024 bytes [default: none]
    #[arg(long, value_name = "TEXT", default_value = "", hide_default_value = true)]
    reason: String,

    /// Change the name only if it names this version now; 0 means none
    #[arg(long, value_name = "N")]
    expected: Option<u32>,
}

/// Mark a version as one that should not be used any more, or take that back.
///
/// A deprecated version does not pass the promotion gate. Holograms can still use it.
#[derive(Debug, Args)]
#[command(override_usage = "lightpath kernel deprecate [OPTIONS] --version <N>\n           --reason <TEXT> [KERNEL]")]
pub(crate) struct Deprecate {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Deprecate this version
    #[arg(long, value_name = "N")]
    version: u32,

    /// Say why, at most 1024 bytes
    #[arg(long, value_name = "TEXT")]
    reason: String,

    /// Take the deprecation back
    #[arg(long)]
    undo: bool,
}

impl Alias {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let request = v1::SetKernelAliasRequest {
            kernel: self.kernel.name(session).await?,
            alias: self.alias,
            version: self.version,
            reason: self.reason,
            expected_version: self.expected,
        };
        session.print(&session.client.set_kernel_alias(request).await?, kernel_facts)
    }
}

impl Deprecate {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let name = names::kernel_version(&self.kernel.name(session).await?, self.version);
        let request = v1::DeprecateKernelVersionRequest { name, reason: self.reason, undo: self.undo };
        session.print(&session.client.deprecate_kernel_version(request).await?, version_facts)
    }
}
