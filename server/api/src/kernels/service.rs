//! The kernel service.

use super::to_wire;
use crate::api::Api;
use crate::call::StatusStream;
use crate::names;
use crate::pages::Page;
use lightpath_domain::kernel::KernelVersion;
use lightpath_proto::v1;
use lightpath_proto::v1::kernel_service_server::KernelService;
use lightpath_service::{Call, Field, ServiceError};
use tonic::{Request, Response, Status};

#[tonic::async_trait]
impl KernelService for Api {
    async fn get_kernel(&self, request: Request<v1::GetKernelRequest>) -> Result<Response<v1::Kernel>, Status> {
        self.answer(request, Self::get_kernel).await
    }

    async fn list_kernels(
        &self,
        request: Request<v1::ListKernelsRequest>,
    ) -> Result<Response<v1::ListKernelsResponse>, Status> {
        self.answer(request, Self::list_kernels).await
    }

    async fn get_kernel_version(
        &self,
        request: Request<v1::GetKernelVersionRequest>,
    ) -> Result<Response<v1::KernelVersion>, Status> {
        self.answer(request, Self::get_kernel_version).await
    }

    async fn list_kernel_versions(
        &self,
        request: Request<v1::ListKernelVersionsRequest>,
    ) -> Result<Response<v1::ListKernelVersionsResponse>, Status> {
        self.answer(request, Self::list_kernel_versions).await
    }

    type FetchKernelStream = StatusStream<v1::FetchKernelResponse>;

    async fn fetch_kernel(
        &self,
        request: Request<v1::FetchKernelRequest>,
    ) -> Result<Response<Self::FetchKernelStream>, Status> {
        self.answer_with_stream(request, Self::fetch_kernel).await
    }

    async fn get_kernel_manifest(
        &self,
        request: Request<v1::GetKernelManifestRequest>,
    ) -> Result<Response<v1::KernelManifest>, Status> {
        self.answer(request, Self::get_kernel_manifest).await
    }

    async fn get_keyring(&self, request: Request<v1::GetKeyringRequest>) -> Result<Response<v1::Keyring>, Status> {
        self.answer(request, Self::get_keyring).await
    }

    type WatchKernelStream = StatusStream<v1::Kernel>;

    async fn watch_kernel(
        &self,
        request: Request<v1::WatchKernelRequest>,
    ) -> Result<Response<Self::WatchKernelStream>, Status> {
        self.answer_with_stream(request, Self::watch_kernel).await
    }

    async fn promote_kernel(&self, request: Request<v1::PromoteKernelRequest>) -> Result<Response<v1::Kernel>, Status> {
        self.answer(request, Self::promote_kernel).await
    }

    async fn check_promotion(
        &self,
        request: Request<v1::CheckPromotionRequest>,
    ) -> Result<Response<v1::PromotionVerdict>, Status> {
        self.answer(request, Self::check_promotion).await
    }

    async fn set_promotion_gate(
        &self,
        request: Request<v1::SetPromotionGateRequest>,
    ) -> Result<Response<v1::DisplayGate>, Status> {
        self.answer(request, Self::set_promotion_gate).await
    }

    async fn get_promotion_gate(
        &self,
        request: Request<v1::GetPromotionGateRequest>,
    ) -> Result<Response<v1::DisplayGate>, Status> {
        self.answer(request, Self::get_promotion_gate).await
    }

    async fn set_kernel_alias(
        &self,
        request: Request<v1::SetKernelAliasRequest>,
    ) -> Result<Response<v1::Kernel>, Status> {
        self.answer(request, Self::set_kernel_alias).await
    }

    async fn deprecate_kernel_version(
        &self,
        request: Request<v1::DeprecateKernelVersionRequest>,
    ) -> Result<Response<v1::KernelVersion>, Status> {
        self.answer(request, Self::deprecate_kernel_version).await
    }

    async fn compare_kernel_versions(
        &self,
        request: Request<v1::CompareKernelVersionsRequest>,
    ) -> Result<Response<v1::KernelComparison>, Status> {
        self.answer(request, Self::compare_kernel_versions).await
    }

    async fn find_nearest_kernels(
        &self,
        request: Request<v1::FindNearestKernelsRequest>,
    ) -> Result<Response<v1::FindNearestKernelsResponse>, Status> {
        self.answer(request, Self::find_nearest_kernels).await
    }

    async fn rollback_kernel(
        &self,
        request: Request<v1::RollbackKernelRequest>,
    ) -> Result<Response<v1::Kernel>, Status> {
        self.answer(request, Self::rollback_kernel).await
    }

    async fn list_kernel_moves(
        &self,
        request: Request<v1::ListKernelMovesRequest>,
    ) -> Result<Response<v1::ListKernelMovesResponse>, Status> {
        self.answer(request, Self::list_kernel_moves).await
    }

    async fn import_kernel(
        &self,
        request: Request<v1::ImportKernelRequest>,
    ) -> Result<Response<v1::KernelVersion>, Status> {
        self.answer(request, Self::import_kernel).await
    }

    async fn interpolate_kernel(
        &self,
        request: Request<v1::InterpolateKernelRequest>,
    ) -> Result<Response<v1::KernelVersion>, Status> {
        self.answer(request, Self::interpolate_kernel).await
    }
}

impl Api {
    pub(crate) async fn get_kernel(
        &self,
        call: &Call,
        request: v1::GetKernelRequest,
    ) -> Result<v1::Kernel, ServiceError> {
        let key = names::kernel_key(call, &Field::new("name"), &request.name)?;
        Ok(to_wire::kernel(&self.store.kernel(&key).await?))
    }

    pub(crate) async fn list_kernels(
        &self,
        call: &Call,
        request: v1::ListKernelsRequest,
    ) -> Result<v1::ListKernelsResponse, ServiceError> {
        let display = names::display_filter(call, &Field::new("display"), &request.display)?;
        let page = Page::new(&["kernels", &request.display], request.page_size, &request.page_token)?;
        let kernels = self.store.kernels(display.as_deref(), page.after.as_deref(), page.limit()).await?;
        let to_wire = |kernel| to_wire::kernel(&kernel);
        let (kernels, next_page_token) = page.fill(kernels, |kernel| kernel.key.to_string(), to_wire);
        Ok(v1::ListKernelsResponse { kernels, next_page_token })
    }

    async fn get_kernel_version(
        &self,
        call: &Call,
        request: v1::GetKernelVersionRequest,
    ) -> Result<v1::KernelVersion, ServiceError> {
        let (key, version) = names::kernel_version(call, &Field::new("name"), &request.name)?;
        Ok(to_wire::version(self.store.kernel_version(&key, version).await?))
    }

    async fn list_kernel_versions(
        &self,
        call: &Call,
        request: v1::ListKernelVersionsRequest,
    ) -> Result<v1::ListKernelVersionsResponse, ServiceError> {
        let key = names::kernel_key(call, &Field::new("kernel"), &request.kernel)?;
        let page = Page::new(&["versions", &request.kernel], request.page_size, &request.page_token)?;
        let versions = self.store.kernel_versions(&key, page.after_number()?, page.limit()).await?;
        let key = |version: &KernelVersion| version.version.to_string();
        let (versions, next_page_token) = page.fill(versions, key, to_wire::version);
        Ok(v1::ListKernelVersionsResponse { versions, next_page_token })
    }
}
