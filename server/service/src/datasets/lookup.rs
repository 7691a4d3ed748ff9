//! Access to datasets by name.

use super::Datasets;
use crate::call::Call;
use crate::error::{Result, ServiceError};
use crate::field::Field;
use lightpath_domain::dataset::Dataset;
use lightpath_domain::display::Display;
use lightpath_domain::reason::PreconditionReason;
use lightpath_store::{PairFilter, PairsOf, StoreError};

impl Datasets {
    /// The dataset with this id and its pairs. `field` is the field with the id. A dataset of a display that the caller
    /// may not use is refused as one that does not exist.
    pub async fn named(&self, call: &Call, field: &Field, id: &str) -> Result<Dataset> {
        let found = self.store.dataset(id).await.and_then(|dataset| visible(call, dataset));
        found.map_err(|error| match error {
            StoreError::NotFound { resource } => field.missing(resource, "create it first"),
            other => other.into(),
        })
    }

    /// The dataset with this id without its pairs, for callers who may see it.
    pub async fn alone(&self, call: &Call, id: &str) -> Result<Dataset> {
        Ok(visible(call, self.store.dataset_alone(id).await?)?)
    }

    /// Some pairs of the dataset with this id, for callers who may see it.
    pub async fn pairs(
        &self,
        call: &Call,
        id: &str,
        filter: PairFilter,
        after: Option<&str>,
        limit: u32,
    ) -> Result<PairsOf> {
        let PairsOf { dataset, pairs } = self.store.pairs(id, filter, after, limit).await?;
        Ok(PairsOf { dataset: visible(call, dataset)?, pairs })
    }

    /// The finalized dataset with this id, which a field names, and its display. Refuses an open dataset.
    pub async fn finalized(&self, call: &Call, field: &Field, id: &str) -> Result<(Dataset, Display)> {
        let dataset = self.named(call, field, id).await?;
        if dataset.digest.is_none() {
            let (reason, fix) = match dataset.pair_count {
                0 => (PreconditionReason::DatasetEmpty, "is empty; add pairs and finalize it first"),
                _ => (PreconditionReason::DatasetOpen, "is still open; finalize it first"),
            };
            return Err(ServiceError::Precondition { reason, message: format!("{field}: datasets/{id} {fix}") });
        }
        let (display, _) = self.store.display(&dataset.display).await?;
        Ok((dataset, display))
    }
}

/// The dataset, if the caller may use its display. Otherwise it is refused as one that does not exist.
fn visible(call: &Call, dataset: Dataset) -> Result<Dataset, StoreError> {
    if call.caller.may_use(&dataset.display) {
        return Ok(dataset);
    }
    Err(StoreError::NotFound { resource: format!("datasets/{}", dataset.id) })
}
