//! Comparison of two versions.

use super::Kernels;
use super::model_file::exporting_bytes;
use crate::call::Call;
use crate::error::{Result, ServiceError};
use crate::field::Field;
use lightpath_domain::kernel::{KernelKey, KernelVersion};
use lightpath_domain::reason::PreconditionReason;
use lightpath_media::kernel_formats::KernelFormat;
use lightpath_media::report::{Comparison, comparison};

impl Kernels {
    /// Compares two versions. Refuses those of different displays or wavelengths.
    pub async fn compare(
        &self,
        call: &Call,
        [(key, version), (second_key, second)]: [(KernelKey, u32); 2],
    ) -> Result<([KernelVersion; 2], Comparison)> {
        if (&key.display, key.wavelength) != (&second_key.display, second_key.wavelength) {
            let name = format!("{second_key}/versions/{second}");
            let rule = "must be of the same display and wavelength as the first one";
            return Err(Field::new("second").but(format!("is {name:?}"), rule));
        }
        let first = self.store.kernel_version(&key, version).await?;
        let second = self.store.kernel_version(&second_key, second).await?;
        let models = [self.model_of(call, &first).await?, self.model_of(call, &second).await?];
        let (display, _) = self.store.display(&first.key.display).await?;
        let file_bytes = first.content.size_bytes + second.content.size_bytes;
        // A comparison samples both transfer functions, as a form does that has them as numbers.
        let need_bytes = exporting_bytes(KernelFormat::Complex64, file_bytes, &display, &first.key);
        let names = [&first, &second].map(|version| format!("version {}", version.version));
        let compare = move || comparison([&models[0], &models[1]], [&names[0], &names[1]]);
        let found = self.computing.run(call, need_bytes, compare).await?;
        let comparison = found.map_err(|error| ServiceError::Precondition {
            reason: PreconditionReason::KernelUnreadable,
            message: format!("{}: {error}", first.key),
        })?;
        Ok(([first, second], comparison))
    }
}
