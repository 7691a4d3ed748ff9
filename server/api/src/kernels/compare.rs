//! Comparison of two versions.

use super::model_file::exporting_bytes;
use super::to_wire;
use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use lightpath_domain::reason::PreconditionReason;
use lightpath_media::report::{Comparison, comparison};
use lightpath_proto::v1;
use lightpath_proto::v1::kernel_comparison::Parameter;

impl Api {
    pub(crate) async fn compare_kernel_versions(
        &self,
        call: &Call,
        request: v1::CompareKernelVersionsRequest,
    ) -> Result<v1::KernelComparison, ApiError> {
        let (first_key, first) = names::kernel_version(call, &Field::new("first"), &request.first)?;
        let field = Field::new("second");
        let (second_key, second) = names::kernel_version(call, &field, &request.second)?;
        if (&first_key.display, first_key.wavelength) != (&second_key.display, second_key.wavelength) {
            let rule = "must be of the same display and wavelength as the first one";
            return Err(field.invalid(format!("is {:?}, but {rule}", request.second)));
        }
        let first = self.store.kernel_version(&first_key, first).await?;
        let second = self.store.kernel_version(&second_key, second).await?;
        let models = [self.model_of(call, &first).await?, self.model_of(call, &second).await?];
        let (display, _) = self.store.display(&first_key.display).await?;
        let need_bytes = exporting_bytes(first.content.size_bytes + second.content.size_bytes, &display, &first_key);
        let names = [&first, &second].map(|version| format!("version {}", version.version));
        let compare = move || comparison([&models[0], &models[1]], [&names[0], &names[1]]);
        let found = self.accounts.compute(call, need_bytes, compare).await?;
        let Comparison { transfer, source, parameters, picture_png } =
            found.map_err(|error| ApiError::Precondition {
                reason: PreconditionReason::KernelUnreadable,
                message: format!("{first_key}: {error}"),
            })?;
        let parameter = |(name, [first, second]): (&str, [Option<String>; 2])| Parameter {
            name: name.to_owned(),
            first: first.unwrap_or_default(),
            second: second.unwrap_or_default(),
        };
        Ok(v1::KernelComparison {
            first: Some(to_wire::version(first)),
            second: Some(to_wire::version(second)),
            transfer_difference: transfer.relative,
            transfer_phase_rad: transfer.phase_rad,
            source_difference: source.relative,
            source_phase_rad: source.phase_rad,
            parameters: parameters.into_iter().map(parameter).collect(),
            picture_png: picture_png.into(),
        })
    }
}
