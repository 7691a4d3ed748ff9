//! Bundles: files with all of a version, to carry it to another server.
//!
//! A bundle is a kernel file in the native form whose header also has the record of the version.

use lightpath_domain::kernel::{KernelMetrics, KernelVersion};
use lightpath_domain::lineage::{Import, KernelLineage, KernelOrigin, Made, OriginalVersion};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// What a server knows of a version besides its file.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Record {
    /// Resource name of the version on the server that made the bundle.
    pub(super) version: String,
    /// Digest of the version's own file there.
    pub(super) artifact: String,
    /// Time when the version was made \[ms since 1970\].
    pub(super) create_time_ms: i64,
    pub(super) metrics: KernelMetrics,
    pub(super) lineage: KernelLineage,
}

/// The record of a version, as JSON.
pub(super) fn record(version: &KernelVersion) -> Value {
    let record = Record {
        version: format!("{}/versions/{}", version.key, version.version),
        artifact: version.content.artifact.clone(),
        create_time_ms: version.create_time_ms,
        metrics: version.content.metrics.clone(),
        lineage: version.content.lineage.clone(),
    };
    // Texts and numbers always have a JSON form.
    serde_json::to_value(record).unwrap_or_default()
}

impl Record {
    /// Whether the version is one of a display with this id.
    pub(super) fn is_of(&self, display: &str) -> bool {
        self.version.starts_with(&format!("displays/{display}/kernels/"))
    }

    /// The lineage of a version that is imported from the bundle. If the bundle's version was itself imported, it names
    /// the server that made the version, and not those through which it came.
    pub(super) fn imported_lineage(self, file: Import) -> KernelLineage {
        let here = OriginalVersion { name: self.version, create_time_ms: self.create_time_ms };
        let Import { note, version, made, .. } = match self.lineage.origin {
            KernelOrigin::Learned(learning) => Import { made: Some(Made::Learned(learning)), ..file.clone() },
            KernelOrigin::Interpolated(learning) => Import { made: Some(Made::Interpolated(learning)), ..file.clone() },
            KernelOrigin::Imported(before) => before,
        };
        let version = Some(version.unwrap_or(here));
        let origin = KernelOrigin::Imported(Import { note, version, made, ..file });
        KernelLineage { origin, code_version: self.lineage.code_version }
    }
}
