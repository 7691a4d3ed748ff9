//! Downloads of kernel files, in the requested format.

use super::to_wire;
use crate::api::Api;
use crate::artifacts::download::chunks;
use crate::call::Answers;
use crate::enumerations::OnWire as _;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use futures::stream::{self, StreamExt as _};
use lightpath_artifacts::{CHUNK_BYTES, digest_of};
use lightpath_domain::access::Caller;
use lightpath_domain::kernel::{KernelKey, KernelVersion};
use lightpath_domain::reason::PreconditionReason;
use lightpath_media::kernel_file;
use lightpath_media::kernel_formats::{self, KernelFormat, KernelFormatError};
use lightpath_metrics as metrics;
use lightpath_proto::v1;
use lightpath_proto::v1::fetch_kernel_response::Part;
use prost::bytes::Bytes;
use tonic::Code;

impl Api {
    pub(crate) async fn fetch_kernel(
        &self,
        caller: &Caller,
        request: v1::FetchKernelRequest,
    ) -> Result<Answers<v1::FetchKernelResponse>, ApiError> {
        let key = names::kernel_key(caller, &Field::new("kernel"), &request.kernel)?;
        let answers = self.fetch(&key, request).await;
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
        key: &KernelKey,
        request: v1::FetchKernelRequest,
    ) -> Result<Answers<v1::FetchKernelResponse>, ApiError> {
        let number = match request.version {
            0 => self.require_active(key).await?,
            number => number,
        };
        let version = self.store.kernel_version(key, number).await?;
        let format = Field::new("format").enum_value(request.format)?.unwrap_or(KernelFormat::Safetensors);
        if format != KernelFormat::Safetensors {
            return self.fetch_as(version, format).await;
        }
        // The file is opened and its hash is checked before the first message, so that no part of a damaged file is
        // sent.
        let reader = self.artifacts.read(&version.content.artifact, 0, 0).await?;
        let first = v1::FetchKernelResponse { part: Some(Part::Version(to_wire::version(version))) };
        let rest =
            chunks(reader).map(|chunk| chunk.map(|chunk| v1::FetchKernelResponse { part: Some(Part::Chunk(chunk)) }));
        Ok(stream::iter([Ok(first)]).chain(rest).boxed())
    }

    /// Streams the file of a version in another format. The file is converted before the first message, which needs its
    /// digest.
    async fn fetch_as(
        &self,
        version: KernelVersion,
        format: KernelFormat,
    ) -> Result<Answers<v1::FetchKernelResponse>, ApiError> {
        let bytes = self.artifacts.read_all(&version.content.artifact).await?;
        let exported = self
            .checking
            .run(move || {
                let (model, kind) = kernel_file::decode(&bytes)?;
                kernel_formats::export(&model, kind, format)
            })
            .await?;
        let exported = exported.map_err(|error: KernelFormatError| ApiError::Precondition {
            reason: PreconditionReason::NoSuchForm,
            message: format!("format: {error}"),
        })?;
        let file = v1::KernelFile {
            format: format.to_wire(),
            digest: digest_of(&exported.bytes),
            size_bytes: exported.bytes.len() as u64,
            relative_error: exported.relative_error,
        };
        let head = [Part::Version(to_wire::version(version)), Part::File(file)];
        let bytes = Bytes::from(exported.bytes);
        let rest = (0..bytes.len().div_ceil(CHUNK_BYTES))
            .map(move |i| Part::Chunk(bytes.slice(i * CHUNK_BYTES..((i + 1) * CHUNK_BYTES).min(bytes.len()))));
        let message = |part| Ok(v1::FetchKernelResponse { part: Some(part) });
        Ok(stream::iter(head.into_iter().chain(rest).map(message)).boxed())
    }

    /// Number of the active version. Refuses a kernel without one.
    async fn require_active(&self, key: &KernelKey) -> Result<u32, ApiError> {
        self.store.kernel(key).await?.active_version.ok_or_else(|| {
            let message = format!("no version of {key} is active; promote one first, or give a version number");
            ApiError::Precondition { reason: PreconditionReason::NoActiveKernel, message }
        })
    }
}
