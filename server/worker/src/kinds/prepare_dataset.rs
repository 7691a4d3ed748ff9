//! Prepares a dataset: finds the alignment of the camera with the display's pixels, and finalizes the dataset.
//!
//! A job reads the dataset once. The store makes all changes in the transaction that ends the job (`finish`).

use crate::{JobContext, TaskError, TaskOutput};
use lightpath_camera::alignment::PointPair;
use lightpath_domain::dataset::{
    Alignment, AlignmentMethod, Dataset, Finalization, Finding, FindingKind, Pair, PairChecks, PreparedDataset, Split,
    SplitCounts, Splits, draw_split, replace_missing,
};
use lightpath_domain::display::Display;
use lightpath_domain::job::estimate::{ALIGNMENT_BYTES_MAX, ALIGNMENT_PAIRS_MAX};
use lightpath_domain::job::{
    AlignBy, FailureReason, JobEffect, JobResult, PrepareDataset, PrepareResult, PrepareStep, Progress,
};
use lightpath_media::captures::{self, CaptureError, Captures, Correction, FoundAlignment, ROUNDS_MAX, Reconstructor};
use lightpath_optics::Plane;
use serde::{Deserialize, Serialize};
use std::cell::OnceCell;
use std::collections::BTreeMap;

/// Number of training pairs from which they are not few.
const TRAINING_PAIRS_FEW: usize = 6;

const CHECK: &str = "check the photographs";
const READ: &str = "read photographs for the alignment";
const ALIGN: &str = "align the photographs";

pub(super) fn run(context: &JobContext, spec: &PrepareDataset) -> Result<TaskOutput, TaskError> {
    let dataset = context.wait(context.store().dataset(&spec.dataset))?;
    if let Some(before) = dataset.finalization {
        return match spec.step {
            PrepareStep::Finalize(requested) if requested == before => finalized_before(context, dataset),
            _ => Err(already_finalized(&dataset.id)),
        };
    }
    let mut preparation = Preparation::begin(context, dataset)?;
    let closing = match &spec.step {
        PrepareStep::Align(by) => {
            preparation.align(by)?;
            None
        }
        PrepareStep::Finalize(finalization) => {
            preparation.prepare_to_finalize(finalization.keep_alignment)?;
            Some(*finalization)
        }
    };
    preparation.output(closing)
}

/// Output for a dataset that was finalized before with the same options. Nothing changes.
fn finalized_before(context: &JobContext, dataset: Dataset) -> Result<TaskOutput, TaskError> {
    let pairs = dataset.pairs.len() as u32;
    context.report(progress(CHECK, pairs, pairs))?;
    let split_counts = dataset.split_counts;
    let result = PrepareResult {
        alignment: dataset.alignment,
        findings: dataset.findings,
        dataset_digest: dataset.digest,
        split_counts,
    };
    Ok(TaskOutput { result: JobResult::PrepareDataset(result), effect: JobEffect::None })
}

fn already_finalized(id: &str) -> TaskError {
    let message = format!(
        "datasets/{id} is already finalized, with another split or alignment, and cannot change; create another dataset"
    );
    TaskError::permanent(FailureReason::DatasetFinalized, message)
}

/// State that an interrupted attempt saves for the next attempt.
#[derive(Serialize, Deserialize)]
struct Saved {
    revision: u64,
    aligned: bool,
    alignment: Option<Alignment>,
    checks: BTreeMap<String, PairChecks>,
}

/// A dataset during its preparation.
struct Preparation<'a> {
    context: &'a JobContext,
    display: Display,
    /// The dataset with the changes made so far.
    dataset: Dataset,
    /// New measurements, by the ids of the pairs.
    checks: BTreeMap<String, PairChecks>,
    /// Whether this job has set the alignment of `dataset`.
    aligned: bool,
    /// Reconstructor, built for the first pair that is checked. `None`: no image can be computed at the dataset's
    /// distance.
    reconstructor: OnceCell<Option<Reconstructor>>,
}

impl<'a> Preparation<'a> {
    /// Resumes the work of an earlier attempt if the dataset has not changed since, or starts from the beginning.
    fn begin(context: &'a JobContext, dataset: Dataset) -> Result<Self, TaskError> {
        let (display, _) = context.wait(context.store().display(&dataset.display))?;
        let (checks, reconstructor) = (BTreeMap::new(), OnceCell::new());
        let mut preparation = Self { context, display, dataset, checks, aligned: false, reconstructor };
        let saved = context.take_saved_state().and_then(|bytes| serde_json::from_slice::<Saved>(&bytes).ok());
        if let Some(saved) = saved.filter(|saved| saved.revision == preparation.dataset.revision) {
            for pair in &mut preparation.dataset.pairs {
                if let Some(checks) = saved.checks.get(&pair.id) {
                    pair.checks = Some(checks.clone());
                }
            }
            (preparation.checks, preparation.aligned) = (saved.checks, saved.aligned);
            if preparation.aligned {
                preparation.dataset.alignment = saved.alignment;
            }
        }
        Ok(preparation)
    }

    /// Gives the dataset the requested alignment.
    fn align(&mut self, by: &AlignBy) -> Result<(), TaskError> {
        if !self.aligned {
            let alignment = match by {
                AlignBy::Points { photo_width_px, photo_height_px, points } => {
                    Some(self.align_by_points(points, [*photo_width_px, *photo_height_px])?)
                }
                AlignBy::Dots { photo } => Some(self.align_by_dots(photo)?),
                AlignBy::Pairs => {
                    self.update_checks()?;
                    Some(self.align_by_pairs(Correction::Affine)?.ok_or_else(|| not_alignable(&self.dataset.id))?)
                }
                AlignBy::None => None,
            };
            self.require_size(alignment.as_ref())?;
            self.set_alignment(alignment);
        }
        self.update_checks()
    }

    /// Measures the pairs, and corrects what is clearly the camera's in the photographs, if they need it and the
    /// alignment improves.
    fn prepare_to_finalize(&mut self, keep_alignment: bool) -> Result<(), TaskError> {
        self.update_checks()?;
        if !self.aligned && !keep_alignment && captures::needs_alignment(&self.dataset) {
            if let Some(alignment) = self.align_by_pairs(Correction::Camera)? {
                self.set_alignment(Some(alignment));
            }
            return self.update_checks();
        }
        Ok(())
    }

    fn set_alignment(&mut self, alignment: Option<Alignment>) {
        self.dataset.alignment = alignment;
        self.aligned = true;
    }

    /// Measures all pairs that were never measured, or were measured with another alignment.
    fn update_checks(&mut self) -> Result<(), TaskError> {
        let map = self.dataset.camera_map();
        let captures = Captures::of(&self.display, &self.dataset)?;
        let is_current = |pair: &Pair| pair.is_measured_with(map);
        let stale: Vec<usize> =
            (0..self.dataset.pairs.len()).filter(|&index| !is_current(&self.dataset.pairs[index])).collect();
        for (done, &index) in stale.iter().enumerate() {
            self.step(CHECK, done, stale.len())?;
            let pair = &self.dataset.pairs[index];
            let (phase, photo) = (self.context.read_artifact(&pair.pattern)?, self.context.read_artifact(&pair.photo)?);
            let checks = captures::check(&captures, self.reconstructor(&captures), pair, &phase, &photo)
                .map_err(|error| unreadable(&pair.id, &error))?;
            self.checks.insert(pair.id.clone(), checks.clone());
            self.dataset.pairs[index].checks = Some(checks);
        }
        self.step(CHECK, stale.len(), stale.len())
    }

    /// Computes the alignment from given points.
    fn align_by_points(&self, points: &[PointPair], photo_px: [u32; 2]) -> Result<Alignment, TaskError> {
        let found = captures::from_points(
            &Captures::of(&self.display, &self.dataset)?,
            points,
            [photo_px[1] as usize, photo_px[0] as usize],
        )?;
        self.store_alignment(AlignmentMethod::Points, found, photo_px, String::new())
    }

    /// Computes the alignment from the photograph of the displayed dots.
    fn align_by_dots(&self, digest: &str) -> Result<Alignment, TaskError> {
        self.step(ALIGN, 0, 1)?;
        let captures = Captures::of(&self.display, &self.dataset)?;
        let file = self.context.read_artifact(digest)?;
        let refused = |error: CaptureError| {
            TaskError::permanent(
                FailureReason::InvalidPicture,
                format!("the photograph of the dots ({digest}) cannot be used: {error}"),
            )
        };
        let photo = captures.camera(&Pair::default(), &file).map_err(refused)?.light;
        let found = captures::from_dots(&captures, &photo).map_err(refused)?;
        let size = [photo.width_px() as u32, photo.height_px() as u32];
        self.store_alignment(AlignmentMethod::Dots, found, size, digest.to_owned())
    }

    /// Computes the alignment from the photographs of the pairs. `None`: too few features were recognized, the present
    /// alignment could not be improved, or there is nothing of the kind to correct.
    fn align_by_pairs(&self, correction: Correction) -> Result<Option<Alignment>, TaskError> {
        let findings = captures::findings(&self.dataset);
        let good: Vec<&Pair> = self.dataset.pairs.iter().filter(|pair| !is_excluded(&findings, &pair.id)).collect();
        let Some(size) = good.first().and_then(|pair| pair.checks.as_ref()).map(|checks| checks.photo_px) else {
            return Ok(None);
        };
        let captures = Captures::of(&self.display, &self.dataset)?;
        let Some(reconstructor) = self.reconstructor(&captures) else { return Ok(None) };
        let display_px = captures.height_px() * captures.width_px();
        let pair_bytes = size_of::<f32>() * (display_px + size[0] as usize * size[1] as usize);
        let count = (ALIGNMENT_BYTES_MAX / pair_bytes).clamp(1, ALIGNMENT_PAIRS_MAX).min(good.len());
        let mut light: Vec<(Plane<f32>, Plane<f32>)> = Vec::with_capacity(count);
        // The pairs are spread evenly over the dataset, because neighbouring pairs may be similar.
        for pair in (0..count).map(|i| good[i * good.len() / count]) {
            self.step(READ, light.len(), count)?;
            let phase = captures.phase(&self.context.read_artifact(&pair.pattern)?);
            let photo = captures.camera(pair, &self.context.read_artifact(&pair.photo)?);
            let named = |error| unreadable(&pair.id, &error);
            light.push((reconstructor.light(&phase.map_err(named)?)?, photo.map_err(named)?.light));
        }
        let found =
            captures::from_pairs(&captures, &light, correction, |done| self.step(ALIGN, done, ROUNDS_MAX * count))?;
        found.map(|found| self.store_alignment(AlignmentMethod::Pairs, found, size, String::new())).transpose()
    }

    fn reconstructor(&self, captures: &Captures) -> Option<&Reconstructor> {
        self.reconstructor.get_or_init(|| Reconstructor::of(captures).ok()).as_ref()
    }

    /// Stores the pictures of an alignment.
    fn store_alignment(
        &self,
        method: AlignmentMethod,
        found: FoundAlignment,
        [photo_width_px, photo_height_px]: [u32; 2],
        photo: String,
    ) -> Result<Alignment, TaskError> {
        let stored = |picture: Vec<u8>| match picture.is_empty() {
            true => Ok(String::new()),
            false => self.context.put_artifact(picture),
        };
        Ok(Alignment {
            method,
            map: captures::stored_map(&found.map),
            photo_height_px,
            photo_width_px,
            points: found.points as u32,
            residual_px: found.residual_px,
            corrected_px: found.corrected_px,
            left_px: found.left_px,
            explanation: found.explanation,
            photo,
            before: stored(found.before)?,
            after: stored(found.after)?,
        })
    }

    /// Refuses an alignment for photographs of another size than the dataset's.
    fn require_size(&self, alignment: Option<&Alignment>) -> Result<(), TaskError> {
        let expected = match alignment {
            Some(alignment) => [alignment.photo_width_px, alignment.photo_height_px],
            None => [self.display.width_px, self.display.height_px],
        };
        let photo_px = |pair: &Pair| pair.checks.as_ref().map(|checks| checks.photo_px);
        match self.dataset.pairs.iter().find(|pair| photo_px(pair).is_some_and(|size| size != expected)) {
            None => Ok(()),
            Some(pair) => {
                let [width, height] = photo_px(pair).unwrap_or_default();
                let message = format!(
                    "pair \"{}\" has a photograph of {width}×{height} px, but the alignment is for {}×{} px; use \
                     photographs of the same size for the alignment as for the pairs",
                    pair.id, expected[0], expected[1]
                );
                Err(TaskError::permanent(FailureReason::AlignmentSize, message))
            }
        }
    }

    /// Reports progress, saves the state when a checkpoint is due, and checks whether the task must stop.
    fn step(&self, stage: &str, done: usize, total: usize) -> Result<(), TaskError> {
        self.context.step(progress(stage, done as u32, total as u32), || {
            let saved = Saved {
                revision: self.dataset.revision,
                aligned: self.aligned,
                alignment: self.dataset.alignment.clone(),
                checks: self.checks.clone(),
            };
            // All parts are valid JSON. If this failed, the next attempt would start from the beginning.
            serde_json::to_vec(&saved).unwrap_or_default()
        })
    }

    /// Output of the task. The store refuses it if the dataset has changed in the meantime.
    fn output(self, closing: Option<Finalization>) -> Result<TaskOutput, TaskError> {
        let mut findings = captures::findings(&self.dataset);
        let closing = match closing {
            None => None,
            Some(finalization) => Some((finalization, splits(&self.dataset, &mut findings, finalization)?)),
        };
        let split_counts = closing.as_ref().map(|(_, splits)| SplitCounts::of(splits.iter().map(|(_, split)| *split)));
        let result = PrepareResult {
            alignment: self.dataset.alignment.clone(),
            findings: findings.clone(),
            dataset_digest: None,
            split_counts,
        };
        let prepared = PreparedDataset {
            dataset: self.dataset.id,
            revision: self.dataset.revision,
            alignment: self.dataset.alignment,
            checks: self.checks,
            findings,
            closing,
        };
        Ok(TaskOutput { result: JobResult::PrepareDataset(result), effect: JobEffect::Dataset(Box::new(prepared)) })
    }
}

fn progress(stage: &str, step: u32, steps_total: u32) -> Progress {
    Progress { stage: stage.to_owned(), step, steps_total, loss: None, eta_s: None }
}

/// Draws the split of the pairs, and adds findings about it. Pairs that are excluded from learning have no split.
fn splits(dataset: &Dataset, findings: &mut Vec<Finding>, options: Finalization) -> Result<Splits, TaskError> {
    if let Some(message) = captures::refusal(dataset, findings) {
        return Err(TaskError::permanent(FailureReason::DatasetUnusable, message));
    }
    let (left_out, good): (Vec<Pair>, Vec<Pair>) =
        dataset.pairs.iter().cloned().partition(|pair| is_excluded(findings, &pair.id));
    let mut drawn = draw_split(&good, options.validation_fraction, options.test_fraction, options.seed);
    // Pairs that were given for the test or for validation must not disappear only because none of them can be used.
    for (split, word) in [(Split::Test, "the test"), (Split::Validation, "validation")] {
        if left_out.iter().any(|pair| pair.split == Some(split))
            && let Some(pair) = replace_missing(&mut drawn, &good, split, options.seed)
        {
            let message = format!("is used for {word}, because no pair that was given for {word} can be used");
            findings.push(Finding { pair, kind: FindingKind::FewPairs, excludes: false, message });
        }
    }
    findings.extend(few_pairs(&drawn));
    // Findings about pairs, in the order of the pairs, then those about the whole dataset.
    findings.sort_by(|a, b| (a.pair.is_empty(), &a.pair).cmp(&(b.pair.is_empty(), &b.pair)));
    let mut splits: Splits = drawn
        .into_iter()
        .map(|(id, split)| (id, Some(split)))
        .chain(left_out.into_iter().map(|pair| (pair.id, None)))
        .collect();
    splits.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(splits)
}

/// Findings about too few pairs for training and for validation.
fn few_pairs(splits: &[(String, Split)]) -> Vec<Finding> {
    let count = |wanted: Split| splits.iter().filter(|(_, split)| *split == wanted).count();
    let mut messages = Vec::new();
    match count(Split::Validation) {
        0 => messages.push(
            "no pair is held out for validation, so that learning tries no part of the display model (uneven surface, \
             cross-talk, uneven response) and no other degree of the kernel; better have at least 2"
                .to_owned(),
        ),
        1 => messages.push(
            "only 1 pair is held out for validation, by which learning chooses the parts of the display model and the degree \
             of the kernel; better have at least 2"
                .to_owned(),
        ),
        2.. => {}
    }
    let training = count(Split::Train);
    if training < TRAINING_PAIRS_FEW {
        messages.push(format!(
            "only {training} pairs are left to learn from; better have at least {TRAINING_PAIRS_FEW}, and more for kernels of \
             high degree"
        ));
    }
    let whole = |message| Finding { pair: String::new(), kind: FindingKind::FewPairs, excludes: false, message };
    messages.into_iter().map(whole).collect()
}

fn is_excluded(findings: &[Finding], pair: &str) -> bool {
    findings.iter().any(|finding| finding.excludes && finding.pair == pair)
}

fn unreadable(pair: &str, error: &CaptureError) -> TaskError {
    TaskError::permanent(FailureReason::DatasetUnreadable, format!("pair \"{pair}\": {error}"))
}

fn not_alignable(id: &str) -> TaskError {
    let message = format!(
        "the pairs of datasets/{id} do not improve its alignment: they have too little fine structure, or are aligned \
         already; add pairs with finer pictures, or photograph the displayed dots (lightpath dataset calibration \
         --help)"
    );
    TaskError::permanent(FailureReason::NotAlignable, message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_domain::dataset::Encoding;
    use lightpath_fixtures::{DISTANCE, WAVELENGTH};

    fn dataset(given: &[Option<Split>]) -> Dataset {
        let mut dataset = Dataset::empty("d".into(), "lab".into(), WAVELENGTH, DISTANCE, Encoding::Linear);
        let pair = |(n, split): (usize, &Option<Split>)| Pair { id: format!("p{n}"), split: *split, ..Pair::default() };
        dataset.pairs = given.iter().enumerate().map(pair).collect();
        dataset
    }

    fn black(pair: &str) -> Finding {
        Finding { pair: pair.to_owned(), kind: FindingKind::Black, excludes: true, message: "is black".to_owned() }
    }

    fn fractions(validation_fraction: f64, test_fraction: f64) -> Finalization {
        Finalization { validation_fraction, test_fraction, seed: 1, keep_alignment: false }
    }

    #[test]
    fn excluded_validation_and_test_pairs_are_replaced() {
        let mut given = vec![None; 8];
        (given[0], given[1]) = (Some(Split::Validation), Some(Split::Test));
        let mut findings = vec![black("p0"), black("p1")];
        let splits = splits(&dataset(&given), &mut findings, fractions(0.0, 0.0)).unwrap();
        assert_eq!(splits[..2], [("p0".to_owned(), None), ("p1".to_owned(), None)]);
        let used = SplitCounts::of(splits.iter().map(|(_, split)| *split));
        assert_eq!((used.train, used.validation, used.test, used.excluded), (4, 1, 1, 2));
        let validation = splits.iter().find(|(_, split)| *split == Some(Split::Validation)).unwrap();
        let moved: Vec<_> =
            findings.iter().filter(|finding| finding.message.contains("no pair that was given")).collect();
        assert_eq!(moved.iter().map(|finding| &finding.pair).collect::<Vec<_>>(), [&validation.0], "{findings:?}");
        assert!(findings.is_sorted_by_key(|finding| (finding.pair.is_empty(), finding.pair.clone())));
    }

    #[test]
    fn given_pairs_stay_and_few_pairs_are_reported() {
        let messages = |given: &[Option<Split>], options| {
            let mut findings = Vec::new();
            let splits = splits(&dataset(given), &mut findings, options).unwrap();
            let messages: Vec<String> = findings.into_iter().map(|finding| finding.message).collect();
            (SplitCounts::of(splits.into_iter().map(|(_, split)| split)), messages)
        };
        let (used, enough) = messages(&[None; 12], fractions(0.2, 0.2));
        assert_eq!((used.train, used.validation, used.test), (8, 2, 2));
        assert!(enough.is_empty(), "{enough:?}");
        let (used, few) = messages(&[Some(Split::Validation), None, None, None], fractions(0.0, 0.2));
        assert_eq!((used.train, used.validation, used.test), (2, 1, 1));
        assert!(
            few[0].starts_with("only 1 pair is held out") && few[1].starts_with("only 2 pairs are left"),
            "{few:?}"
        );
        let (_, none) = messages(&[None; 12], fractions(0.0, 0.2));
        assert!(none.len() == 1 && none[0].starts_with("no pair is held out for validation"), "{none:?}");
    }
}
