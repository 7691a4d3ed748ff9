//! Jobs that suggest holograms to photograph.

use crate::api::Api;
use crate::names;
use lightpath_domain::job::kinds::suggest_holograms::{SUGGESTIONS_DEFAULT, SUGGESTIONS_MAX};
use lightpath_domain::job::{SuggestHolograms, SuggestResult, SuggestedHologram};
use lightpath_proto::v1::{self, suggest_holograms_result};
use lightpath_service::{Call, Field, Result};

/// Checks a request and converts it. Refuses a version that does not exist, or that has no model of the modulator
/// or no dataset.
pub(super) async fn from_wire(
    api: &Api,
    call: &Call,
    message: v1::SuggestHolograms,
    field: &Field,
) -> Result<SuggestHolograms> {
    let of_version = field.at("kernel_version");
    let (key, version) = names::kernel_version(call, &of_version, &message.kernel_version)?;
    let found = api.service.jobs.suggestible_version(&of_version, &key, version).await?;
    let holograms = field.at("holograms").integer_or(message.holograms, SUGGESTIONS_DEFAULT, 1..=SUGGESTIONS_MAX)?;
    Ok(SuggestHolograms { kernel: found.key, version: found.version, holograms, seed: message.seed })
}

/// Converts the request into its message.
pub(super) fn to_wire(spec: SuggestHolograms) -> v1::SuggestHolograms {
    let SuggestHolograms { kernel, version, holograms, seed } = spec;
    let kernel_version = format!("{kernel}/versions/{version}");
    v1::SuggestHolograms { kernel_version, holograms: Some(holograms), seed }
}

/// Converts the result into its message.
pub(super) fn result(result: SuggestResult) -> v1::SuggestHologramsResult {
    let SuggestResult { holograms, worth_photographs } = result;
    v1::SuggestHologramsResult { holograms: holograms.into_iter().map(suggestion).collect(), worth_photographs }
}

fn suggestion(hologram: SuggestedHologram) -> suggest_holograms_result::Suggestion {
    let SuggestedHologram { pattern, picture, phase_range_rad, error_db, part, part_db } = hologram;
    suggest_holograms_result::Suggestion {
        pattern,
        picture,
        phase_range_rad,
        error_db,
        part: part.name().to_owned(),
        part_db,
    }
}
