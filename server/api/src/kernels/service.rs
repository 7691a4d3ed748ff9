//! The kernel service.

use super::to_wire;
use crate::api::Api;
use crate::call::answers;
use crate::names;
use crate::optics::from_wire::distance;
use crate::pages::Page;
use lightpath_domain::kernel::KernelVersion;
use lightpath_proto::v1;
use lightpath_proto::v1::kernel_service_server::KernelService;
use lightpath_service::{Call, Field, Result};
use lightpath_store::KernelFilter;

answers! {
    KernelService {
        get_kernel(v1::GetKernelRequest) -> v1::Kernel;
        list_kernels(v1::ListKernelsRequest) -> v1::ListKernelsResponse;
        get_kernel_version(v1::GetKernelVersionRequest) -> v1::KernelVersion;
        list_kernel_versions(v1::ListKernelVersionsRequest) -> v1::ListKernelVersionsResponse;
        get_kernel_manifest(v1::GetKernelManifestRequest) -> v1::KernelManifest;
        get_keyring(v1::GetKeyringRequest) -> v1::Keyring;
        promote_kernel(v1::PromoteKernelRequest) -> v1::Kernel;
        check_promotion(v1::CheckPromotionRequest) -> v1::PromotionVerdict;
        set_promotion_gate(v1::SetPromotionGateRequest) -> v1::DisplayGate;
        get_promotion_gate(v1::GetPromotionGateRequest) -> v1::DisplayGate;
        set_kernel_alias(v1::SetKernelAliasRequest) -> v1::Kernel;
        deprecate_kernel_version(v1::DeprecateKernelVersionRequest) -> v1::KernelVersion;
        compare_kernel_versions(v1::CompareKernelVersionsRequest) -> v1::KernelComparison;
        find_nearest_kernels(v1::FindNearestKernelsRequest) -> v1::FindNearestKernelsResponse;
        rollback_kernel(v1::RollbackKernelRequest) -> v1::Kernel;
        list_kernel_moves(v1::ListKernelMovesRequest) -> v1::ListKernelMovesResponse;
        import_kernel(v1::ImportKernelRequest) -> v1::KernelVersion;
        interpolate_kernel(v1::InterpolateKernelRequest) -> v1::KernelVersion;
    }
    streams {
        fetch_kernel(v1::FetchKernelRequest) -> v1::FetchKernelResponse as FetchKernelStream;
        watch_kernel(v1::WatchKernelRequest) -> v1::Kernel as WatchKernelStream;
    }
}

impl Api {
    pub(crate) async fn get_kernel(&self, call: &Call, request: v1::GetKernelRequest) -> Result<v1::Kernel> {
        let key = names::kernel_key(call, &Field::new("name"), &request.name)?;
        Ok(to_wire::kernel(&self.store.kernel(&key).await?))
    }

    pub(crate) async fn list_kernels(
        &self,
        call: &Call,
        request: v1::ListKernelsRequest,
    ) -> Result<v1::ListKernelsResponse> {
        let of_wavelength = Field::new("wavelength_m");
        let wavelength =
            of_wavelength.if_set(request.wavelength_m, "all wavelengths", |value| of_wavelength.wavelength(value));
        let place = request.place.as_ref();
        let filter = KernelFilter {
            display: names::display_filter(call, &Field::new("display"), &request.display)?,
            wavelength: wavelength?,
            distance: place.map(|place| distance(&Field::new("place"), Some(place))).transpose()?,
        };
        let optics = format!("{:?} {:?}", filter.wavelength, filter.distance);
        let page = Page::new(&["kernels", &request.display, &optics], request.page_size, &request.page_token)?;
        let kernels = self.store.kernels(&filter, page.after.as_deref(), page.limit()).await?;
        let to_wire = |kernel| to_wire::kernel(&kernel);
        let (kernels, next_page_token) = page.fill(kernels, |kernel| kernel.key.to_string(), to_wire);
        Ok(v1::ListKernelsResponse { kernels, next_page_token })
    }

    async fn get_kernel_version(&self, call: &Call, request: v1::GetKernelVersionRequest) -> Result<v1::KernelVersion> {
        let (key, version) = names::kernel_version(call, &Field::new("name"), &request.name)?;
        Ok(to_wire::version(self.store.kernel_version(&key, version).await?))
    }

    async fn list_kernel_versions(
        &self,
        call: &Call,
        request: v1::ListKernelVersionsRequest,
    ) -> Result<v1::ListKernelVersionsResponse> {
        let key = names::kernel_key(call, &Field::new("kernel"), &request.kernel)?;
        let page = Page::new(&["versions", &request.kernel], request.page_size, &request.page_token)?;
        let versions = self.store.kernel_versions(&key, page.after_number()?, page.limit()).await?;
        let key = |version: &KernelVersion| version.version.to_string();
        let (versions, next_page_token) = page.fill(versions, key, to_wire::version);
        Ok(v1::ListKernelVersionsResponse { versions, next_page_token })
    }
}
