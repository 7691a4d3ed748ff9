//! Adding pairs to datasets: reading, measuring and comparing them.

use super::Datasets;
use super::reconstructors::LastReconstructor;
use crate::call::Call;
use crate::error::Result;
use crate::field::Field;
use lightpath_artifacts::ArtifactError;
use lightpath_domain::dataset::{Dataset, Finding, Pair, PairChecks};
use lightpath_domain::display::Display;
use lightpath_media::captures::{self, CaptureError, Captures};

/// Memory for checking a pair, for each pixel of the display \[bytes\]: the reconstruction's fields and transfer
/// function on the doubled grid (8 bytes for each of four samples, three times), and six planes of light and phase.
const CHECKING_BYTES_PER_PX: u64 = 3 * 4 * 8 + 6 * 4;
/// Memory for comparing the pairs of a dataset \[bytes\]. Their measurements are small.
const FINDINGS_BYTES: u64 = 16 << 20;

/// Measurements of a pair, or the field of a wrong file and its error.
type MeasuredPair = Result<PairChecks, (&'static str, CaptureError)>;

impl Datasets {
    /// Adds a pair to a dataset, with its measurements and findings.
    pub async fn add_pair(&self, call: &Call, id: &str, mut pair: Pair) -> Result<Dataset> {
        let field = Field::new("pair");
        let dataset = self.named(call, &Field::new("dataset"), id).await?;
        // Wrong files are refused now, because learning would notice them much later.
        pair.checks = Some(self.measured_pair(call, &dataset, &pair, &field).await?);
        let findings = self.findings_with(call, dataset, &pair).await?;
        let answer = self.store.add_pair(id, &pair, &findings).await?;
        let findings = findings.into_iter().filter(|finding| finding.pair == pair.id).collect();
        Ok(Dataset { findings, ..answer })
    }

    /// Findings about the dataset with the new pair, which is compared with all other pairs.
    async fn findings_with(&self, call: &Call, mut dataset: Dataset, pair: &Pair) -> Result<Vec<Finding>> {
        let pair = pair.clone();
        let compute = move || {
            let id = pair.id.clone();
            dataset.pairs.retain(|other| other.id != id);
            let index = dataset.pairs.partition_point(|other| other.id < id);
            dataset.pairs.insert(index, pair);
            captures::findings_with(&dataset, &id)
        };
        self.computing.run(call, FINDINGS_BYTES, compute).await
    }

    /// Reads and measures a pair. Refuses a pair with a wrong file.
    async fn measured_pair(&self, call: &Call, dataset: &Dataset, pair: &Pair, field: &Field) -> Result<PairChecks> {
        let (display, _) = self.store.display(&dataset.display).await?;
        let px = u64::from(display.height_px) * u64::from(display.width_px);
        let need_bytes = self.files.reading_bytes(call, &field.at("pattern"), &pair.pattern, px).await?
            + self.files.reading_bytes(call, &field.at("photo"), &pair.photo, px).await?
            + CHECKING_BYTES_PER_PX * px;
        let (artifacts, last_reconstructor) = (self.artifacts.clone(), self.last_reconstructor.clone());
        let (dataset, new) = (dataset.clone(), pair.clone());
        let measure = move || -> Result<MeasuredPair, ArtifactError> {
            let (pattern, photo) = (artifacts.read_blocking(&new.pattern)?, artifacts.read_blocking(&new.photo)?);
            Ok(measured(&display, &dataset, &new, (&pattern, &photo), &last_reconstructor))
        };
        let measured = self.computing.run(call, need_bytes, measure).await??;
        measured.map_err(|(name, error)| {
            let digest = if name == "pattern" { &pair.pattern } else { &pair.photo };
            field.at(name).invalid(format!("({digest}): {error}"), "add a pair of files that belong together")
        })
    }
}

/// Reads and measures a pair from the files of its pattern and its photograph.
fn measured(
    display: &Display,
    dataset: &Dataset,
    pair: &Pair,
    (pattern, photo): (&[u8], &[u8]),
    last_reconstructor: &LastReconstructor,
) -> MeasuredPair {
    let captures = Captures::of(display, dataset).map_err(|error| ("photo", error))?;
    // The pattern is read separately first, so that an error in it names its field.
    captures.phase(pattern).map_err(|error| ("pattern", error))?;
    let reconstructor = last_reconstructor.of(dataset, &captures);
    captures::check(&captures, reconstructor.as_ref(), pair, pattern, photo).map_err(|error| ("photo", error))
}
