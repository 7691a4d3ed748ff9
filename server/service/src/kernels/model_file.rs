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
use lightpath_media::kernel_formats::{self, KernelFormat};
use lightpath_optics::DisplayModel;

/// Memory for converting a kernel file of `file_bytes` of a display \[bytes\].
pub(super) fn exporting_bytes(format: KernelFormat, file_bytes: u64, display: &Display, key: &KernelKey) -> u64 {
    // A file whose setup is not possible is refused when its model is read.
    let setup = planning::setup(display, key.wavelength, key.distance);
    setup.map_or(kernel_file::decoding_bytes(file_bytes), |setup| {
        kernel_formats::exporting_bytes(format, file_bytes, &setup)
    })
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
