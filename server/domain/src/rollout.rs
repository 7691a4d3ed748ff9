//! Staged rollouts: a version goes to some devices first.

use crate::kernel::{Cause, KernelKey};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

/// What a rollout is asked to do.
#[derive(Clone, Debug, PartialEq)]
pub struct RolloutPlan {
    /// Number of the version that the rollout brings.
    pub version: u32,
    /// Share of the devices that get the version, 0 to 1.
    pub share: f64,
    /// Devices of this group get the version besides the share; empty: no group.
    pub group: String,
    /// Limit on the share of failed devices, 0 to 1. Above it the rollout halts.
    pub failed_share_max: f64,
    /// Least number of devices of which that share is computed, if so many get the version.
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

/// When a rollout halts by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Halting {
    /// Devices that the server knows and that get the version.
    pub devices_known: u32,
    /// Number of failed devices at which it halts while few have reported; `None`: it goes on even if all of these failed.
    pub failures_first: Option<u32>,
    /// The same when all these devices have reported.
    pub failures_of_all: Option<u32>,
}

impl Rollout {
    /// Whether so many devices failed that the rollout must halt. `devices_known`: devices that the server knows and that
    /// get the version. The share of failures is that of the devices that reported, but of as many as the plan says at
    /// least: the first reports do not decide for a large fleet. If fewer devices get the version at all, it is the share
    /// of these, so that one failure counts in a small fleet.
    #[must_use]
    pub fn has_failed(&self, devices_known: u32) -> bool {
        let reported = self.devices_passed + self.devices_failed;
        self.plan.is_above(self.devices_failed, reported.max(self.plan.devices_min.min(devices_known)))
    }

    /// At which numbers of failed devices the rollout halts.
    #[must_use]
    pub fn halting(&self, devices_known: u32) -> Halting {
        let failures_of = |devices: u32| (1..=devices).find(|&failed| self.plan.is_above(failed, devices));
        Halting {
            devices_known,
            failures_first: failures_of(self.plan.devices_min.min(devices_known)),
            failures_of_all: failures_of(devices_known),
        }
    }
}

impl RolloutPlan {
    /// Whether a device in a group (empty: none) gets the version of the rollout with this number.
    #[must_use]
    pub fn includes(&self, kernel: &KernelKey, rollout: u32, device: &str, group: &str) -> bool {
        let is_in_group = !self.group.is_empty() && self.group == group;
        is_in_group || is_in_share(kernel, rollout, device, self.share)
    }

    /// Whether so many failures among some devices are too many.
    fn is_above(&self, failed: u32, devices: u32) -> bool {
        // 29 of 100 are not more than 0.29, although 0.29 · 100 is a little less than 29 in floating point.
        f64::from(failed) > (self.failed_share_max + 1e-9) * f64::from(devices)
    }
}

/// Whether a device is among the first `share` of a rollout. A device that is among the first stays among them
/// when the share grows, and each rollout draws anew.
#[must_use]
pub fn is_in_share(kernel: &KernelKey, rollout: u32, device: &str, share: f64) -> bool {
    let digest = Sha256::digest(format!("{kernel}/rollouts/{rollout}/{device}"));
    let drawn = digest[..8].iter().fold(0_u64, |number, byte| number << 8 | u64::from(*byte));
    // 2^64, so that the draw is below 1.
    drawn as f64 / 18_446_744_073_709_551_616.0 < share
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
        let (few, many) = (in_share(1, 0.1), in_share(1, 0.5));
        // Binomial: 200 ± 13.4 and 1000 ± 22.4 devices; these are four standard deviations.
        assert!((146..=254).contains(&few.len()) && (910..=1090).contains(&many.len()), "{} {}", few.len(), many.len());
        assert!(few.iter().all(|device| many.contains(device)));
        assert_ne!(few, in_share(2, 0.1));
        assert_eq!((in_share(1, 0.0).len(), in_share(1, 1.0).len()), (0, 2000));
    }

    /// A rollout of which no device has reported.
    fn with_plan(failed_share_max: f64, devices_min: u32) -> Rollout {
        let plan = RolloutPlan {
            version: 2,
            share: 0.1,
            group: String::new(),
            failed_share_max,
            devices_min,
            self_test_loss_max: None,
            cause: Cause { caller: String::new(), reason: String::new() },
            overridden: Vec::new(),
        };
        Rollout {
            key: key(),
            number: 1,
            plan,
            from_version: Some(1),
            state: RolloutState::Running,
            devices_passed: 0,
            devices_failed: 0,
            start_time_ms: 0,
            end_time_ms: None,
            revision: 1,
        }
    }

    #[test]
    fn failures_above_the_limit_halt_a_rollout() {
        let with = |devices_passed, devices_failed| Rollout { devices_passed, devices_failed, ..with_plan(0.1, 10) };
        for (passed, failed, halts) in [(0, 0, false), (0, 1, false), (0, 2, true), (18, 2, false), (17, 2, true)] {
            assert_eq!(with(passed, failed).has_failed(1000), halts, "{passed} {failed}");
        }
        let halting =
            |devices, first, all| Halting { devices_known: devices, failures_first: first, failures_of_all: all };
        for (devices, first, all) in [
            (0, None, None),
            (5, Some(1), Some(1)),
            (10, Some(2), Some(2)),
            (25, Some(2), Some(3)),
            (1000, Some(2), Some(101)),
        ] {
            assert_eq!(with(0, 0).halting(devices), halting(devices, first, all));
        }
        assert!(with(4, 1).has_failed(5) && !with(0, 1).has_failed(10), "one of five is more than 10 %");
        let mut never = with(0, 5);
        never.plan.failed_share_max = 1.0;
        assert!(!never.has_failed(5));
        assert_eq!(never.halting(5), halting(5, None, None));
    }

    #[test]
    fn the_said_number_of_failures_is_the_one_that_halts() {
        let mut rollout = with_plan(0.07, 12);
        for devices in 1..60 {
            let said = rollout.halting(devices);
            let first = (1..=devices).find(|&failed| {
                (rollout.devices_passed, rollout.devices_failed) = (0, failed);
                rollout.has_failed(devices)
            });
            let of_all = (1..=devices).find(|&failed| {
                (rollout.devices_passed, rollout.devices_failed) = (devices - failed, failed);
                rollout.has_failed(devices)
            });
            assert_eq!((said.failures_first, said.failures_of_all), (first, of_all), "{devices}");
        }
    }
}
