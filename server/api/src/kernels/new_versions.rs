//! New versions that no job learned: imports, and interpolation between photographed distances; and the comparison of two.

use super::to_wire;
use crate::api::Api;
use crate::names;
use crate::once::mark;
use crate::optics::from_wire::distance;
use lightpath_media::report::Comparison;
use lightpath_proto::v1;
use lightpath_service::{Call, Field, KernelImport, Result};

impl Api {
    /// Stores an uploaded kernel file as the next version. Refuses a kernel of another display, wavelength or distance.
    pub(crate) async fn import_kernel(
        &self,
        call: &Call,
        request: v1::ImportKernelRequest,
    ) -> Result<v1::KernelVersion> {
        let mark = mark(call, "ImportKernel", &request, &request.request_id)?;
        let display = self.display_named(call, &Field::new("display"), &request.display).await?;
        let wavelength = Field::new("wavelength_m").wavelength_of(request.wavelength_m, &display)?;
        let distance = distance(&Field::new("place"), request.place.as_ref())?;
        let digest = Field::new("artifact").digest(&request.artifact)?;
        let from_another_display = request.from_another_display;
        let import = KernelImport { display, wavelength, distance, digest, from_another_display };
        Ok(to_wire::version(self.service.kernels.import(call, import, mark).await?))
    }

    /// Interpolates a kernel for a distance between those of a joint fit, and stores it as the next version.
    pub(crate) async fn interpolate_kernel(
        &self,
        call: &Call,
        request: v1::InterpolateKernelRequest,
    ) -> Result<v1::KernelVersion> {
        let mark = mark(call, "InterpolateKernel", &request, &request.request_id)?;
        let display = self.display_named(call, &Field::new("display"), &request.display).await?;
        let wavelength = Field::new("wavelength_m").wavelength_of(request.wavelength_m, &display)?;
        let distance = distance(&Field::new("place"), request.place.as_ref())?;
        let version = self.service.kernels.interpolate(call, display, wavelength, distance, mark).await?;
        Ok(to_wire::version(version))
    }

    pub(crate) async fn compare_kernel_versions(
        &self,
        call: &Call,
        request: v1::CompareKernelVersionsRequest,
    ) -> Result<v1::KernelComparison> {
        let first = names::kernel_version(call, &Field::new("first"), &request.first)?;
        let second = names::kernel_version(call, &Field::new("second"), &request.second)?;
        let ([first, second], comparison) = self.service.kernels.compare(call, [first, second]).await?;
        let parts = to_wire::parts::compared(&comparison);
        let Comparison { transfer, source, picture_png, .. } = comparison;
        Ok(v1::KernelComparison {
            first: Some(to_wire::version(first)),
            second: Some(to_wire::version(second)),
            transfer_difference: transfer.relative,
            transfer_phase_rad: transfer.phase_rad,
            source_difference: source.relative,
            source_phase_rad: source.phase_rad,
            parts,
            picture_png: picture_png.into(),
        })
    }
}
