//! Access to displays by name.

use crate::api::Api;
use crate::names;
use lightpath_domain::display::Display;
use lightpath_service::{Call, Field, Result};

impl Api {
    /// The display that a field names. Refuses a name that does not exist or that the caller may not use.
    pub(crate) async fn display_named(&self, call: &Call, field: &Field, name: &str) -> Result<Display> {
        let id = names::display_id(call, field, name)?;
        self.service.displays.named(field, &id).await
    }
}
