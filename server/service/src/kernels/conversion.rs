//! Files of versions, in the requested format.
//!
//! ```text
//! who asks ──┬─ kept: the file
//!            └─ not kept ── one conversion for all who ask ── put on disk ── noted ── the file
//! ```
//!
//! A conversion is counted for the client that asked first, whose turn it takes. Only the end of the server ends it early.

use super::converted::{ConversionKey, Converted};
use super::{Kernels, bundle, model_file};
use crate::call::Call;
use crate::error::{Result, ServiceError};
use lightpath_artifacts::{ArtifactError, ArtifactReader, CHUNK_BYTES};
use lightpath_domain::kernel::KernelVersion;
use lightpath_domain::reason::PreconditionReason;
use lightpath_media::kernel_file::{self, Origin};
use lightpath_media::kernel_formats::{self, Exported, KernelFormat, KernelFormatError};
use lightpath_metrics as metrics;
use serde_json::Value;
use std::time::Duration;
use tokio::time::timeout;

/// Time that a device waits for a conversion. The agent takes 30 s without a byte for a lost connection.
const DEVICE_PATIENCE: Duration = Duration::from_secs(20);
/// Time after which a device asks again.
const DEVICE_RETRY: Duration = Duration::from_secs(10);

/// The file of a version in a format.
#[derive(Clone, Debug)]
pub struct VersionFile {
    version: KernelVersion,
    format: KernelFormat,
    /// The converted file; `None`: the file is the version's own.
    pub converted: Option<Converted>,
    /// Digest of the file.
    pub digest: String,
    /// Size of the file \[bytes\].
    pub size_bytes: u64,
}

impl Kernels {
    /// The file of a version in a format. It is made if it was not made before.
    pub async fn file(&self, call: &Call, version: KernelVersion, format: KernelFormat) -> Result<VersionFile> {
        if format == KernelFormat::Safetensors {
            let (digest, size_bytes) = (version.content.artifact.clone(), version.content.size_bytes);
            return Ok(VersionFile { version, format, converted: None, digest, size_bytes });
        }
        let converted = self.converted(call, &version, format).await?;
        let (digest, size_bytes) = (converted.digest.clone(), converted.size_bytes);
        Ok(VersionFile { version, format, converted: Some(converted), digest, size_bytes })
    }

    /// A reader of a range (offset and limit; limit 0: all) of a version's file. The whole file is compared with its
    /// digest first, so that no part of a damaged file is sent.
    pub async fn reader(&self, call: &Call, file: &VersionFile, range: (u64, u64)) -> Result<ArtifactReader> {
        match &file.converted {
            None => self.files.reader(call, &file.digest, range).await,
            Some(converted) => self.conversion_reader(call, &file.version, file.format, converted, range).await,
        }
    }

    /// The file of a version in another format than its own. It is made if it was not made before.
    pub(crate) async fn converted(
        &self,
        call: &Call,
        version: &KernelVersion,
        format: KernelFormat,
    ) -> Result<Converted> {
        let key = ConversionKey::new(version, format);
        let convert = || self.clone().convert(call.on_its_own(&self.stopping), key.clone(), version.clone());
        self.conversions.get(&key, &call.client, convert)?.await.map_err(ServiceError::Shared)
    }

    /// Makes the file of a version and keeps it.
    async fn convert(self, call: Call, key: ConversionKey, version: KernelVersion) -> Result<Converted> {
        let exported = self.export(&call, &version, key.format).await;
        metrics::kernel_conversion(&version.key.display, exported.is_ok());
        let converted = exported.map_err(|error| match error {
            ServiceError::Cancelled => ServiceError::Stopping,
            other => other,
        })?;
        let (removed, artifacts) = (self.conversions.insert(key, converted.clone()), self.artifacts.clone());
        let conversions = self.conversions.clone();
        let tidy = move || {
            removed.iter().try_for_each(|digest| artifacts.delete_conversion_blocking(digest))?;
            conversions.write_notes(|notes| artifacts.write_conversion_notes_blocking(notes))
        };
        if let Ok(Err(error)) = tokio::task::spawn_blocking(tidy).await {
            tracing::warn!(%error, "the converted kernel files could not be tidied up");
        }
        Ok(converted)
    }

    async fn conversion_reader(
        &self,
        call: &Call,
        version: &KernelVersion,
        format: KernelFormat,
        converted: &Converted,
        (offset_bytes, limit_bytes): (u64, u64),
    ) -> Result<ArtifactReader> {
        let open = async || {
            let (artifacts, digest) = (self.artifacts.clone(), converted.digest.clone());
            let read = move || artifacts.read_conversion_blocking(&digest, offset_bytes, limit_bytes);
            self.computing.run(call, CHUNK_BYTES as u64, read).await
        };
        match open().await? {
            // The file was removed to make room, or is damaged. It is made again, with the same bytes.
            Err(ArtifactError::NotFound { .. } | ArtifactError::DataLoss { .. }) => {
                let key = ConversionKey::new(version, format);
                self.conversions.forget(&key);
                self.converted(call, version, format).await?;
                Ok(open().await??)
            }
            opened => Ok(opened?),
        }
    }

    /// Converts the file of a version. The other file is written before the memory for the conversion is given back.
    async fn export(&self, call: &Call, version: &KernelVersion, format: KernelFormat) -> Result<Converted> {
        let (display, _) = self.store.display(&version.key.display).await?;
        let need_bytes = model_file::exporting_bytes(format, version.content.size_bytes, &display, &version.key);
        let (artifacts, artifact) = (self.artifacts.clone(), version.content.artifact.clone());
        let record = bundle::record(version);
        let export = move || -> Result<_, ArtifactError> {
            let file = artifacts.read_blocking(&artifact)?;
            let Exported { bytes, relative_error, losses } = match exported(&file, record, format) {
                Ok(exported) => exported,
                Err(error) => return Ok(Err(error)),
            };
            let digest = artifacts.put_conversion_blocking(&bytes)?;
            Ok(Ok(Converted { digest, size_bytes: bytes.len() as u64, relative_error, losses }))
        };
        let exported = self.computing.run(call, need_bytes, export).await??;
        exported.map_err(|error| ServiceError::Precondition {
            reason: PreconditionReason::NoSuchForm,
            message: format!("format: {error}"),
        })
    }
}

/// What `work` gives for a device, which has little patience. It goes on with its conversion, if that takes longer.
///
/// # Errors
///
/// The errors of `work`; [`ServiceError::Converting`] after 20 seconds.
pub async fn for_device<T>(work: impl Future<Output = Result<T>>) -> Result<T> {
    within(DEVICE_PATIENCE, work).await
}

async fn within<T>(patience: Duration, work: impl Future<Output = Result<T>>) -> Result<T> {
    let late = |_| Err(ServiceError::Converting { retry_after: DEVICE_RETRY });
    timeout(patience, work).await.unwrap_or_else(late)
}

/// Converts a file in the native format.
fn exported(file: &[u8], record: Value, format: KernelFormat) -> Result<Exported, KernelFormatError> {
    let (model, kind) = kernel_file::decode(file)?;
    let origin = Origin { record: Some(record), ..kernel_file::origin(file)? };
    kernel_formats::export_with(&model, kind, &origin, format)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_device_is_answered_before_its_patience_ends() {
        let soon = Duration::from_millis(10);
        assert_eq!(within(soon, async { Ok(7) }).await.unwrap(), 7);
        let late = within(soon, std::future::pending::<Result<()>>()).await;
        assert!(matches!(late, Err(ServiceError::Converting { retry_after: DEVICE_RETRY })), "{late:?}");
        // The agent gives up after 30 s, and the network takes its time, too.
        assert!(DEVICE_PATIENCE <= Duration::from_secs(25));
    }
}
