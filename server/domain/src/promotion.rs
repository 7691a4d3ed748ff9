//! Promotion gates: what a version must show before it becomes active on a display.

use crate::kernel::{Cause, KernelMetrics, KernelVersion};
use crate::kernel_format::KernelFormat;
use lightpath_units::show_percent;
use serde::{Deserialize, Serialize};

/// What a version must show.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PromotionGate {
    /// How much lower its held-out loss must be than that of the active version, as a part of it; `None`: not checked.
    pub loss_reduction_min: Option<f64>,
    /// Whether it may have been measured to be no better than the ideal kernel.
    pub worse_than_ideal_allowed: bool,
    /// Least number of test pairs with which it was measured.
    pub test_pairs_min: u32,
    /// Formats in which it must be available.
    pub forms: Vec<KernelFormat>,
}

/// A promotion gate that was set.
#[derive(Clone, Debug, PartialEq)]
pub struct GateChange {
    /// Time of the change \[ms since 1970\].
    pub time_ms: i64,
    /// Who set the gate, and why.
    pub cause: Cause,
    /// The gate.
    pub gate: PromotionGate,
}

/// One check of a gate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GateCheck {
    /// Whether the version passed.
    pub passed: bool,
    /// What was checked, with the numbers.
    pub finding: String,
    /// Whether the version passed only because nothing was measured.
    pub is_unmeasured: bool,
}

impl GateCheck {
    /// A check with its result.
    #[must_use]
    pub fn new(passed: bool, finding: impl Into<String>) -> Self {
        Self { passed, finding: finding.into(), is_unmeasured: false }
    }

    /// A check that lets the version pass because nothing was measured.
    fn unmeasured(finding: impl Into<String>) -> Self {
        Self { is_unmeasured: true, ..Self::new(true, finding) }
    }
}

impl PromotionGate {
    /// Checks a version by its measurements and its record. The forms are checked by whoever can make them.
    #[must_use]
    pub fn check(&self, candidate: &KernelVersion, active: Option<&KernelVersion>) -> Vec<GateCheck> {
        let metrics = &candidate.content.metrics;
        let mut checks = Vec::new();
        if let Some(deprecation) = &candidate.deprecation {
            checks.push(GateCheck::new(false, format!("it is deprecated: {}", deprecation.cause.reason)));
        }
        if !self.worse_than_ideal_allowed {
            checks.push(against_ideal(metrics));
        }
        if self.test_pairs_min > 0 {
            let (found, least) = (metrics.test_pairs, self.test_pairs_min);
            checks.push(GateCheck::new(
                found >= least,
                format!("it was measured with {found} test pairs; at least {least} are required"),
            ));
        }
        let least = self.loss_reduction_min;
        checks.extend(least.zip(active).map(|(least, active)| against_active(metrics, active, least)));
        checks
    }
}

fn against_ideal(metrics: &KernelMetrics) -> GateCheck {
    if metrics.test_pairs == 0 && metrics.captured.is_none() {
        return GateCheck::unmeasured("it was not measured, so nothing says that it is worse than the ideal kernel");
    }
    let passed = !metrics.no_better_than_ideal();
    let verdict = if passed { "better than" } else { "no better than" };
    let mut finding = format!("it was measured to be {verdict} the ideal kernel");
    if metrics.test_pairs > 0 {
        finding += &format!(": held-out loss {:.6} against {:.6}", metrics.test_loss, metrics.ideal_test_loss);
    }
    if let Some(captured) = metrics.captured {
        finding += &format!(", photographs {:.1} against {:.1} dB", captured.psnr_db, captured.ideal_psnr_db);
    }
    GateCheck::new(passed, finding)
}

/// Compares the losses relative to the ideal kernel. So versions that were measured with different photographs can be
/// compared.
fn against_active(metrics: &KernelMetrics, active: &KernelVersion, reduction_min: f64) -> GateCheck {
    let number = active.version;
    let (Some(candidate), Some(present)) = (relative_loss(metrics), relative_loss(&active.content.metrics)) else {
        let finding = format!("it cannot be compared with the active version {number}: not both were measured");
        return GateCheck::new(false, finding);
    };
    let reduction = 1.0 - candidate / present;
    let finding = format!(
        "its held-out loss relative to the ideal kernel is {candidate:.4}, that of the active version {number} is \
         {present:.4}: {:.1} % lower; {} are required",
        100.0 * reduction,
        show_percent(reduction_min),
    );
    GateCheck::new(reduction >= reduction_min, finding)
}

/// Held-out loss relative to that of the ideal kernel.
fn relative_loss(metrics: &KernelMetrics) -> Option<f64> {
    let ratio = metrics.test_loss / metrics.ideal_test_loss;
    (metrics.test_pairs > 0 && ratio.is_finite()).then_some(ratio)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::{Deprecation, KernelKey, KernelModel, NewKernelVersion};
    use crate::lineage::{KernelLineage, KernelOrigin, Learning};
    use crate::units::{Distance, Wavelength};

    fn version(number: u32, test_pairs: u32, test_loss: f64, ideal_test_loss: f64) -> KernelVersion {
        let metrics = KernelMetrics { test_pairs, test_loss, ideal_test_loss, ..KernelMetrics::default() };
        let lineage = KernelLineage::of(KernelOrigin::Learned(Learning::default()));
        let model = KernelModel::Dense;
        let (wavelength, distance) = (Wavelength { pm: 515_000 }, Distance { nm: 150_000_000 });
        KernelVersion {
            key: KernelKey { display: "lab".to_owned(), wavelength, distance },
            version: number,
            content: NewKernelVersion { model, artifact: String::new(), size_bytes: 1, metrics, lineage },
            create_time_ms: 0,
            active: false,
            deprecation: None,
        }
    }

    fn failures(gate: &PromotionGate, candidate: &KernelVersion, active: Option<&KernelVersion>) -> Vec<String> {
        gate.check(candidate, active).into_iter().filter(|check| !check.passed).map(|check| check.finding).collect()
    }

    #[test]
    fn default_gate_refuses_what_is_deprecated_or_no_better_than_the_ideal_kernel() {
        let gate = PromotionGate::default();
        assert_eq!(failures(&gate, &version(1, 4, 0.01, 0.02), None), [""; 0]);
        assert_eq!(failures(&gate, &version(1, 0, 0.0, 0.0), None), [""; 0], "imported: not measured");
        let is_unmeasured = |pairs| gate.check(&version(1, pairs, 0.01, 0.02), None)[0].is_unmeasured;
        assert_eq!([0, 4].map(is_unmeasured), [true, false]);
        let worse = failures(&gate, &version(1, 4, 0.02, 0.01), None);
        assert!(
            worse[0].contains("no better than the ideal kernel: held-out loss 0.020000 against 0.010000"),
            "{worse:?}"
        );
        let cause = Cause { caller: "ada".to_owned(), reason: "the lens was dirty".to_owned() };
        let deprecated =
            KernelVersion { deprecation: Some(Deprecation { time_ms: 1, cause }), ..version(1, 4, 0.01, 0.02) };
        assert_eq!(failures(&gate, &deprecated, None), ["it is deprecated: the lens was dirty"]);
    }

    #[test]
    fn losses_are_compared_relative_to_the_ideal_kernel() {
        let gate = PromotionGate { loss_reduction_min: Some(0.1), ..PromotionGate::default() };
        let active = version(1, 4, 0.01, 0.02);
        assert_eq!(failures(&gate, &version(2, 4, 0.04, 0.1), Some(&active)), [""; 0], "0.4 against 0.5: 20 % lower");
        let refused = failures(&gate, &version(2, 4, 0.046, 0.1), Some(&active));
        assert!(refused[0].contains("8.0 % lower; 10 % are required"), "{refused:?}");
        let unmeasured = failures(&gate, &version(2, 0, 0.0, 0.0), Some(&active));
        assert!(unmeasured[0].contains("not both were measured"), "{unmeasured:?}");
        assert_eq!(failures(&gate, &version(2, 0, 0.0, 0.0), None), [""; 0], "the first version has no rival");
        let pairs = PromotionGate { test_pairs_min: 5, ..PromotionGate::default() };
        assert!(failures(&pairs, &active, None)[0].contains("4 test pairs; at least 5"));
    }
}
