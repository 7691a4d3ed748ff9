//! The optics with which the pairs of a dataset are checked.

use lightpath_domain::dataset::Dataset;
use lightpath_media::captures::{Captures, Reconstructor};
use std::sync::{Arc, Mutex, PoisonError};

/// The most recently used reconstructor, with its optics. The pairs of a dataset are usually added one after the other
/// and need the same reconstructor. Clones share it.
#[derive(Clone, Debug, Default)]
pub(super) struct LastReconstructor(Arc<Mutex<Option<(String, Reconstructor)>>>);

impl LastReconstructor {
    /// The reconstructor of a dataset: the stored one if it fits, or a new one. `None` if no image can be computed at
    /// the distance of the dataset.
    pub(super) fn of(&self, dataset: &Dataset, captures: &Captures) -> Option<Reconstructor> {
        let key = format!("{}/{}/{}", dataset.display, dataset.wavelength.pm, dataset.distance.nm);
        // The lock is held while a new reconstructor is made: two at once would need twice the memory.
        let mut last = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((last_key, reconstructor)) = last.as_ref()
            && *last_key == key
        {
            return Some(reconstructor.clone());
        }
        // The stored reconstructor is dropped first, so that only one is in memory.
        *last = None;
        let reconstructor = Reconstructor::of(captures).ok()?;
        *last = Some((key, reconstructor.clone()));
        Some(reconstructor)
    }
}
