//! The latest small picture of each running job. It is kept in memory only: nothing of it is worth a file.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Pictures of running jobs by the ids of the jobs, shared by the workers that draw them and the API that shows them.
/// There are at most as many as jobs run at once. Clones share the pictures.
#[derive(Clone, Debug, Default)]
pub struct LivePictures {
    // Held only to copy a pointer, so no thread waits long.
    latest: Arc<Mutex<HashMap<String, Arc<[u8]>>>>,
}

impl LivePictures {
    /// Shows `png` as the picture of a job, instead of an earlier one.
    pub fn show(&self, job: &str, png: Vec<u8>) {
        self.with(|latest| latest.insert(job.to_owned(), png.into()));
    }

    /// The latest picture of a job as a PNG; `None` if it shows none.
    #[must_use]
    pub fn latest(&self, job: &str) -> Option<Arc<[u8]>> {
        self.with(|latest| latest.get(job).cloned())
    }

    /// Forgets the picture of a job.
    pub fn forget(&self, job: &str) {
        self.with(|latest| latest.remove(job));
    }

    fn with<T>(&self, work: impl FnOnce(&mut HashMap<String, Arc<[u8]>>) -> T) -> T {
        // A map is whole after every operation, so a panic elsewhere does no harm.
        work(&mut self.latest.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_latest_picture_is_shown_until_it_is_forgotten() {
        let (pictures, job) = (LivePictures::default(), "job");
        assert!(pictures.latest(job).is_none());
        pictures.clone().show(job, vec![1]);
        pictures.show(job, vec![2]);
        assert_eq!(pictures.latest(job).as_deref(), Some([2].as_slice()));
        assert!(pictures.latest("other").is_none());
        pictures.forget(job);
        assert!(pictures.latest(job).is_none());
    }
}
