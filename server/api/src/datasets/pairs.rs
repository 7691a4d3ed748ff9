//! Adding pairs to datasets: reading, measuring and comparing them.

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

/// Measurements of a pair, or the field of a wrong file and its error.
type MeasuredPair = Result<PairChecks, (&'static str, CaptureError)>;

impl Api {
    /// Adds a pair to a dataset, with its measurements and findings.
    pub(crate) async fn add_pair(&self, caller: &Caller, request: v1::AddPairRequest) -> Result<v1::Dataset, ApiError> {
        let dataset_field = Field::new("dataset");
        let id = names::dataset_id(&dataset_field, &request.dataset)?;
        let field = Field::new("pair");
        let mut pair = from_wire::pair(&field.required(request.pair)?, &field)?;
        let dataset = self.dataset_named(caller, &dataset_field, &id).await?;
        // Wrong files are refused now, because learning would notice them much later.
        pair.checks = Some(self.measured_pair(caller, &dataset, &pair, &field).await?);
        let findings = self.findings_with(dataset, &pair).await?;
        let answer = self.store.add_pair(&id, &pair, &findings).await?;
        let findings = findings.into_iter().filter(|finding| finding.pair == pair.id).collect();
        Ok(to_wire::dataset(Dataset { findings, ..answer }))
    }

    /// Findings about the dataset with the new pair, which is compared with all other pairs.
    async fn findings_with(&self, mut dataset: Dataset, pair: &Pair) -> Result<Vec<Finding>, ApiError> {
        let pair = pair.clone();
        let compute = move || {
            let id = pair.id.clone();
            dataset.pairs.retain(|other| other.id != id);
            let index = dataset.pairs.partition_point(|other| other.id < id);
            dataset.pairs.insert(index, pair);
            captures::findings_with(&dataset, &id)
        };
        self.checking.run(compute).await
    }

    /// Reads and measures a pair. Refuses a pair with a wrong file.
    async fn measured_pair(
        &self,
        caller: &Caller,
        dataset: &Dataset,
        pair: &Pair,
        field: &Field,
    ) -> Result<PairChecks, ApiError> {
        let (display, _) = self.store.display(&dataset.display).await?;
        let phase = self.picture_bytes(caller, &field.at("phase"), &pair.phase).await?;
        let photo = self.picture_bytes(caller, &field.at("photo"), &pair.photo).await?;
        let measured = self.measure_pair(display, dataset.clone(), pair.clone(), phase, photo).await?;
        measured.map_err(|(name, error)| {
            let digest = if name == "phase" { &pair.phase } else { &pair.photo };
            field.at(name).invalid(format!("({digest}): {error}"))
        })
    }

    async fn measure_pair(
        &self,
        display: Display,
        dataset: Dataset,
        pair: Pair,
        phase: Vec<u8>,
        photo: Vec<u8>,
    ) -> Result<MeasuredPair, ApiError> {
        let last_reconstructor = self.last_reconstructor.clone();
        let compute = move || {
            let captures = Captures::of(&display, &dataset).map_err(|error| ("photo", error))?;
            // The hologram is read separately first, so that an error in it names its field.
            captures.phase(&phase).map_err(|error| ("phase", error))?;
            let reconstructor = last_reconstructor.of(&dataset, &captures);
            captures::check(&captures, reconstructor.as_ref(), &pair, &phase, &photo).map_err(|error| ("photo", error))
        };
        self.checking.run(compute).await
    }
}
