//! Artifacts as callers read and store them: who may read which, and whose they are.
//!
//! # Layout
//!
//! - `access`: which artifacts a caller may read. `read`: whole artifacts and ranges, compared with their digests.
//! - `picture`: artifacts as pictures, with the memory that reading them takes. `view`: pictures for people.
//! - `storing`: artifacts that the server made. `upload`: artifacts that callers send, in one call or several. `room`: what one owner may store.

mod access;
mod picture;
mod read;
mod room;
mod storing;
mod upload;
mod view;

pub(crate) use picture::unreadable;
pub use upload::UploadState;
pub use view::Minus;

use crate::computing::Computing;
use lightpath_artifacts::Artifacts;
use lightpath_store::Store;

/// The artifacts, as callers may use them. Clones share them.
#[derive(Clone, Debug)]
pub struct Files {
    store: Store,
    artifacts: Artifacts,
    computing: Computing,
    /// Limit on the bytes that one owner may store; 0: none.
    owner_bytes_max: u64,
}

impl Files {
    pub(crate) fn new(store: Store, artifacts: Artifacts, computing: Computing, owner_bytes_max: u64) -> Self {
        Self { store, artifacts, computing, owner_bytes_max }
    }
}
