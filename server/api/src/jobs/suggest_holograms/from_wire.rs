//! Checks of requests to suggest holograms.

use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use lightpath_domain::job::SuggestHolograms;
use lightpath_domain::job::suggest::{SUGGESTIONS_DEFAULT, SUGGESTIONS_MAX};
use lightpath_optics::learning::KernelModel;
use lightpath_proto::v1;

impl Api {
    /// Checks a request and converts it. Refuses a version that does not exist, or that has no model of the modulator
    /// or no dataset.
    pub(crate) async fn suggest_holograms_spec(
        &self,
        call: &Call,
        message: v1::SuggestHolograms,
        field: &Field,
    ) -> Result<SuggestHolograms, ApiError> {
        let of_version = field.at("kernel_version");
        let found = self.existing_version(call, &of_version, &message.kernel_version).await?;
        let name = format!("{}/versions/{}", found.key, found.version);
        if !matches!(found.content.model, KernelModel::Display | KernelModel::Varying) {
            let model = found.content.model.name();
            let fix = "but what holograms can tell is known for display and varying models only; learn one";
            return Err(of_version.invalid(format!("names {name}, whose model is {model}, {fix}")));
        }
        if found.content.lineage.own_dataset().is_none() {
            let fix = "but the suggestion needs the holograms of its dataset; name a version that was learned here";
            return Err(of_version.invalid(format!("names {name}, which was imported or interpolated, {fix}")));
        }
        let holograms =
            field.at("holograms").integer_or(message.holograms, SUGGESTIONS_DEFAULT, 1..=SUGGESTIONS_MAX)?;
        Ok(SuggestHolograms { kernel: found.key, version: found.version, holograms, seed: message.seed })
    }
}
