//! Comparison of two versions.

use super::Kernels;
use super::model_file::exporting_bytes;
use crate::call::Call;
use crate::error::ServiceError;
use lightpath_domain::kernel::KernelVersion;
use lightpath_domain::reason::PreconditionReason;
use lightpath_media::report::{Comparison, comparison};

impl Kernels {
    /// Compares two versions of the same display and wavelength.
    pub async fn compare(&self, call: &Call, [first, second]: [&KernelVersion; 2]) -> Result<Comparison, ServiceError> {
        let models = [self.model_of(call, first).await?, self.model_of(call, second).await?];
        let (display, _) = self.store.display(&first.key.display).await?;
        let need_bytes = exporting_bytes(first.content.size_bytes + second.content.size_bytes, &display, &first.key);
        let names = [first, second].map(|version| format!("version {}", version.version));
        let compare = move || comparison([&models[0], &models[1]], [&names[0], &names[1]]);
        let found = self.computing.run(call, need_bytes, compare).await?;
        found.map_err(|error| ServiceError::Precondition {
            reason: PreconditionReason::KernelUnreadable,
            message: format!("{}: {error}", first.key),
        })
    }
}
