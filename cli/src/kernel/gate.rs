//! The commands `lightpath kernel gate` and `check`.

use crate::arguments::percent;
use crate::failure::Failure;
use crate::kernel_choice::KernelChoice;
use crate::session::Session;
use crate::show;
use crate::table::{Facts, Table};
use clap::Args;
use lightpath::units::show_percent;
use lightpath::{names, v1};

/// Show or set what versions must show before they become active on a display.
///
/// Without options the gate and its history are shown. With options a new gate replaces the whole old one; options that
/// are not given take their defaults. The formats that devices of the display use are always required.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath kernel gate lab-2
  lightpath kernel gate lab-2 --better-than-active 5% --test-pairs 4 \\
      --format compact --reason \"firmware 3 reads only the compact form\"")]
pub(crate) struct Gate {
    /// Id of the display
    #[arg(value_name = "DISPLAY")]
    display: String,

    /// Require a held-out loss that is this much lower than that of the active version, for example 5% [default: not
    /// checked]
    #[arg(long, value_name = "PERCENT", value_parser = percent)]
    better_than_active: Option<f64>,

    /// Require at least this many test pairs [default: 0]
    #[arg(long, value_name = "N")]
    test_pairs: Option<u32>,

    /// Require this format, such as compact; may be given several times
    #[arg(long = "format", value_name = "FORMAT")]
    formats: Vec<String>,

    /// Accept versions that were measured to be no better than the ideal kernel
    #[arg(long)]
    allow_worse_than_ideal: bool,

    /// Set the default gate: not measured to be worse than the ideal kernel
    #[arg(long, conflicts_with_all = ["better_than_active", "test_pairs", "formats", "allow_worse_than_ideal"])]
    default: bool,

    /// Record this reason in the history, at most 1024 bytes [default: none]
    #[arg(long, value_name = "TEXT", default_value = "", hide_default_value = true)]
    reason: String,
}

/// Check whether a version would pass the display's promotion gate, without promoting it.
///
/// The exit code is 1 if it would not.
#[derive(Debug, Args)]
pub(crate) struct Check {
    #[command(flatten)]
    kernel: KernelChoice,

    /// Check this version
    #[arg(long, value_name = "N")]
    version: u32,
}

impl Gate {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let display = names::display(&self.display);
        let sets = self.default
            || self.allow_worse_than_ideal
            || self.better_than_active.is_some()
            || self.test_pairs.is_some()
            || !self.formats.is_empty();
        if !sets && !self.reason.is_empty() {
            let fix = "--reason is for a new gate: give its options, or --default";
            return Err(Failure::Usage(fix.to_owned()));
        }
        let gate = if sets {
            let gate = v1::PromotionGate {
                loss_reduction_min: self.better_than_active,
                worse_than_ideal_allowed: self.allow_worse_than_ideal,
                test_pairs_min: self.test_pairs.unwrap_or(0),
                formats: self.formats,
            };
            let request = v1::SetPromotionGateRequest { display, gate: Some(gate), reason: self.reason };
            session.client.set_promotion_gate(request).await?
        } else {
            session.client.get_promotion_gate(v1::GetPromotionGateRequest { display }).await?
        };
        session.print(&gate, gate_text)
    }
}

impl Check {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let name = names::kernel_version(&self.kernel.name(session).await?, self.version);
        let verdict = session.client.check_promotion(v1::CheckPromotionRequest { name }).await?;
        session.print(&verdict, verdict_text)?;
        if verdict.passed { Ok(()) } else { Err(Failure::Refused("the version does not pass the gate".to_owned())) }
    }
}

fn gate_text(display: &v1::DisplayGate) -> String {
    let gate = display.gate.clone().unwrap_or_default();
    let mut facts = Facts::default();
    facts.add("display", &display.display);
    for (name, value) in rules(&gate) {
        facts.add(name, value);
    }
    let mut table = Table::new("set??|age?|by~?|gate_|reason_");
    for change in &display.history {
        let gate = change.gate.clone().unwrap_or_default();
        let words: Vec<String> = rules(&gate).into_iter().map(|(name, value)| format!("{name} {value}")).collect();
        table.row([
            show::clock_or_dash(change.time.as_ref()),
            show::age_or_dash(change.time.as_ref()),
            show::or_dash(&change.caller),
            words.join(", "),
            change.reason.clone(),
        ]);
    }
    format!("{}\n{}", facts.text(), table.text_or("no gate was set; this is the default one"))
}

fn rules(gate: &v1::PromotionGate) -> Vec<(&'static str, String)> {
    let least = gate.loss_reduction_min.map(show_percent);
    let better = least.map_or_else(|| "not compared".to_owned(), |least| format!("{least} less loss"));
    let ideal = if gate.worse_than_ideal_allowed { "may be worse" } else { "must not be worse" };
    let mut formats = gate.formats.clone();
    formats.push("those in use".to_owned());
    vec![
        ("active version:", better),
        ("ideal kernel:", ideal.to_owned()),
        ("test pairs:", format!("at least {}", gate.test_pairs_min)),
        ("formats:", formats.join(", ")),
    ]
}

fn verdict_text(verdict: &v1::PromotionVerdict) -> String {
    let mut table = Table::new("check|finding_");
    for check in &verdict.checks {
        let result = match (check.passed, check.not_measured) {
            (false, _) => "FAILED",
            (true, true) => "not measured",
            (true, false) => "passed",
        };
        table.row([result.to_owned(), check.finding.clone()]);
    }
    let active = match verdict.active_version {
        None => "no version is active".to_owned(),
        Some(version) => format!("version {version} is active"),
    };
    format!("{}{active}\n", table.text())
}
