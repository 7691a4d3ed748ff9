//! Kernels and their versions: their files in all formats, imports, interpolation, comparison.
//!
//! # Layout
//!
//! - `versions`: versions that somebody names. `choice`: which version a job uses.
//! - `model_file`: the models in files, and the memory that reading and writing them takes. `conversion`: files in other
//!   formats, each of which (`converted`) `conversions` lets one task make, and keeps. `conversion_notes`: what is kept,
//!   for the next start. `bundle`: files with all of a version.
//! - `import`, `interpolate`: new versions. `compare`: two of them.

mod bundle;
mod choice;
mod compare;
mod conversion;
mod conversion_notes;
mod conversions;
mod converted;
mod import;
mod interpolate;
mod model_file;
mod versions;

pub use choice::KernelChoice;
pub use conversion::{VersionFile, for_device};
pub use converted::Converted;
pub use import::KernelImport;

use crate::computing::Computing;
use crate::files::Files;
use conversions::Conversions;
use lightpath_artifacts::Artifacts;
use lightpath_store::Store;
use tokio_util::sync::CancellationToken;

/// Kernels and their versions. Clones share the files that were converted.
#[derive(Clone, Debug)]
pub struct Kernels {
    store: Store,
    artifacts: Artifacts,
    computing: Computing,
    files: Files,
    conversions: Conversions,
    /// Cancelled when the server stops.
    stopping: CancellationToken,
}

impl Kernels {
    pub(crate) fn new(
        store: Store,
        artifacts: Artifacts,
        computing: Computing,
        files: Files,
        stopping: CancellationToken,
    ) -> Self {
        let conversions = Conversions::open(&artifacts);
        Self { store, artifacts, computing, files, conversions, stopping }
    }
}
