//! Staged rollouts: a version goes to some devices first.

use crate::kernel::{Cause, KernelKey};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

/// What a rollout is asked to do.
#[derive(Clone, Debug, PartialEq)]
pub struct RolloutPlan {
    /// Number of the version that the rollout brings.
    pub version: u32,
    /// Share of the devices that get the version \[%\].
    pub share_percent: f64,
    /// Devices of this group get the version besides the share; empty: no group.
    pub group: String,
    /// Limit on the share of failed devices \[%\]. Above it the rollout halts.
    pub failed_percent_max: f64,
    /// Least number of devices of which that share is computed.
    pub devices_min: u32,
    /// Limit on the loss of self-tests.
    pub self_test_loss_max: Option<f64>,
    /// Who starts it, and why.
    pub cause: Cause,
    /// What failed of the promotion gate and was overridden.
    pub overridden: Vec<String>,
}

/// A staged rollout of a version.
#[derive(Clone, Debug, PartialEq)]
pub struct Rollout {
    /// The kernel.
    pub key: KernelKey,
    /// Number of the rollout, from 1.
    pub number: u32,
    /// What was asked for, with the present share.
    pub plan: RolloutPlan,
    /// Version that the other devices have; `None`: none.
    pub from_version: Option<u32>,
    /// State of the rollout.
    pub state: RolloutState,
    /// Devices that reported the version in use.
    pub devices_passed: u32,
    /// Devices that failed with the version.
    pub devices_failed: u32,
    /// Time of the start \[ms since 1970\].
    pub start_time_ms: i64,
    /// Time of the end \[ms since 1970\].
    pub end_time_ms: Option<i64>,
    /// Number of changes, from 1.
    pub revision: u32,
}

/// States of a rollout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RolloutState {
    /// Some devices get the version.
    Running,
    /// The version is active.
    Completed,
    /// All devices went back.
    Halted,
}

/// A change of a rollout.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RolloutEvent {
    /// Time of the change \[ms since 1970\].
    pub time_ms: i64,
    /// Name of the token; empty: no token was required, or failures of devices caused the change.
    pub caller: String,
    /// What happened and why.
    pub message: String,
    /// Generation of the display afterwards.
    pub generation: u64,
}

impl Rollout {
    /// Whether so many devices failed that the rollout must halt.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        let reported = (self.devices_passed + self.devices_failed).max(self.plan.devices_min);
        f64::from(self.devices_failed) * 100.0 > self.plan.failed_percent_max * f64::from(reported)
    }
}

/// Whether a device is among the first `share_percent` of a rollout. A device that is among the first stays among them
/// when the share grows, and each rollout draws anew.
#[must_use]
pub fn is_in_share(kernel: &KernelKey, rollout: u32, device: &str, share_percent: f64) -> bool {
    let digest = Sha256::digest(format!("{kernel}/rollouts/{rollout}/{device}"));
    let drawn = digest[..8].iter().fold(0_u64, |number, byte| number << 8 | u64::from(*byte));
    // 2^64, so that the draw is below 100 %.
    (drawn as f64 / 18_446_744_073_709_551_616.0) * 100.0 < share_percent
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{Distance, Wavelength};

    fn key() -> KernelKey {
        let (wavelength, distance) = (Wavelength { pm: 515_000 }, Distance { nm: 150_000_000 });
        KernelKey { display: "lab".to_owned(), wavelength, distance }
    }

    #[test]
    fn share_is_drawn_evenly_grows_and_differs_between_rollouts() {
        let in_share = |rollout: u32, share: f64| -> Vec<usize> {
            (0..2000).filter(|n| is_in_share(&key(), rollout, &format!("bench-{n}"), share)).collect()
        };
        let (few, many) = (in_share(1, 10.0), in_share(1, 50.0));
        // Binomial: 200 ± 13.4 and 1000 ± 22.4 devices; these are four standard deviations.
        assert!((146..=254).contains(&few.len()) && (910..=1090).contains(&many.len()), "{} {}", few.len(), many.len());
        assert!(few.iter().all(|device| many.contains(device)));
        assert_ne!(few, in_share(2, 10.0));
        assert_eq!((in_share(1, 0.0).len(), in_share(1, 100.0).len()), (0, 2000));
    }

    #[test]
    fn failures_above_the_limit_halt_a_rollout() {
        let plan = RolloutPlan {
            version: 2,
            share_percent: 10.0,
            group: String::new(),
            failed_percent_max: 10.0,
            devices_min: 10,
            self_test_loss_max: None,
            cause: Cause { caller: String::new(), reason: String::new() },
            overridden: Vec::new(),
        };
        let with = |devices_passed: u32, devices_failed: u32| Rollout {
            key: key(),
            number: 1,
            plan: plan.clone(),
            from_version: Some(1),
            state: RolloutState::Running,
            devices_passed,
            devices_failed,
            start_time_ms: 0,
            end_time_ms: None,
            revision: 1,
        };
        for (passed, failed, halts) in [(0, 0, false), (0, 1, false), (0, 2, true), (18, 2, false), (17, 2, true)] {
            assert_eq!(with(passed, failed).has_failed(), halts, "{passed} {failed}");
        }
    }
}
