//! Access to datasets by name.

use super::Datasets;
use crate::call::Call;
use crate::error::{Result, ServiceError};
use crate::field::Field;
use lightpath_domain::dataset::Dataset;
use lightpath_domain::display::Display;
use lightpath_domain::reason::PreconditionReason;
use lightpath_store::StoreError;

impl Datasets {
    /// The dataset with this id, as [`Self::visible`]. `field` is the field with the id.
    pub async fn named(&self, call: &Call, field: &Field, id: &str) -> Result<Dataset> {
        match self.visible(call, id).await {
            Err(ServiceError::Store(StoreError::NotFound { resource })) => {
                Err(field.missing(resource, "create it first"))
            }
            other => other,
        }
    }

    /// The dataset with this id. A dataset of a display that the caller may not use is refused as one that does not
    /// exist.
    pub async fn visible(&self, call: &Call, id: &str) -> Result<Dataset> {
        let dataset = self.store.dataset(id).await?;
        if call.caller.may_use(&dataset.display) {
            return Ok(dataset);
        }
        Err(StoreError::NotFound { resource: format!("datasets/{id}") }.into())
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
