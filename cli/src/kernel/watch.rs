//! The command `lightpath kernel watch`.

use crate::failure::Failure;
use crate::kernel_choice::KernelChoice;
use crate::session::{Output, Session, print_note};
use crate::show;
use clap::Args;
use lightpath::KernelChange;
use lightpath::v1::Kernel;
use std::ops::ControlFlow;
use std::process::{Command, Stdio};

/// Print when another version of a kernel becomes active, until Ctrl-C; survives a restart of the server.
///
/// The first line says which version is active now. With --exec a command runs at the start and after each change, such
/// as one that fetches the kernel; it runs in the shell, with LIGHTPATH_KERNEL (the kernel's name) and
/// LIGHTPATH_ACTIVE_VERSION (a number, 0 for none) in its environment. If it fails, watching goes on. With --output json
/// or jsonl each line is the kernel as JSON.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath kernel watch --display lab-2 --distance 150mm
  lightpath kernel watch --display lab-2 --distance 150mm --exec \\
      'lightpath kernel fetch $LIGHTPATH_KERNEL -o kernel.lpk'")]
pub(crate) struct Watch {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Run this shell command at the start and after each change
    #[arg(long, value_name = "COMMAND")]
    exec: Option<String>,
}

impl Watch {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let name = self.kernel.name(session).await?;
        let mut known = None;
        let mut outcome = Ok(());
        let following = session.client.follow_kernel(&name, |change| {
            match change {
                KernelChange::Kernel(kernel) if known != Some(kernel.active_version) => {
                    outcome = self.report(session, kernel, known);
                    known = Some(kernel.active_version);
                }
                KernelChange::ConnectionLost(error) => print_note(&format!("connection lost ({error}); reconnecting")),
                KernelChange::Reconnected => print_note("reconnected"),
                _ => {}
            }
            if outcome.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        tokio::select! {
            followed = following => followed?,
            Ok(()) = tokio::signal::ctrl_c() => return Ok(()),
        }
        outcome
    }

    /// Prints the active version, and runs the command.
    fn report(&self, session: &Session, kernel: &Kernel, before: Option<Option<u32>>) -> Result<(), Failure> {
        match session.output {
            Output::Table => session.print_text(&line(kernel, before))?,
            Output::Json | Output::Jsonl => session.print_compact(kernel)?,
        }
        if let Some(command) = &self.exec {
            let mut shell = Command::new("sh");
            shell.args(["-c", command]).stdin(Stdio::null());
            shell.env("LIGHTPATH_KERNEL", &kernel.name);
            shell.env("LIGHTPATH_ACTIVE_VERSION", kernel.active_version().to_string());
            match shell.status() {
                Ok(status) if status.success() => {}
                Ok(status) => print_note(&format!("the command of --exec failed: {status}")),
                Err(error) => print_note(&format!("the command of --exec could not be started: {error}")),
            }
        }
        Ok(())
    }
}

/// What became active, for example `2026-11-20 14:07:49 UTC  displays/…: version 3 is active (before: version 2)`.
fn line(kernel: &Kernel, before: Option<Option<u32>>) -> String {
    let word = |version: Option<u32>| version.map_or_else(|| "no version".to_owned(), show::kernel_version);
    let before = before.map(|before| format!(" (before: {})", word(before))).unwrap_or_default();
    let now = pbjson_types::Timestamp { seconds: show::now_s(), nanos: 0 };
    let time = show::clock_or_dash(Some(&now));
    format!("{time}  {}: {} is active{before}", kernel.name, word(kernel.active_version))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn line_names_the_active_version_and_the_one_before() {
        let kernel = Kernel { name: "displays/a/kernels/k".into(), active_version: Some(3), ..Default::default() };
        assert!(line(&kernel, None).ends_with("displays/a/kernels/k: version 3 is active"));
        assert!(line(&kernel, Some(None)).ends_with("version 3 is active (before: no version)"));
    }
}
