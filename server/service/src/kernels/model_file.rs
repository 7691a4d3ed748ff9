//! Reading the files of kernel versions.

use super::Kernels;
use crate::call::Call;
use crate::error::{Result, ServiceError};
use lightpath_artifacts::ArtifactError;
use lightpath_domain::display::Display;
use lightpath_domain::kernel::{KernelKey, KernelVersion};
use lightpath_domain::planning;
use lightpath_domain::reason::PreconditionReason;
use lightpath_media::kernel_file;
use lightpath_optics::memory::sampling_bytes;
use lightpath_optics::{ConvolutionMethod, DisplayModel};

/// Bytes of a transfer function for each pixel of its display: a complex64 for each of four frequencies.
const TRANSFER_BYTES_PER_PX: u64 = 32;
/// Memory besides the kernel \[bytes\].
const OTHER_BYTES: u64 = 16 << 20;

/// Memory for converting a kernel file of `file_bytes` to any format \[bytes\]: the file and its model, the transfer
/// function at all frequencies, its numbers, the other file, the model read back from it, and the sampling of free
/// space. A dense kernel of 1080p was measured to need 128 bytes a pixel besides its file.
pub(super) fn exporting_bytes(file_bytes: u64, display: &Display, key: &KernelKey) -> u64 {
    let px = u64::from(display.height_px) * u64::from(display.width_px);
    // The file names the method. These need most.
    let most = if display.orders.are_all() { ConvolutionMethod::AllOrders } else { ConvolutionMethod::BandResponse };
    let setup = planning::setup(display, key.wavelength, key.distance);
    let sampling = setup.map_or(0, |setup| sampling_bytes(&setup.with_method_regardless(most)));
    file_bytes + 4 * TRANSFER_BYTES_PER_PX * px + sampling + OTHER_BYTES
}

impl Kernels {
    /// Reads the model from the file of a version.
    pub(super) async fn model_of(&self, call: &Call, version: &KernelVersion) -> Result<DisplayModel> {
        let (artifacts, artifact) = (self.artifacts.clone(), version.content.artifact.clone());
        let read =
            move || -> Result<_, ArtifactError> { Ok(kernel_file::decode(&artifacts.read_blocking(&artifact)?)) };
        let decoded = self.computing.run(call, kernel_file::decoding_bytes(version.content.size_bytes), read).await??;
        let (model, _) = decoded.map_err(|error| ServiceError::Precondition {
            reason: PreconditionReason::KernelUnreadable,
            message: format!("{}/versions/{}: {error}", version.key, version.version),
        })?;
        Ok(model)
    }
}
