//! Displays: declaring, finding and deleting them.

use crate::call::Call;
use crate::error::Result;
use crate::field::Field;
use lightpath_domain::display::Display;
use lightpath_store::{Store, StoreError};

/// Displays.
#[derive(Clone, Debug)]
pub struct Displays {
    store: Store,
}

impl Displays {
    pub(crate) fn new(store: Store) -> Self {
        Self { store }
    }

    /// Declares a display. Returns also the time when it was first declared \[ms since 1970\].
    pub async fn create(&self, display: &Display) -> Result<(Display, i64)> {
        Ok(self.store.create_display(display, self.store.now_ms()).await?)
    }

    /// The display with this id, which a field names. Refuses one that does not exist.
    pub async fn named(&self, field: &Field, id: &str) -> Result<Display> {
        match self.store.display(id).await {
            Err(StoreError::NotFound { resource }) => Err(field.missing(resource, "create it first")),
            other => Ok(other?.0),
        }
    }

    /// At most `limit` displays that the caller may use, from the first one after `after` on, with the times when they
    /// were declared \[ms since 1970\]. Other displays appear neither here nor in a page token.
    pub async fn visible(&self, call: &Call, mut after: Option<String>, limit: u32) -> Result<Vec<(Display, i64)>> {
        let mut visible = Vec::new();
        loop {
            let displays = self.store.displays(after.as_deref(), limit).await?;
            let is_last = displays.len() < limit as usize;
            after = displays.last().map(|(display, _)| display.id.clone());
            visible.extend(displays.into_iter().filter(|(display, _)| call.caller.may_use(&display.id)));
            visible.truncate(limit as usize);
            if is_last || visible.len() == limit as usize {
                return Ok(visible);
            }
        }
    }

    /// Deletes a display.
    pub async fn delete(&self, id: &str) -> Result<()> {
        Ok(self.store.delete_display(id).await?)
    }
}
