//! `lightpath kernel promote`, `rollback` and `history`.

use super::show::kernel_facts;
use crate::cli::arguments::Limit;
use crate::cli::failure::Failure;
use crate::cli::kernel_choice::KernelChoice;
use crate::cli::session::{Session, more_hint, pages};
use crate::cli::show;
use crate::cli::table::Table;
use clap::Args;
use lightpath::v1;

/// Make a version the active one, which holograms and firmware use.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath kernel promote --display lab-2 --distance 150mm --version 3 \\
      --reason \"new lens\"")]
pub(crate) struct Promote {
    #[command(flatten)]
    kernel: KernelChoice,

    /// The version to use from now on
    #[arg(long, value_name = "N")]
    version: u32,

    /// Why, for the history; at most 1024 bytes
    #[arg(long, value_name = "TEXT", default_value = "", hide_default_value = true)]
    reason: String,

    /// Promote a version that was measured to be no better than the ideal kernel all the same; needs --reason
    #[arg(long, requires = "reason")]
    force: bool,

    /// Refuse when another version than this one is active now; 0: none is
    #[arg(long, value_name = "N")]
    expected_active: Option<u32>,
}

/// Make the version active again that was before the last move.
#[derive(Debug, Args)]
pub(crate) struct Rollback {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Why, for the history; at most 1024 bytes
    #[arg(long, value_name = "TEXT", default_value = "", hide_default_value = true)]
    reason: String,
}

/// List every move of the active version, newest first.
#[derive(Debug, Args)]
pub(crate) struct History {
    #[command(flatten)]
    kernel: KernelChoice,

    #[command(flatten)]
    limit: Limit,
}

impl Promote {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let request = v1::PromoteKernelRequest {
            kernel: self.kernel.name(session).await?,
            version: self.version,
            reason: self.reason,
            expected_active_version: self.expected_active,
            force: self.force,
        };
        session.print(&session.client.promote_kernel(request).await?, kernel_facts)
    }
}

impl Rollback {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let request = v1::RollbackKernelRequest { kernel: self.kernel.name(session).await?, reason: self.reason };
        session.print(&session.client.rollback_kernel(request).await?, kernel_facts)
    }
}

impl History {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let kernel = self.kernel.name(session).await?;
        let (moves, next_page_token) = pages(self.limit.limit, async |page_size, page_token| {
            let request = v1::ListKernelMovesRequest { kernel: kernel.clone(), page_size, page_token };
            let answer = session.client.list_kernel_moves(request).await?;
            Ok((answer.moves, answer.next_page_token))
        })
        .await?;
        session.print(&v1::ListKernelMovesResponse { moves, next_page_token }, |list| {
            let mut table = Table::new(&["time", ">from", ">to", "kind", "reason"]);
            for a_move in &list.moves {
                table.row([
                    show::time_or_dash(a_move.time.as_ref()),
                    show::version_or_dash(a_move.from_version),
                    show::version_or_dash(a_move.to_version),
                    if a_move.rollback { "rollback".to_owned() } else { "promote".to_owned() },
                    a_move.reason.clone(),
                ]);
            }
            table.text_or("no version was ever active") + more_hint(&list.next_page_token)
        })
    }
}
