//! Kernels and their versions: their files in all formats, imports, interpolation, comparison.
//!
//! # Layout
//!
//! - `versions`: versions that somebody names. `choice`: which version a job uses.
//! - `model_file`: the models in files, and the memory that reading and writing them takes. `conversion`: files in other
//!   formats, which `conversions` keeps. `bundle`: files with all of a version.
//! - `import`, `interpolate`: new versions. `compare`: two of them.

mod bundle;
mod choice;
mod compare;
mod conversion;
mod conversions;
mod import;
mod interpolate;
mod model_file;
mod versions;

pub use conversion::VersionFile;
pub use conversions::Converted;
pub use import::KernelImport;

use crate::computing::Computing;
use crate::files::Files;
use conversions::Conversions;
use lightpath_artifacts::Artifacts;
use lightpath_store::Store;

/// Kernels and their versions. Clones share the files that were converted.
#[derive(Clone, Debug)]
pub struct Kernels {
    store: Store,
    artifacts: Artifacts,
    computing: Computing,
    files: Files,
    conversions: Conversions,
}

impl Kernels {
    pub(crate) fn new(store: Store, artifacts: Artifacts, computing: Computing, files: Files) -> Self {
        Self { store, artifacts, computing, files, conversions: Conversions::default() }
    }
}
