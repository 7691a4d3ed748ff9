//! Downloads of kernel files, in the requested format.

use super::conversions::{ConversionKey, Converted};
use super::{bundle, model_file, to_wire};
use crate::accounts::StreamKind;
use crate::api::Api;
use crate::artifacts::download::chunks;
use crate::call::{Answers, Call};
use crate::enumerations::OnWire as _;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use futures::stream::{self, StreamExt as _};
use lightpath_artifacts::{ArtifactError, ArtifactReader, CHUNK_BYTES};
use lightpath_domain::kernel::{KernelKey, KernelVersion};
use lightpath_domain::reason::PreconditionReason;
use lightpath_media::kernel_file::{self, Origin};
use lightpath_media::kernel_formats::{self, Exported, KernelFormat, KernelFormatError};
use lightpath_metrics as metrics;
use lightpath_proto::v1;
use lightpath_proto::v1::fetch_kernel_response::Part;
use serde_json::Value;
use tonic::Code;

impl Api {
    pub(crate) async fn fetch_kernel(
        &self,
        call: &Call,
        request: v1::FetchKernelRequest,
    ) -> Result<Answers<v1::FetchKernelResponse>, ApiError> {
        let key = names::kernel_key(call, &Field::new("kernel"), &request.kernel)?;
        let answers = self.fetch(call, &key, request).await;
        let code = answers.as_ref().map_or_else(ApiError::code, |_| Code::Ok);
        // Only existing displays are counted, so that clients cannot create new labels of the metric.
        if answers.is_ok() || self.store.display(&key.display).await.is_ok() {
            metrics::kernel_fetch(&key.display, format!("{code:?}"));
        }
        answers
    }

    /// Streams the file of a version.
    async fn fetch(
        &self,
        call: &Call,
        key: &KernelKey,
        request: v1::FetchKernelRequest,
    ) -> Result<Answers<v1::FetchKernelResponse>, ApiError> {
        let number = match request.version {
            0 => self.require_active(key).await?,
            number => number,
        };
        let version = self.store.kernel_version(key, number).await?;
        let format = Field::new("format").enum_value(request.format)?.unwrap_or(KernelFormat::Safetensors);
        let range = (request.offset_bytes, 0);
        if format != KernelFormat::Safetensors {
            return self.fetch_as(call, version, format, range).await;
        }
        // The file is opened and its hash is checked before the first message, so that no part of a damaged file is
        // sent.
        let open = self.accounts.streams.open(StreamKind::Download, &call.client)?;
        let reader = self.checked_reader(call, &version.content.artifact, range).await?;
        let first = message(Part::Version(to_wire::version(version)));
        let rest = chunks(reader, open).map(|chunk| chunk.map(Part::Chunk).map(message));
        Ok(stream::iter([Ok(first)]).chain(rest).boxed())
    }

    /// Streams the file of a version in another format. The file is converted before the first message, which needs its
    /// digest.
    async fn fetch_as(
        &self,
        call: &Call,
        version: KernelVersion,
        format: KernelFormat,
        range: (u64, u64),
    ) -> Result<Answers<v1::FetchKernelResponse>, ApiError> {
        let open = self.accounts.streams.open(StreamKind::Download, &call.client)?;
        let converted = self.converted(call, &version, format).await?;
        let reader = self.conversion_reader(call, &version, format, &converted, range).await?;
        let file = v1::KernelFile {
            format: format.to_wire(),
            digest: converted.digest,
            size_bytes: converted.size_bytes,
            relative_error: converted.relative_error,
            losses: converted.losses.into_iter().map(|loss| loss.to_wire()).collect(),
        };
        let head = [Part::Version(to_wire::version(version)), Part::File(file)].map(|part| Ok(message(part)));
        Ok(stream::iter(head).chain(chunks(reader, open).map(|chunk| chunk.map(Part::Chunk).map(message))).boxed())
    }

    /// The file of a version in another format. It is made if it was not made before.
    pub(crate) async fn converted(
        &self,
        call: &Call,
        version: &KernelVersion,
        format: KernelFormat,
    ) -> Result<Converted, ApiError> {
        let key = ConversionKey::new(version, format);
        if let Some(converted) = self.conversions.find(&key) {
            return Ok(converted);
        }
        let converted = self.export(call, version, format).await?;
        for removed in self.conversions.insert(key, converted.clone()) {
            self.artifacts.delete_conversion(&removed).await?;
        }
        Ok(converted)
    }

    /// A reader of a range (offset and limit; limit 0: all) of a converted file. The whole file is compared with its
    /// digest first.
    pub(crate) async fn conversion_reader(
        &self,
        call: &Call,
        version: &KernelVersion,
        format: KernelFormat,
        converted: &Converted,
        (offset_bytes, limit_bytes): (u64, u64),
    ) -> Result<ArtifactReader, ApiError> {
        let open = async || {
            let (artifacts, digest) = (self.artifacts.clone(), converted.digest.clone());
            let read = move || artifacts.read_conversion_blocking(&digest, offset_bytes, limit_bytes);
            self.accounts.compute(call, CHUNK_BYTES as u64, read).await
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
    async fn export(&self, call: &Call, version: &KernelVersion, format: KernelFormat) -> Result<Converted, ApiError> {
        let (display, _) = self.store.display(&version.key.display).await?;
        let need_bytes = model_file::exporting_bytes(version.content.size_bytes, &display, &version.key);
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
        let exported = self.accounts.compute(call, need_bytes, export).await??;
        exported.map_err(|error| ApiError::Precondition {
            reason: PreconditionReason::NoSuchForm,
            message: format!("format: {error}"),
        })
    }

    /// Number of the active version. Refuses a kernel without one.
    pub(crate) async fn require_active(&self, key: &KernelKey) -> Result<u32, ApiError> {
        self.store.kernel(key).await?.active_version.ok_or_else(|| {
            let message = format!("no version of {key} is active; promote one first, or give a version number");
            ApiError::Precondition { reason: PreconditionReason::NoActiveKernel, message }
        })
    }
}

/// Converts a file in the native format.
fn exported(file: &[u8], record: Value, format: KernelFormat) -> Result<Exported, KernelFormatError> {
    let (model, kind) = kernel_file::decode(file)?;
    let origin = Origin { record: Some(record), ..kernel_file::origin(file)? };
    kernel_formats::export_with(&model, kind, &origin, format)
}

fn message(part: Part) -> v1::FetchKernelResponse {
    v1::FetchKernelResponse { part: Some(part) }
}
