//! Access to datasets by name.

use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use lightpath_domain::dataset::Dataset;
use lightpath_domain::display::Display;
use lightpath_domain::reason::PreconditionReason;
use lightpath_store::StoreError;

impl Api {
    /// The dataset with this id, as [`Self::visible_dataset`]. `field` is the field with the id.
    pub(crate) async fn dataset_named(&self, call: &Call, field: &Field, id: &str) -> Result<Dataset, ApiError> {
        match self.visible_dataset(call, id).await {
            Err(ApiError::Store(StoreError::NotFound { resource })) => Err(field.missing(resource, "create it first")),
            other => other,
        }
    }

    /// The dataset with this id. A dataset of a display that the caller may not use is refused as one that does not
    /// exist.
    pub(crate) async fn visible_dataset(&self, call: &Call, id: &str) -> Result<Dataset, ApiError> {
        let dataset = self.store.dataset(id).await?;
        if call.caller.may_use(&dataset.display) {
            return Ok(dataset);
        }
        Err(StoreError::NotFound { resource: format!("datasets/{id}") }.into())
    }

    /// The finalized dataset that a field names, and its display. Refuses an open dataset.
    pub(crate) async fn finalized_dataset(
        &self,
        call: &Call,
        field: &Field,
        name: &str,
    ) -> Result<(Dataset, Display), ApiError> {
        let id = names::dataset_id(field, name)?;
        let dataset = self.dataset_named(call, field, &id).await?;
        if dataset.digest.is_none() {
            let (reason, fix) = match dataset.pair_count {
                0 => (PreconditionReason::DatasetEmpty, "is empty; add pairs and finalize it first"),
                _ => (PreconditionReason::DatasetOpen, "is still open; finalize it first"),
            };
            return Err(ApiError::Precondition { reason, message: format!("{field}: datasets/{id} {fix}") });
        }
        let (display, _) = self.store.display(&dataset.display).await?;
        Ok((dataset, display))
    }
}
