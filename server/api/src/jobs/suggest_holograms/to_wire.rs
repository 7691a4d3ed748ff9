//! Conversion of the requests and results of jobs that suggest holograms into messages.

use crate::enumerations::OnWire as _;
use lightpath_domain::job::{SuggestHolograms, SuggestResult, SuggestedHologram};
use lightpath_proto::v1::{self, suggest_result};

/// Converts the request into its message.
pub(crate) fn spec(spec: SuggestHolograms) -> v1::SuggestHolograms {
    let SuggestHolograms { kernel, version, holograms, seed } = spec;
    v1::SuggestHolograms { kernel_version: format!("{kernel}/versions/{version}"), holograms, seed }
}

/// Converts the result into its message.
pub(crate) fn result(result: SuggestResult) -> v1::SuggestResult {
    let SuggestResult { holograms, worth_photographs } = result;
    v1::SuggestResult { holograms: holograms.into_iter().map(suggestion).collect(), worth_photographs }
}

fn suggestion(hologram: SuggestedHologram) -> suggest_result::Suggestion {
    let SuggestedHologram { phase, picture, phase_range_rad, error_db, part, part_db } = hologram;
    suggest_result::Suggestion { phase, picture, phase_range_rad, error_db, part: part.to_wire(), part_db }
}
