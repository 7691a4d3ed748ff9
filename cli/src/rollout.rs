//! The commands `lightpath rollout …`.

use super::arguments::{Limit, Passage, percent};
use super::failure::Failure;
use super::kernel_choice::KernelChoice;
use super::pages::pages;
use super::session::{Session, print_note};
use super::show;
use super::table::{Facts, Table};
use clap::{Args, Subcommand};
use lightpath::units::show_percent;
use lightpath::{Words as _, names, v1};

/// Commands for staged rollouts.
#[derive(Debug, Subcommand)]
pub(crate) enum RolloutCommand {
    Start(Start),
    /// Give the version to a larger share of the devices
    Widen {
        #[command(flatten)]
        rollout: Choice,

        /// The new share, for example 25%
        #[arg(long, value_name = "PERCENT", value_parser = percent)]
        share: f64,
    },
    /// Make the version active, which ends the rollout
    Complete(Choice),
    /// End the rollout: all devices go back to the active version
    Halt {
        #[command(flatten)]
        rollout: Choice,

        /// Record this reason in the history, at most 1024 bytes [default: none]
        #[arg(long, value_name = "TEXT", default_value = "", hide_default_value = true)]
        reason: String,
    },
    /// Show a rollout and what happened in it
    Show(Choice),
    List(List),
}

/// Give a version to a share of the devices, or to a group, before it becomes active.
///
/// Devices report whether they use it and what their self-tests measured. If too many fail, the rollout halts by itself
/// and all devices go back to the active version; the answer says at how many. The version must pass the display's
/// promotion gate, and the files that devices need are made before the rollout starts.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath rollout start --display lab --distance 150mm --version 4 --share 5%
  lightpath rollout widen --display lab --distance 150mm --share 25%
  lightpath rollout show --display lab --distance 150mm
  lightpath rollout complete --display lab --distance 150mm")]
pub(crate) struct Start {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Bring this version
    #[arg(long, value_name = "N")]
    version: u32,

    /// Give it to this share of the devices, for example 5%
    #[arg(
        long,
        value_name = "PERCENT",
        value_parser = percent,
        default_value = "0%",
        hide_default_value = true,
        required_unless_present = "group"
    )]
    share: f64,

    /// Give it to the devices of this group as well
    #[arg(long, value_name = "GROUP", default_value = "", hide_default_value = true)]
    group: String,

    /// Halt when more than this share of the devices that reported have failed
    #[arg(long, value_name = "PERCENT", value_parser = percent, default_value = "10%")]
    failed_max: f64,

    /// Compute the share for --failed-max as if at least this many devices had reported, or all that get the version if
    /// they are fewer
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..))]
    devices_min: u32,

    /// Count a device as failed if its self-test measures a larger loss [default: no limit]
    #[arg(long, value_name = "LOSS")]
    self_test_loss_max: Option<f64>,

    #[command(flatten)]
    passage: Passage,
}

/// A rollout: by default the running one of a kernel.
#[derive(Debug, Args)]
pub(crate) struct Choice {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Number of the rollout [default: the running one, or the newest]
    #[arg(long, value_name = "N")]
    number: Option<u32>,
}

/// List the rollouts of a kernel, newest first.
#[derive(Debug, Args)]
pub(crate) struct List {
    #[command(flatten)]
    kernel: KernelChoice,

    #[command(flatten)]
    limit: Limit,
}

impl RolloutCommand {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        let client = &session.client;
        let name = match self {
            Self::Start(start) => start.run(session).await?,
            Self::Widen { rollout, share } => {
                let (name, revision) = rollout.find(session).await?;
                let expected_revision = Some(revision);
                let request = v1::WidenRolloutRequest { name, share, expected_revision };
                client.widen_rollout(request).await?.name
            }
            Self::Complete(rollout) => {
                let (name, revision) = rollout.find(session).await?;
                let request = v1::CompleteRolloutRequest { name, expected_revision: Some(revision) };
                client.complete_rollout(request).await?.name
            }
            Self::Halt { rollout, reason } => {
                let (name, _) = rollout.find(session).await?;
                client.halt_rollout(v1::HaltRolloutRequest { name, reason }).await?.name
            }
            Self::Show(rollout) => rollout.find(session).await?.0,
            Self::List(list) => return list.run(session).await,
        };
        let rollout = client.get_rollout(v1::GetRolloutRequest { name }).await?;
        if let Some(warning) = warning(&rollout) {
            print_note(&warning);
        }
        session.print(&rollout, text)
    }
}

impl Start {
    /// Starts the rollout and returns its name.
    async fn run(self, session: &Session) -> Result<String, Failure> {
        let Passage { reason, force, expected_active } = self.passage;
        let request = v1::StartRolloutRequest {
            kernel: self.kernel.name(session).await?,
            version: self.version,
            share: self.share,
            group: self.group,
            failed_share_max: Some(self.failed_max),
            devices_min: Some(self.devices_min),
            self_test_loss_max: self.self_test_loss_max,
            reason,
            expected_active_version: expected_active,
            force,
            ..Default::default()
        };
        Ok(session.client.start_rollout(request).await?.name)
    }
}

impl Choice {
    /// Name and revision of the rollout.
    async fn find(&self, session: &Session) -> Result<(String, u32), Failure> {
        let kernel = self.kernel.name(session).await?;
        if let Some(number) = self.number {
            let name = names::rollout(&kernel, number);
            let rollout = session.client.get_rollout(v1::GetRolloutRequest { name }).await?;
            return Ok((rollout.name, rollout.revision));
        }
        // The running rollout of a kernel is its newest one.
        let request = v1::ListRolloutsRequest { kernel: kernel.clone(), page_size: 1, ..Default::default() };
        let newest = session.client.list_rollouts(request).await?.rollouts.pop();
        let rollout = newest.ok_or_else(|| Failure::Refused(format!("{kernel} has no rollouts")))?;
        Ok((rollout.name, rollout.revision))
    }
}

impl List {
    async fn run(self, session: &Session) -> Result<(), Failure> {
        let kernel = self.kernel.name(session).await?;
        let list = pages(self.limit.limit, async |page_size, page_token| {
            let request = v1::ListRolloutsRequest { kernel: kernel.clone(), page_size, page_token };
            session.client.list_rollouts(request).await
        })
        .await?;
        session.print_pages(list, |rollouts| {
            let mut table = Table::new(">rollout|state|>version|>from?|devices~?|>passed|>failed|started???|age??");
            for rollout in rollouts {
                table.row([
                    names::id(&rollout.name).to_owned(),
                    rollout.state().word().to_owned(),
                    rollout.version.to_string(),
                    show::version_or_dash(rollout.from_version),
                    devices(rollout),
                    rollout.devices_passed.to_string(),
                    rollout.devices_failed.to_string(),
                    show::clock_or_dash(rollout.start_time.as_ref()),
                    show::age_or_dash(rollout.start_time.as_ref()),
                ]);
            }
            table.text_or("no rollouts; start one: lightpath rollout start --help")
        })
    }
}

fn text(rollout: &v1::Rollout) -> String {
    let mut facts = Facts::default();
    facts.add("rollout", &rollout.name);
    facts.add("state", rollout.state().word());
    let from = rollout.from_version.map_or_else(|| "none".to_owned(), |version| version.to_string());
    facts.add("versions", format!("{} for the first devices, {from} for the others", rollout.version));
    facts.add("first devices", devices(rollout));
    let loss = rollout.self_test_loss_max.map(|loss| format!(", self-test loss at most {}", show::loss(loss)));
    let limit = format!("{} of at least {} devices", show_percent(rollout.failed_share_max), rollout.devices_min);
    facts.add("halts above", limit + &loss.unwrap_or_default());
    if let Some(halting) = &rollout.halting {
        facts.add("halts at", halts_at(halting));
    }
    facts.add("reports", format!("{} passed, {} failed", rollout.devices_passed, rollout.devices_failed));
    let mut table = Table::new("time???|age|caller~?|>generation??|event_");
    for event in &rollout.events {
        table.row([
            show::clock_or_dash(event.time.as_ref()),
            show::age_or_dash(event.time.as_ref()),
            show::or_dash(&event.caller),
            event.generation.to_string(),
            event.message.clone(),
        ]);
    }
    format!("{}\n{}", facts.text(), table.text())
}

/// At how many failures a running rollout halts.
fn halts_at(halting: &v1::rollout::Halting) -> String {
    let &v1::rollout::Halting { devices_known, failures_first, failures_of_all } = halting;
    let failed = |count: u32| if count == 1 { "1 failed device".to_owned() } else { format!("{count} failed devices") };
    match (devices_known, failures_of_all) {
        (0, _) => "no device that gets the version has reported yet".to_owned(),
        (_, None) => format!("no number of failures among the {devices_known} devices that get the version"),
        (_, Some(all)) => match failures_first {
            Some(first) if first != all => {
                format!("{} of the first that report, {all} of all {devices_known}", failed(first))
            }
            _ => format!("{} of {devices_known}", failed(all)),
        },
    }
}

/// A warning about a running rollout that cannot halt by itself.
fn warning(rollout: &v1::Rollout) -> Option<String> {
    let halting = rollout.halting.as_ref()?;
    let name = &rollout.name;
    match (halting.devices_known, halting.failures_of_all) {
        (0, _) => Some(format!(
            "warning: no device that has reported about this kernel gets the version of {name}; lightpath device list \
             shows the devices"
        )),
        (_, None) => Some(format!(
            "warning: {name} does not halt by itself, even if all {} devices fail: --failed-max is {}",
            halting.devices_known,
            show_percent(rollout.failed_share_max)
        )),
        _ => None,
    }
}

fn devices(rollout: &v1::Rollout) -> String {
    let share = show_percent(rollout.share);
    match rollout.group.as_str() {
        "" => share,
        group => format!("{share} and the group {group}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_running_rollout_says_at_how_many_failures_it_halts() {
        let halting = |devices_known, failures_first, failures_of_all| v1::rollout::Halting {
            devices_known,
            failures_first,
            failures_of_all,
        };
        for (halting, said, warns) in [
            (halting(5, Some(1), Some(1)), "1 failed device of 5", None),
            (halting(1000, Some(2), Some(101)), "2 failed devices of the first that report, 101 of all 1000", None),
            (halting(5, None, None), "no number of failures among the 5", Some("even if all 5 devices fail")),
            (
                halting(0, None, None),
                "no device that gets the version has reported",
                Some("no device that has reported"),
            ),
        ] {
            assert!(halts_at(&halting).starts_with(said), "{}", halts_at(&halting));
            let rollout = v1::Rollout { halting: Some(halting), ..Default::default() };
            match (warning(&rollout), warns) {
                (Some(warning), Some(words)) => assert!(warning.contains(words), "{warning}"),
                (warning, words) => assert_eq!(warning, words.map(str::to_owned)),
            }
        }
        assert_eq!(warning(&v1::Rollout::default()), None, "an ended rollout");
    }
}
