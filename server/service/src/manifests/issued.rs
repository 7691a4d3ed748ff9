//! Kept that were made, and when they count.

use lightpath_domain::kernel::{KernelKey, KernelMoment};
use lightpath_manifest::Manifest;
use lightpath_media::kernel_formats::KernelFormat;
use std::collections::HashMap;
use std::hash::{BuildHasher as _, RandomState};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Limit on the manifests in memory. Each has about a kilobyte.
const KEPT_MAX: usize = 4096;
/// Periods of a manifest's life. In each one a new manifest is made, so that the one that a device gets counts for at
/// least seven eighths of its life.
const PERIODS: i64 = 8;

/// How long manifests count, and how often devices ask.
#[derive(Clone, Copy, Debug)]
pub struct ManifestRules {
    /// Time for which a manifest counts \[s\].
    pub life_s: u32,
    /// Mean time between two polls of a device \[s\].
    pub poll_interval_s: u32,
}

impl Default for ManifestRules {
    fn default() -> Self {
        Self { life_s: 7 * 24 * 3600, poll_interval_s: 60 }
    }
}

impl ManifestRules {
    /// First and last time of the manifests that are made at `now_s`. They begin a period early, for devices whose
    /// clocks are late.
    pub(super) fn times_s(self, now_s: i64) -> (i64, i64) {
        let start_s = self.period(now_s) * self.period_s();
        (start_s - self.period_s(), start_s + i64::from(self.life_s))
    }

    fn period(self, now_s: i64) -> i64 {
        now_s.div_euclid(self.period_s())
    }

    fn period_s(self) -> i64 {
        (i64::from(self.life_s) / PERIODS).max(1)
    }
}

/// Kernel, version and format of a manifest.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct IssuedKey {
    pub(super) kernel: KernelKey,
    pub(super) version: u32,
    pub(super) format: KernelFormat,
}

/// A manifest that was made.
#[derive(Debug)]
pub struct Issued {
    /// What it says.
    pub manifest: Manifest,
    /// The signed document.
    pub document: String,
    moment: KernelMoment,
}

impl Issued {
    pub(super) fn new(manifest: Manifest, document: String, moment: KernelMoment) -> Self {
        Self { manifest, document, moment }
    }
}

/// The manifests in memory. Clones share them.
#[derive(Clone, Debug)]
pub(super) struct Kept {
    rules: ManifestRules,
    kept: Arc<Mutex<HashMap<IssuedKey, Arc<Issued>>>>,
}

impl Kept {
    pub(super) fn new(rules: ManifestRules) -> Self {
        Self { rules, kept: Arc::default() }
    }

    pub(super) fn rules(&self) -> ManifestRules {
        self.rules
    }

    /// The manifest that was made for this moment and period.
    pub(super) fn find(&self, key: &IssuedKey, moment: &KernelMoment, now_s: i64) -> Option<Arc<Issued>> {
        let issued = self.lock().get(key).cloned()?;
        let (_, expires_s) = self.rules.times_s(now_s);
        let is_current = issued.moment == *moment && issued.manifest.expires.unix_s() == expires_s;
        is_current.then_some(issued)
    }

    pub(super) fn insert(&self, key: IssuedKey, issued: Issued) -> Arc<Issued> {
        let mut kept = self.lock();
        if kept.len() >= KEPT_MAX {
            kept.clear();
        }
        let issued = Arc::new(issued);
        kept.insert(key, Arc::clone(&issued));
        issued
    }

    /// Seconds after which a device should ask again: the mean time, and up to a quarter more or less, so that devices
    /// that were switched on together do not ask together for ever.
    pub(super) fn poll_after_s(&self) -> u32 {
        let mean = u64::from(self.rules.poll_interval_s);
        let random = RandomState::new().hash_one(0_u8) % (mean / 2 + 1);
        u32::try_from(mean - mean / 4 + random).unwrap_or(u32::MAX)
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<IssuedKey, Arc<Issued>>> {
        // The map is consistent even after a panic: nothing between its changes can panic.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn manifests_count_for_most_of_their_life_and_begin_early() {
        let rules = ManifestRules::default();
        for now_s in [1_795_458_600, 1_795_458_601, 1_795_500_000, 1_800_000_000] {
            let (from_s, until_s) = rules.times_s(now_s);
            assert!(from_s <= now_s - 75_600 && until_s > now_s + 7 * 75_600, "{from_s} {now_s} {until_s}");
        }
        assert_eq!(rules.times_s(1_795_458_600), rules.times_s(1_795_458_601));
    }

    #[test]
    fn devices_ask_at_scattered_times() {
        let manifests = Kept::new(ManifestRules::default());
        let times: Vec<u32> = (0..200).map(|_| manifests.poll_after_s()).collect();
        assert!(times.iter().all(|time| (45..=75).contains(time)), "{times:?}");
        assert!(times.iter().min() < Some(&50) && times.iter().max() > Some(&70), "{times:?}");
        let manifests = Kept::new(ManifestRules { poll_interval_s: 1, ..ManifestRules::default() });
        assert_eq!(manifests.poll_after_s(), 1);
    }
}
