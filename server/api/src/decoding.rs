//! Work of a call that takes a processor for long, such as decoding pictures: a few at a time, beside the threads that answer.

use crate::error::ApiError;
use lightpath_domain::dataset::Dataset;
use lightpath_media::captures::{Captures, Reconstructor};
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::Semaphore;

/// Pictures that are decoded at once for checking: one may take 1 GiB.
const DECODERS_MAX: usize = 2;

/// Runs such work; clones share their limit.
#[derive(Clone, Debug)]
pub(crate) struct Decoding(Arc<Semaphore>);

impl Default for Decoding {
    fn default() -> Self {
        Self(Arc::new(Semaphore::new(DECODERS_MAX)))
    }
}

impl Decoding {
    /// What `compute` returns, computed on a thread that may block.
    ///
    /// # Errors
    ///
    /// [`ApiError::Task`] where `compute` panics.
    pub(crate) async fn run<T: Send + 'static>(
        &self,
        compute: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, ApiError> {
        let _permit = Arc::clone(&self.0).acquire_owned().await.map_err(|_| ApiError::Stopping)?;
        tokio::task::spawn_blocking(compute).await.map_err(ApiError::Task)
    }
}

/// The reconstructor that was used last, with the optics that it is for. A dataset's pairs come one after the other, and
/// use the same one. Clones are the same.
#[derive(Clone, Debug, Default)]
pub(crate) struct LastReconstructor(Arc<Mutex<Option<(String, Reconstructor)>>>);

impl LastReconstructor {
    /// The reconstructor of a dataset: the last one, or a new one. `None` where no image can be computed at the dataset's
    /// distance.
    pub(crate) fn of(&self, dataset: &Dataset, captures: &Captures) -> Option<Reconstructor> {
        let key = format!("{}/{}/{}", dataset.display, dataset.wavelength.pm, dataset.distance.nm);
        // Held while a new one is made: two at once would take twice the memory.
        let mut last = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((of, reconstructor)) = last.as_ref()
            && *of == key
        {
            return Some(reconstructor.clone());
        }
        // The one before goes first, for the same reason.
        *last = None;
        let reconstructor = Reconstructor::of(captures).ok()?;
        *last = Some((key, reconstructor.clone()));
        Some(reconstructor)
    }
}
