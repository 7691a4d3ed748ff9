//! Datasets: creating and deleting them, adding pairs, and calibration targets. Jobs align and finalize datasets.
//!
//! # Layout
//!
//! - `lookup`: datasets that somebody names. `pairs`: adding pairs, with the optics in `reconstructors`.
//! - `calibration`: the picture from whose photograph an alignment is found.

mod calibration;
mod lookup;
mod pairs;
mod reconstructors;

pub use calibration::CalibrationTarget;

use crate::call::Call;
use crate::computing::Computing;
use crate::error::Result;
use crate::files::Files;
use lightpath_artifacts::Artifacts;
use lightpath_domain::dataset::Dataset;
use lightpath_store::Store;
use reconstructors::LastReconstructor;

/// Datasets. Clones share the optics that were used last.
#[derive(Clone, Debug)]
pub struct Datasets {
    store: Store,
    artifacts: Artifacts,
    computing: Computing,
    files: Files,
    last_reconstructor: LastReconstructor,
}

impl Datasets {
    pub(crate) fn new(store: Store, artifacts: Artifacts, computing: Computing, files: Files) -> Self {
        Self { store, artifacts, computing, files, last_reconstructor: LastReconstructor::default() }
    }

    /// Creates a dataset without pairs.
    pub async fn create(&self, dataset: &Dataset) -> Result<Dataset> {
        Ok(self.store.create_dataset(dataset, self.store.now_ms()).await?)
    }

    /// Deletes a dataset.
    pub async fn delete(&self, call: &Call, id: &str) -> Result<()> {
        self.alone(call, id).await?;
        Ok(self.store.delete_dataset(id, self.store.now_ms()).await?)
    }
}
