//! Access to datasets by name.

use crate::api::Api;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use crate::permissions::require_display;
use lightpath_domain::access::Caller;
use lightpath_domain::dataset::Dataset;
use lightpath_domain::display::Display;
use lightpath_domain::reason::PreconditionReason;
use lightpath_store::StoreError;

impl Api {
    /// The dataset with this id. Refuses an id that does not exist, and a dataset of a display that the caller may not
    /// use. `field` is the field with the id.
    pub(crate) async fn dataset_named(&self, caller: &Caller, field: &Field, id: &str) -> Result<Dataset, ApiError> {
        match self.store.dataset(id).await {
            Err(StoreError::NotFound { resource }) => Err(field.missing(resource, "create it first")),
            other => {
                let dataset = other?;
                require_display(caller, &dataset.display)?;
                Ok(dataset)
            }
        }
    }

    /// The finalized dataset that a field names, and its display. Refuses an open dataset.
    pub(crate) async fn finalized_dataset(
        &self,
        caller: &Caller,
        field: &Field,
        name: &str,
    ) -> Result<(Dataset, Display), ApiError> {
        let id = names::dataset_id(field, name)?;
        let dataset = self.dataset_named(caller, field, &id).await?;
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
