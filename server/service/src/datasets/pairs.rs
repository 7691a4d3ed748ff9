//! Adding pairs to datasets: reading, measuring and comparing them.

use super::Datasets;
use super::reconstructors::LastReconstructor;
use crate::call::Call;
use crate::error::Result;
use crate::field::Field;
use crate::wrong_fields::{all_of, is_about_fields};
use lightpath_artifacts::ArtifactError;
use lightpath_domain::dataset::{Dataset, Finding, Pair, PairChecks};
use lightpath_domain::display::Display;
use lightpath_media::captures::{self, CaptureError, Captures};
use lightpath_store::PairsOf;
use std::collections::HashSet;

/// Memory for checking a pair, for each pixel of the display \[bytes\]: the reconstruction's fields and transfer
/// function on the doubled grid (8 bytes for each of four samples, three times), and six planes of light and phase.
const CHECKING_BYTES_PER_PX: u64 = 3 * 4 * 8 + 6 * 4;
/// Memory for comparing the pairs of a dataset \[bytes\]. Their measurements are small.
const FINDINGS_BYTES: u64 = 16 << 20;

/// Measurements of a pair, or the field of a wrong file and its error.
type MeasuredPair = Result<PairChecks, (&'static str, CaptureError)>;

impl Datasets {
    /// Adds pairs to a dataset, all or none. Returns the dataset without its pairs, and the pairs with their measurements
    /// and findings. Pairs that the dataset has already are returned as they are.
    pub async fn add_pairs(&self, call: &Call, id: &str, pairs: Vec<Pair>) -> Result<PairsOf> {
        let dataset = self.named(call, &Field::new("dataset"), id).await?;
        // Wrong files are refused now, because learning would notice them much later.
        let (mut all, mut refused) = (Vec::new(), Vec::new());
        for (index, pair) in pairs.into_iter().enumerate() {
            let known = dataset.pairs.iter().find(|known| known.is_given_again_by(&pair));
            if let Some(known) = known {
                all.push((known.clone(), false));
                continue;
            }
            match self.measured_pair(call, &dataset, &pair, &Field::new("pairs").index(index)).await {
                Ok(checks) => all.push((Pair { checks: Some(checks), ..pair }, true)),
                Err(error) if is_about_fields(&error) => refused.push(error),
                // The other pairs would have the same error, such as a client that left.
                Err(error) => return Err(error),
            }
        }
        if !refused.is_empty() {
            return Err(all_of(refused));
        }
        let new: Vec<Pair> = all.iter().filter(|(_, is_new)| *is_new).map(|(pair, _)| pair.clone()).collect();
        let mut findings = dataset.findings.clone();
        let mut after = Dataset { findings: Vec::new(), pairs: Vec::new(), ..dataset.clone() };
        if new.is_empty() {
            after.findings.extend(findings.iter().filter(|finding| finding.pair.is_empty()).cloned());
        } else {
            let about_new = self.findings_with(call, dataset, &new).await?;
            after = self.store.add_pairs(id, &new, &about_new).await?;
            findings.extend(about_new);
        }
        let of_pair = |pair: &Pair| findings.iter().filter(|finding| finding.pair == pair.id).cloned().collect();
        let pairs = all
            .into_iter()
            .map(|(pair, _)| {
                let findings = of_pair(&pair);
                (pair, findings)
            })
            .collect();
        Ok(PairsOf { dataset: after, pairs })
    }

    /// Findings about new pairs of the dataset, each compared with all other pairs, and about the dataset with them.
    async fn findings_with(&self, call: &Call, mut dataset: Dataset, new: &[Pair]) -> Result<Vec<Finding>> {
        let ids: HashSet<String> = new.iter().map(|pair| pair.id.clone()).collect();
        dataset.pairs.retain(|other| !ids.contains(&other.id));
        dataset.pairs.extend_from_slice(new);
        dataset.pairs.sort_by(|a, b| a.id.cmp(&b.id));
        self.computing.run(call, FINDINGS_BYTES, move || captures::findings_with(&dataset, &ids)).await
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
