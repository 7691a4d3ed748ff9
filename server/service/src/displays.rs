//! Displays: declaring, finding and deleting them.

use crate::call::Call;
use crate::error::Result;
use crate::field::Field;
use lightpath_domain::display::Display;
use lightpath_store::{DisplayRecord, Store, StoreError};

/// Displays.
#[derive(Clone, Debug)]
pub struct Displays {
    store: Store,
}

impl Displays {
    pub(crate) fn new(store: Store) -> Self {
        Self { store }
    }

    /// Declares a display.
    pub async fn create(&self, display: &Display) -> Result<(Display, DisplayRecord)> {
        Ok(self.store.create_display(display, self.store.now_ms()).await?)
    }

    /// The display with this id, which a field names. Refuses one that does not exist.
    pub async fn named(&self, field: &Field, id: &str) -> Result<Display> {
        match self.store.display(id).await {
            Err(StoreError::NotFound { resource }) => Err(field.missing(resource, "create it first")),
            other => Ok(other?.0),
        }
    }

    /// At most `limit` displays that the caller may use, from the first one after `after` on. Other displays appear neither here nor in a page token.
    pub async fn visible(
        &self,
        call: &Call,
        mut after: Option<String>,
        limit: u32,
    ) -> Result<Vec<(Display, DisplayRecord)>> {
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

    /// Gives a display other notes, if it has the expected revision.
    pub async fn set_notes(&self, id: &str, notes: String, expected: Option<u32>) -> Result<(Display, DisplayRecord)> {
        Ok(self.store.set_display_notes(id, notes, expected).await?)
    }

    /// Deletes a display.
    pub async fn delete(&self, id: &str) -> Result<()> {
        Ok(self.store.delete_display(id).await?)
    }
}
