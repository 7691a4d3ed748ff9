//! Reading and measuring a dataset's pairs.

use super::{from_wire, to_wire};
use crate::api::Api;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use lightpath_domain::access::Caller;
use lightpath_domain::dataset::{Dataset, Finding, Pair, PairChecks};
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
        let findings = self.findings_with(dataset, &pair).await?;
        let answer = self.store.add_pair(&id, &pair, &findings).await?;
        let findings = findings.into_iter().filter(|finding| finding.pair == pair.id).collect();
        Ok(to_wire::dataset(Dataset { findings, ..answer }))
    }

    /// What should be known about a pair beside all others, and about the dataset with it.
    async fn findings_with(&self, mut dataset: Dataset, pair: &Pair) -> Result<Vec<Finding>, ApiError> {
        let pair = pair.clone();
        let compute = move || {
            let id = pair.id.clone();
            dataset.pairs.retain(|other| other.id != id);
            let place = dataset.pairs.partition_point(|other| other.id < id);
            dataset.pairs.insert(place, pair);
            captures::findings_with(&dataset, &id)
        };
        self.checking.run(compute).await
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
        self.checking.run(compute).await
    }
}
