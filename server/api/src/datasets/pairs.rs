//! Reading and measuring a dataset's pairs.

use super::{from_wire, to_wire};
use crate::api::Api;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use lightpath_domain::access::Caller;
use lightpath_domain::dataset::{Dataset, Pair, PairChecks};
use lightpath_domain::display::Display;
use lightpath_media::captures::{self, CaptureError, Captures};
use lightpath_proto::v1;

/// What was read of a pair: its checks, or what is wrong with one of its files.
type Checked = Result<PairChecks, (&'static str, CaptureError)>;

impl Api {
    pub(crate) async fn add_pair(&self, caller: &Caller, request: v1::AddPairRequest) -> Result<v1::Dataset, ApiError> {
        let dataset_field = Field::new("dataset");
        let id = names::dataset_id(&dataset_field, &request.dataset)?;
        let field = Field::new("pair");
        let mut pair = from_wire::pair(&field.required(request.pair)?, &field)?;
        let dataset = self.dataset_named(caller, &dataset_field, &id).await?;
        // Learning would find out much later what is wrong.
        pair.checks = Some(self.checked(caller, &dataset, &pair, &field).await?);
        let answer = self.store.add_pair(&id, &pair).await?;
        // A pair is judged beside all others.
        let findings = captures::findings_of(&self.store.dataset(&id).await?, &pair.id);
        let findings = findings.into_iter().map(to_wire::finding).collect();
        Ok(v1::Dataset { findings, ..to_wire::dataset(answer) })
    }

    /// Reads and measures a pair; refuses one whose files are not what they must be.
    async fn checked(
        &self,
        caller: &Caller,
        dataset: &Dataset,
        pair: &Pair,
        field: &Field,
    ) -> Result<PairChecks, ApiError> {
        let (display, _) = self.store.display(&dataset.display).await?;
        let phase = self.picture_bytes(caller, &field.at("phase"), &pair.phase).await?;
        let photo = self.picture_bytes(caller, &field.at("photo"), &pair.photo).await?;
        let checked = self.check(display, dataset.clone(), pair.clone(), phase, photo).await?;
        checked.map_err(|(name, error)| {
            let digest = if name == "phase" { &pair.phase } else { &pair.photo };
            field.at(name).invalid(format!("({digest}): {error}"))
        })
    }

    /// Measures again what was measured with another alignment, or not at all, and keeps it.
    pub(crate) async fn check_again(&self, dataset: &mut Dataset) -> Result<(), ApiError> {
        let homography = dataset.alignment.as_ref().map(|alignment| alignment.homography);
        let (display, _) = self.store.display(&dataset.display).await?;
        let current = |checks: &PairChecks| checks.homography == homography;
        let mut renewed = Vec::new();
        for index in 0..dataset.pairs.len() {
            let pair = dataset.pairs[index].clone();
            if pair.checks.as_ref().is_some_and(current) {
                continue;
            }
            let phase = self.artifacts.read_all(&pair.phase).await?;
            let photo = self.artifacts.read_all(&pair.photo).await?;
            let checked = self.check(display.clone(), dataset.clone(), pair.clone(), phase, photo).await?;
            let checks = checked.map_err(|(_, error)| refused(&pair.id, &error))?;
            dataset.pairs[index].checks = Some(checks.clone());
            renewed.push((pair.id, checks));
        }
        Ok(self.store.keep_checks(&dataset.id, &renewed).await?)
    }

    /// What the photographs of a dataset are read with.
    pub(crate) async fn captures(&self, dataset: &Dataset) -> Result<Captures, ApiError> {
        let (display, _) = self.store.display(&dataset.display).await?;
        Captures::of(&display, dataset).map_err(|error| refused("", &error))
    }

    async fn check(
        &self,
        display: Display,
        dataset: Dataset,
        pair: Pair,
        phase: Vec<u8>,
        photo: Vec<u8>,
    ) -> Result<Checked, ApiError> {
        let last = self.last_reconstructor.clone();
        let compute = move || {
            let captures = Captures::of(&display, &dataset).map_err(|error| ("photo", error))?;
            // Read by itself first, so that a refusal can name the field.
            captures.phase(&phase).map_err(|error| ("phase", error))?;
            let reconstructor = last.of(&dataset, &captures);
            captures::check(&captures, reconstructor.as_ref(), &pair, &phase, &photo).map_err(|error| ("photo", error))
        };
        self.decoding.run(compute).await
    }
}

/// Refuses what cannot be done because a file of the dataset cannot be read.
pub(crate) fn refused(pair: &str, error: &CaptureError) -> ApiError {
    let message = if pair.is_empty() { error.to_string() } else { format!("pair \"{pair}\": {error}") };
    ApiError::Precondition { reason: "DATASET_UNREADABLE", message }
}
