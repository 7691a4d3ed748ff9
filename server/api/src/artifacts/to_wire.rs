//! Conversion of artifacts into messages.

use crate::time::timestamp;
use lightpath_proto::v1;
use lightpath_store::ArtifactRecord;

/// Converts an artifact into its message.
pub(crate) fn artifact(record: ArtifactRecord) -> v1::Artifact {
    v1::Artifact {
        digest: record.digest,
        size_bytes: record.size_bytes,
        create_time: Some(timestamp(record.create_time_ms)),
    }
}
