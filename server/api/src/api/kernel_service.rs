//! The kernel service.

use super::artifact_service::chunks;
use super::encodings::{kernel_format, kernel_format_to_wire};
use super::error::ApiError;
use super::field::Field;
use super::pages::Page;
use super::time::now_ms;
use super::watch::{self, Watch};
use super::{Api, kernels, names};
use futures::stream::{self, BoxStream, StreamExt as _};
use lightpath_artifacts::{CHUNK_BYTES, digest_of};
use lightpath_domain::kernel::{Kernel, KernelKey, KernelVersion};
use lightpath_media::kernel_file;
use lightpath_media::kernel_formats::{self, KernelFormat, KernelFormatError};
use lightpath_metrics as metrics;
use lightpath_proto::v1;
use lightpath_proto::v1::fetch_kernel_response::Part;
use lightpath_proto::v1::kernel_service_server::KernelService;
use lightpath_store::Store;
use prost::bytes::Bytes;
use tonic::{Code, Request, Response, Status};

/// Longest reason of a move \[bytes\]: a paragraph.
const REASON_BYTES_MAX: usize = 1024;

#[tonic::async_trait]
impl KernelService for Api {
    async fn get_kernel(&self, request: Request<v1::GetKernelRequest>) -> Result<Response<v1::Kernel>, Status> {
        let key = names::kernel_key(&Field::new("name"), &request.into_inner().name)?;
        Ok(Response::new(kernels::to_wire(&self.store.kernel(&key).await.map_err(ApiError::from)?)))
    }

    async fn list_kernels(
        &self,
        request: Request<v1::ListKernelsRequest>,
    ) -> Result<Response<v1::ListKernelsResponse>, Status> {
        let request = request.into_inner();
        let display = names::display_filter(&Field::new("display"), &request.display)?;
        let page = Page::new(&["kernels", &request.display], request.page_size, &request.page_token)?;
        let kernels = self
            .store
            .kernels(display.as_deref(), page.after.as_deref(), page.limit())
            .await
            .map_err(ApiError::from)?;
        let to_wire = |kernel| kernels::to_wire(&kernel);
        let (kernels, next_page_token) = page.fill(kernels, |kernel| kernel.key.to_string(), to_wire);
        Ok(Response::new(v1::ListKernelsResponse { kernels, next_page_token }))
    }

    async fn get_kernel_version(
        &self,
        request: Request<v1::GetKernelVersionRequest>,
    ) -> Result<Response<v1::KernelVersion>, Status> {
        let (key, version) = names::kernel_version(&Field::new("name"), &request.into_inner().name)?;
        Ok(Response::new(kernels::version_to_wire(
            self.store.kernel_version(&key, version).await.map_err(ApiError::from)?,
        )))
    }

    async fn list_kernel_versions(
        &self,
        request: Request<v1::ListKernelVersionsRequest>,
    ) -> Result<Response<v1::ListKernelVersionsResponse>, Status> {
        let request = request.into_inner();
        let key = names::kernel_key(&Field::new("kernel"), &request.kernel)?;
        let page = Page::new(&["versions", &request.kernel], request.page_size, &request.page_token)?;
        let versions =
            self.store.kernel_versions(&key, page.after_number()?, page.limit()).await.map_err(ApiError::from)?;
        let key = |version: &KernelVersion| version.version.to_string();
        let (versions, next_page_token) = page.fill(versions, key, kernels::version_to_wire);
        Ok(Response::new(v1::ListKernelVersionsResponse { versions, next_page_token }))
    }

    type FetchKernelStream = Parts;

    async fn fetch_kernel(
        &self,
        request: Request<v1::FetchKernelRequest>,
    ) -> Result<Response<Self::FetchKernelStream>, Status> {
        let request = request.into_inner();
        let key = names::kernel_key(&Field::new("kernel"), &request.kernel)?;
        let answer = self.fetch(&key, request).await.map_err(Status::from);
        let code = answer.as_ref().map_or_else(Status::code, |_| Code::Ok);
        // Only displays that there are: clients must not make the metric grow.
        if answer.is_ok() || self.store.display(&key.display).await.is_ok() {
            metrics::kernel_fetch(&key.display, format!("{code:?}"));
        }
        answer.map(Response::new)
    }

    type WatchKernelStream = BoxStream<'static, Result<v1::Kernel, Status>>;

    async fn watch_kernel(
        &self,
        request: Request<v1::WatchKernelRequest>,
    ) -> Result<Response<Self::WatchKernelStream>, Status> {
        let key = names::kernel_key(&Field::new("name"), &request.into_inner().name)?;
        let permit = self.watcher()?;
        // Subscribed before the first read, so that no change falls in between.
        let changes = self.store.subscribe_kernel_changes();
        let first = self.store.kernel(&key).await.map_err(ApiError::from)?;
        let source = KernelSource { store: self.store.clone(), key };
        Ok(Response::new(watch::stream(source, first, changes, self.stopping.clone(), permit)))
    }

    async fn promote_kernel(&self, request: Request<v1::PromoteKernelRequest>) -> Result<Response<v1::Kernel>, Status> {
        let request = request.into_inner();
        let key = names::kernel_key(&Field::new("kernel"), &request.kernel)?;
        let version = Field::new("version").integer(request.version, 1..=u32::MAX)?;
        let reason = Field::new("reason").text(request.reason, REASON_BYTES_MAX)?;
        let expected = request.expected_active_version.map(|version| (version > 0).then_some(version));
        // Versions never change, so what is read here still holds when the alias moves.
        let candidate = self.store.kernel_version(&key, version).await.map_err(ApiError::from)?;
        if candidate.content.metrics.no_better_than_ideal() {
            check_forced(&candidate, request.force, &reason)?;
        }
        let kernel = self.store.promote(&key, version, expected, &reason, now_ms()).await.map_err(ApiError::from)?;
        Ok(Response::new(kernels::to_wire(&kernel)))
    }

    async fn rollback_kernel(
        &self,
        request: Request<v1::RollbackKernelRequest>,
    ) -> Result<Response<v1::Kernel>, Status> {
        let request = request.into_inner();
        let key = names::kernel_key(&Field::new("kernel"), &request.kernel)?;
        let reason = Field::new("reason").text(request.reason, REASON_BYTES_MAX)?;
        Ok(Response::new(kernels::to_wire(
            &self.store.rollback(&key, &reason, now_ms()).await.map_err(ApiError::from)?,
        )))
    }

    async fn list_kernel_moves(
        &self,
        request: Request<v1::ListKernelMovesRequest>,
    ) -> Result<Response<v1::ListKernelMovesResponse>, Status> {
        let request = request.into_inner();
        let key = names::kernel_key(&Field::new("kernel"), &request.kernel)?;
        let page = Page::new(&["moves", &request.kernel], request.page_size, &request.page_token)?;
        let moves = self.store.kernel_moves(&key, page.after_number()?, page.limit()).await.map_err(ApiError::from)?;
        let (moves, next_page_token) = page.fill(moves, |moved| moved.sequence.to_string(), kernels::move_to_wire);
        Ok(Response::new(v1::ListKernelMovesResponse { moves, next_page_token }))
    }

    async fn import_kernel(
        &self,
        request: Request<v1::ImportKernelRequest>,
    ) -> Result<Response<v1::KernelVersion>, Status> {
        let version = self.import(request.into_inner()).await?;
        Ok(Response::new(kernels::version_to_wire(version)))
    }

    async fn interpolate_kernel(
        &self,
        request: Request<v1::InterpolateKernelRequest>,
    ) -> Result<Response<v1::KernelVersion>, Status> {
        let version = self.interpolate(request.into_inner()).await?;
        Ok(Response::new(kernels::version_to_wire(version)))
    }

    async fn create_kernel_report(
        &self,
        request: Request<v1::CreateKernelReportRequest>,
    ) -> Result<Response<v1::KernelReport>, Status> {
        let (key, version) = names::kernel_version(&Field::new("name"), &request.into_inner().name)?;
        Ok(Response::new(self.report(&key, version).await?))
    }
}

/// A kernel that makes nothing better is a mistake, unless somebody says why it is not.
fn check_forced(candidate: &KernelVersion, force: bool, reason: &str) -> Result<(), ApiError> {
    if force && !reason.trim().is_empty() {
        return Ok(());
    }
    let KernelVersion { key, version, content, .. } = candidate;
    let losses = format!("{:.6} against {:.6}", content.metrics.test_loss, content.metrics.ideal_test_loss);
    let message = format!(
        "{key}/versions/{version} was measured to be no better than the ideal kernel (held-out loss {losses}); \
         to promote it all the same, set force and give a reason"
    );
    Err(ApiError::Precondition { reason: "NO_BETTER_THAN_IDEAL", message })
}

/// What a fetch answers.
type Parts = BoxStream<'static, Result<v1::FetchKernelResponse, Status>>;

impl Api {
    async fn fetch(&self, key: &KernelKey, request: v1::FetchKernelRequest) -> Result<Parts, ApiError> {
        let number = match request.version {
            0 => self.require_active(key).await?,
            number => number,
        };
        let version = self.store.kernel_version(key, number).await?;
        let format = kernel_format(&Field::new("format"), request.format)?;
        if format != KernelFormat::Safetensors {
            return self.fetch_as(version, format).await;
        }
        // Opened, and its hash checked, before the first message: what is damaged fails whole.
        let reader = self.artifacts.read(&version.content.artifact, 0, 0).await?;
        let first = v1::FetchKernelResponse { part: Some(Part::Version(kernels::version_to_wire(version))) };
        let rest =
            chunks(reader).map(|chunk| chunk.map(|chunk| v1::FetchKernelResponse { part: Some(Part::Chunk(chunk)) }));
        Ok(stream::iter([Ok(first)]).chain(rest).boxed())
    }

    /// The version's file in another form: made, and its digest known, before the first message.
    async fn fetch_as(&self, version: KernelVersion, format: KernelFormat) -> Result<Parts, ApiError> {
        let bytes = self.artifacts.read_all(&version.content.artifact).await?;
        let exported = self
            .computed(move || {
                let (model, kind) = kernel_file::decode(&bytes)?;
                kernel_formats::export(&model, kind, format)
            })
            .await?;
        let exported = exported.map_err(|error: KernelFormatError| ApiError::Precondition {
            reason: "NO_SUCH_FORM",
            message: format!("format: {error}"),
        })?;
        let file = v1::KernelFile {
            format: kernel_format_to_wire(format),
            digest: digest_of(&exported.bytes),
            size_bytes: exported.bytes.len() as u64,
            relative_error: exported.relative_error,
        };
        let head = [Part::Version(kernels::version_to_wire(version)), Part::File(file)];
        let bytes = Bytes::from(exported.bytes);
        let rest = (0..bytes.len().div_ceil(CHUNK_BYTES))
            .map(move |i| Part::Chunk(bytes.slice(i * CHUNK_BYTES..((i + 1) * CHUNK_BYTES).min(bytes.len()))));
        let message = |part| Ok(v1::FetchKernelResponse { part: Some(part) });
        Ok(stream::iter(head.into_iter().chain(rest).map(message)).boxed())
    }

    async fn require_active(&self, key: &KernelKey) -> Result<u32, ApiError> {
        self.store.kernel(key).await?.active_version.ok_or_else(|| {
            let message = format!("no version of {key} is active; promote one first, or name a version");
            ApiError::Precondition { reason: "NO_ACTIVE_KERNEL", message }
        })
    }
}

struct KernelSource {
    store: Store,
    key: KernelKey,
}

impl Watch for KernelSource {
    type Item = Kernel;
    type Change = KernelKey;
    type Message = v1::Kernel;

    async fn read(&self) -> Result<Kernel, ApiError> {
        Ok(self.store.kernel(&self.key).await?)
    }

    fn concerns(&self, change: &KernelKey) -> bool {
        *change == self.key
    }

    fn is_last(&self, _: &Kernel) -> bool {
        false
    }

    fn message(&self, kernel: &Kernel) -> v1::Kernel {
        kernels::to_wire(kernel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_domain::kernel::{KernelLineage, KernelMetrics, KernelModel, NewKernelVersion};
    use lightpath_domain::units::{Distance, Wavelength};

    #[test]
    fn a_kernel_that_makes_nothing_better_is_promoted_only_by_force_and_with_a_reason() {
        let wavelength = Wavelength::from_m(515e-9).unwrap();
        let key = KernelKey { display: "lab".to_owned(), wavelength, distance: Distance::from_m(0.15).unwrap() };
        let metrics =
            KernelMetrics { test_pairs: 2, test_loss: 0.02, ideal_test_loss: 0.01, ..KernelMetrics::default() };
        let (model, lineage) = (KernelModel::Dense, KernelLineage::default());
        let content = NewKernelVersion { model, artifact: String::new(), size_bytes: 1, metrics, lineage };
        let version = KernelVersion { key, version: 3, content, create_time_ms: 0, active: false };
        for (force, reason) in [(false, ""), (false, "because"), (true, ""), (true, " ")] {
            let refused = check_forced(&version, force, reason).unwrap_err().to_string();
            assert!(refused.contains("versions/3") && refused.contains("0.020000 against 0.010000"), "{refused}");
        }
        assert!(check_forced(&version, true, "to compare on the bench").is_ok());
    }
}
