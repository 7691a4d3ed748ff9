//! The commands `lightpath kernel promote`, `rollback` and `history`.

use super::show::kernel_facts;
use crate::arguments::{Limit, Passage};
use crate::failure::Failure;
use crate::kernel_choice::KernelChoice;
use crate::pages::pages;
use crate::session::Session;
use crate::show;
use crate::table::Table;
use clap::Args;
use lightpath::v1;

/// Make a version active, if it passes the display's promotion gate; holograms and firmware use the active version.
///
/// The command kernel check shows beforehand whether the version would pass. All devices get the version at once. Use
/// rollout start to try it on some devices first.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath kernel promote --display lab-2 --distance 150mm --version 3 \\
      --reason \"new lens\"")]
pub(crate) struct Promote {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Make this version active
    #[arg(long, value_name = "N")]
    version: u32,

    #[command(flatten)]
    passage: Passage,
}

/// Make the version active again that was active before the last change.
#[derive(Debug, Args)]
pub(crate) struct Rollback {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Record this reason in the history, at most 1024 bytes [default: none]
    #[arg(long, value_name = "TEXT", default_value = "", hide_default_value = true)]
    reason: String,

    /// Go back only if this version is active now [default: the version that is active when the command starts]
    #[arg(long, value_name = "N")]
    expected_active: Option<u32>,
}

/// List every move of active and other aliases, newest first.
#[derive(Debug, Args)]
pub(crate) struct History {
    #[command(flatten)]
    kernel: KernelChoice,

    #[command(flatten)]
    limit: Limit,
}

impl Promote {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let Passage { reason, force, expected_active } = self.passage;
        let request = v1::PromoteKernelRequest {
            kernel: self.kernel.name(session).await?,
            version: self.version,
            reason,
            expected_active_version: expected_active,
            force,
        };
        session.print(&session.client.promote_kernel(request).await?, kernel_facts)
    }
}

impl Rollback {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let name = self.kernel.name(session).await?;
        let active = match self.expected_active {
            Some(version) => version,
            None => session.client.get_kernel(v1::GetKernelRequest { name: name.clone() }).await?.active_version(),
        };
        let request =
            v1::RollbackKernelRequest { kernel: name, reason: self.reason, expected_active_version: Some(active) };
        session.print(&session.client.rollback_kernel(request).await?, kernel_facts)
    }
}

impl History {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let kernel = self.kernel.name(session).await?;
        let list = pages(self.limit.limit, async |page_size, page_token| {
            let request = v1::ListKernelMovesRequest { kernel: kernel.clone(), page_size, page_token };
            session.client.list_kernel_moves(request).await
        })
        .await?;
        session.print_pages(list, |moves| {
            let mut table = Table::new("time???|age?|caller~??|alias|>from|>to|kind?|reason_");
            for entry in moves {
                table.row([
                    show::clock_or_dash(entry.time.as_ref()),
                    show::age_or_dash(entry.time.as_ref()),
                    show::or_dash(&entry.caller),
                    entry.alias.clone(),
                    show::version_or_dash(entry.from_version),
                    show::version_or_dash(entry.to_version),
                    kind(entry).to_owned(),
                    reason(entry),
                ]);
            }
            table.text_or("no version has been active yet")
        })
    }
}

fn kind(entry: &v1::KernelMove) -> &'static str {
    match (entry.alias.as_str(), entry.rollback) {
        (_, true) => "rollback",
        ("active", false) if entry.overridden.is_empty() => "promote",
        ("active", false) => "override",
        _ => "alias",
    }
}

/// The reason, with what failed of the gate.
fn reason(entry: &v1::KernelMove) -> String {
    let failed = entry.overridden.join("; ");
    if failed.is_empty() { entry.reason.clone() } else { format!("{} (overridden: {failed})", entry.reason) }
}
