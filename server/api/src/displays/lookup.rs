//! Access to displays by name.

use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use lightpath_domain::display::Display;
use lightpath_store::StoreError;

impl Api {
    /// The display that a field names. Refuses a name that does not exist or that the caller may not use.
    pub(crate) async fn display_named(&self, call: &Call, field: &Field, name: &str) -> Result<Display, ApiError> {
        let id = names::display_id(call, field, name)?;
        match self.store.display(&id).await {
            Err(StoreError::NotFound { resource }) => Err(field.missing(resource, "create it first")),
            other => Ok(other?.0),
        }
    }
}
