//! Finalizing a dataset: measuring what is not measured yet, aligning, and drawing the split.

use super::to_wire;
use crate::api::Api;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use crate::permissions::require_display;
use crate::time::now_ms;
use lightpath_domain::access::Caller;
use lightpath_domain::dataset::{self, Dataset};
use lightpath_media::captures;
use lightpath_proto::v1;

/// Largest fraction of the pairs that may be held out: something must be left to learn from.
const HELD_OUT_FRACTION_MAX: f64 = 0.8;
/// Pairs held out for the test unless said otherwise.
const TEST_FRACTION_DEFAULT: f64 = 0.2;

impl Api {
    pub(crate) async fn finalize_dataset(
        &self,
        caller: &Caller,
        request: v1::FinalizeDatasetRequest,
    ) -> Result<v1::Dataset, ApiError> {
        let id = names::dataset_id(&Field::new("name"), &request.name)?;
        let allowed = 0.0..=HELD_OUT_FRACTION_MAX;
        let validation = Field::new("validation_fraction").number(request.validation_fraction, allowed.clone())?;
        let test = Field::new("test_fraction").number_or(request.test_fraction, TEST_FRACTION_DEFAULT, allowed)?;
        if validation + test > HELD_OUT_FRACTION_MAX {
            let problem = format!("and test_fraction are {validation} and {test}, but must sum to at most 0.8");
            return Err(Field::new("validation_fraction").invalid(problem));
        }
        let mut dataset = self.store.dataset(&id).await?;
        require_display(caller, &dataset.display)?;
        if dataset.digest.is_none() {
            self.make_ready(caller, &mut dataset, request.keep_alignment).await?;
        }
        let splits = splits(&dataset, validation, test, request.seed)?;
        for (pair, (_, split)) in dataset.pairs.iter_mut().zip(&splits) {
            pair.split = *split;
        }
        let digest = dataset::digest(&dataset);
        Ok(to_wire::dataset(self.store.finalize_dataset(&id, &splits, &digest, now_ms()).await?))
    }

    /// Measures what is not measured yet, and aligns the photographs where they need it and it helps.
    async fn make_ready(&self, caller: &Caller, dataset: &mut Dataset, keep_alignment: bool) -> Result<(), ApiError> {
        self.check_again(dataset).await?;
        if keep_alignment || !captures::needs_alignment(dataset) {
            return Ok(());
        }
        let Some(alignment) = self.align_by_pairs(caller, dataset).await? else { return Ok(()) };
        tracing::info!(dataset = dataset.id, corrected_px = alignment.corrected_px, "aligned the photographs");
        *dataset = self.store.align_dataset(&dataset.id, Some(&alignment)).await?;
        self.check_again(dataset).await
    }
}

/// What each pair is for: those that can't be learned from have no split.
fn splits(
    dataset: &Dataset,
    validation: f64,
    test: f64,
    seed: u64,
) -> Result<Vec<(String, Option<dataset::Split>)>, ApiError> {
    let findings = captures::findings(dataset);
    if let Some(message) = captures::refusal(dataset, &findings) {
        return Err(ApiError::Precondition { reason: "DATASET_UNUSABLE", message });
    }
    let is_good = |id: &str| !findings.iter().any(|finding| finding.excludes && finding.pair == id);
    let good: Vec<_> = dataset.pairs.iter().filter(|pair| is_good(&pair.id)).cloned().collect();
    let mut splits: Vec<_> = dataset::draw_split(&good, validation, test, seed)
        .into_iter()
        .map(|(id, split)| (id, Some(split)))
        .chain(dataset.pairs.iter().filter(|pair| !is_good(&pair.id)).map(|pair| (pair.id.clone(), None)))
        .collect();
    splits.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(splits)
}
