//! Bundles: files with all of a version, to carry it to another server.
//!
//! A bundle is a kernel file in the native form whose header also has the record of the version.

use lightpath_domain::kernel::{KernelLineage, KernelMetrics, KernelVersion};
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

    /// The lineage of the imported version. Jobs, datasets and versions have other names on the other server, so its
    /// parameters say where they come from.
    pub(super) fn imported_lineage(self) -> KernelLineage {
        let parsed = serde_json::from_str(&self.lineage.parameters_json);
        let mut parameters: Value = parsed.unwrap_or_else(|_| Value::Object(Default::default()));
        parameters["bundle"] = serde_json::json!({
            "version": self.version, "artifact": self.artifact, "create_time_ms": self.create_time_ms,
            "parent_version": self.lineage.parent_version,
        });
        KernelLineage { parent_version: None, parameters_json: parameters.to_string(), ..self.lineage }
    }
}
