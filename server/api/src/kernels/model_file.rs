//! Reading the files of kernel versions.

use crate::api::Api;
use crate::error::ApiError;
use lightpath_domain::kernel::KernelVersion;
use lightpath_domain::reason::PreconditionReason;
use lightpath_media::kernel_file;
use lightpath_optics::DisplayModel;

impl Api {
    /// Reads the model from the file of a version.
    pub(crate) async fn model_of(&self, version: &KernelVersion) -> Result<DisplayModel, ApiError> {
        let bytes = self.artifacts.read_all(&version.content.artifact).await?;
        let (model, _) = kernel_file::decode(&bytes).map_err(|error| ApiError::Precondition {
            reason: PreconditionReason::KernelUnreadable,
            message: format!("{}/versions/{}: {error}", version.key, version.version),
        })?;
        Ok(model)
    }
}
