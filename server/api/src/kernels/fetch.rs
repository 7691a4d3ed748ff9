//! Downloads of kernel files, in the requested format.

use super::to_wire;
use crate::accounts::StreamKind;
use crate::api::Api;
use crate::artifacts::download::chunks;
use crate::call::Answers;
use crate::enumerations::{OnWire as _, WireField as _};
use crate::names;
use crate::status;
use futures::stream::{self, StreamExt as _};
use lightpath_artifacts::CHUNK_BYTES;
use lightpath_domain::kernel::KernelKey;
use lightpath_media::kernel_formats::KernelFormat;
use lightpath_metrics as metrics;
use lightpath_proto::v1;
use lightpath_proto::v1::fetch_kernel_response::Part;
use lightpath_service::{Call, Field, Result};
use tonic::Code;

impl Api {
    pub(crate) async fn fetch_kernel(
        &self,
        call: &Call,
        request: v1::FetchKernelRequest,
    ) -> Result<Answers<v1::FetchKernelResponse>> {
        let key = names::kernel_key(call, &Field::new("kernel"), &request.kernel)?;
        let answers = self.fetch(call, &key, request).await;
        let code = answers.as_ref().map_or_else(status::code, |_| Code::Ok);
        // Only existing displays are counted, so that clients cannot create new labels of the metric.
        if answers.is_ok() || self.store.display(&key.display).await.is_ok() {
            metrics::kernel_fetch(&key.display, format!("{code:?}"));
        }
        answers
    }

    /// Streams the file of a version. It is converted, and its hash is checked, before the first message.
    async fn fetch(
        &self,
        call: &Call,
        key: &KernelKey,
        request: v1::FetchKernelRequest,
    ) -> Result<Answers<v1::FetchKernelResponse>> {
        let kernels = &self.service.kernels;
        let number = Field::new("version").version_if_set(request.version, "the active version")?;
        let version = kernels.version_or_active(key, number).await?;
        let format = Field::new("format").enum_value(request.format)?.unwrap_or(KernelFormat::Safetensors);
        let open = self.streams.open(StreamKind::Download, &call.client)?;
        let file = kernels.file(call, version.clone(), format).await?;
        let reader = kernels.reader(call, &file, (request.offset_bytes, 0)).await?;
        let converted = file.converted.map(|converted| {
            Part::File(v1::KernelFile {
                format: format.to_wire(),
                digest: converted.digest,
                size_bytes: converted.size_bytes,
                relative_error: converted.relative_error,
                losses: converted.losses.into_iter().map(to_wire::parts::loss).collect(),
            })
        });
        let head = [Part::Version(to_wire::version(version))].into_iter().chain(converted);
        let head = stream::iter(head.map(|part| Ok(message(part))));
        Ok(head.chain(chunks(reader, open, CHUNK_BYTES).map(|chunk| chunk.map(Part::Chunk).map(message))).boxed())
    }
}

fn message(part: Part) -> v1::FetchKernelResponse {
    v1::FetchKernelResponse { part: Some(part) }
}
