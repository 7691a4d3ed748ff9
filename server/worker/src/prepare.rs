//! Preparing a dataset: finding where the camera sees the display's pixels, and closing the dataset for good.
//!
//! A job reads the dataset once and stores what it found when it ends, all at once; see the store's `finish`.

use super::{JobContext, TaskError, TaskOutput};
use lightpath_domain::dataset::{
    Alignment, AlignmentMethod, Dataset, Finalization, Finding, Pair, PairChecks, PreparedDataset, Split, Splits,
    draw_split,
};
use lightpath_domain::display::Display;
use lightpath_domain::job::{
    AlignBy, FailureReason, JobEffect, JobResult, PrepareDataset, PrepareResult, PrepareStep, Progress, SplitCounts,
};
use lightpath_media::captures::{self, CaptureError, Captures, ROUNDS_MAX, Reconstructor, Solved};
use lightpath_optics::Plane;
use lightpath_optics::alignment::PointPair;
use serde::{Deserialize, Serialize};
use std::cell::OnceCell;
use std::collections::BTreeMap;

/// Pairs that an alignment is refined by, at most, and how much memory their pictures may take \[bytes\].
const ALIGNED_BY_MAX: usize = 8;
const ALIGNED_BY_BYTES_MAX: usize = 384 << 20;

const CHECK: &str = "check the photographs";
const READ: &str = "read photographs to align by";
const ALIGN: &str = "align the photographs";

pub(super) fn run(context: &JobContext, spec: &PrepareDataset) -> Result<TaskOutput, TaskError> {
    let dataset = context.wait(context.store().dataset(&spec.dataset))?;
    if let Some(before) = dataset.finalization {
        return match spec.step {
            PrepareStep::Finalize(wanted) if wanted == before => finalized_before(context, dataset),
            _ => Err(already_finalized(&dataset.id)),
        };
    }
    let mut work = Work::begin(context, dataset)?;
    let closing = match &spec.step {
        PrepareStep::Align(by) => {
            work.align(by)?;
            None
        }
        PrepareStep::Finalize(finalization) => {
            work.make_ready(finalization.keep_alignment)?;
            Some(*finalization)
        }
    };
    work.output(closing)
}

/// The same dataset finalized in the same way again changes nothing.
fn finalized_before(context: &JobContext, dataset: Dataset) -> Result<TaskOutput, TaskError> {
    let pairs = dataset.pairs.len() as u32;
    context.report(progress(CHECK, pairs, pairs))?;
    let splits = counts(dataset.pairs.iter().map(|pair| pair.split));
    let result = PrepareResult {
        alignment: dataset.alignment,
        findings: dataset.findings,
        dataset_digest: dataset.digest,
        splits,
    };
    Ok(TaskOutput { result: JobResult::Prepare(result), effect: JobEffect::None })
}

fn already_finalized(id: &str) -> TaskError {
    let message =
        format!("datasets/{id} is finalized already, with another split or alignment; create another dataset");
    TaskError::permanent(FailureReason::DatasetFinalized, message)
}

/// What an interrupted attempt leaves to the next one.
#[derive(Serialize, Deserialize)]
struct Saved {
    revision: u64,
    aligned: bool,
    alignment: Option<Alignment>,
    checks: BTreeMap<String, PairChecks>,
}

/// A dataset on its way to what the job was asked for.
struct Work<'a> {
    context: &'a JobContext,
    display: Display,
    /// As it will be.
    dataset: Dataset,
    /// Measured again, by the ids of the pairs.
    checks: BTreeMap<String, PairChecks>,
    /// The alignment has been decided.
    aligned: bool,
    /// Made when a pair is first looked at; `None` where no image can be computed at the dataset's distance.
    reconstructor: OnceCell<Option<Reconstructor>>,
}

impl<'a> Work<'a> {
    /// Goes on where an earlier attempt was, where the dataset is still the same, or starts.
    fn begin(context: &'a JobContext, dataset: Dataset) -> Result<Self, TaskError> {
        let (display, _) = context.wait(context.store().display(&dataset.display))?;
        let (checks, reconstructor) = (BTreeMap::new(), OnceCell::new());
        let mut work = Self { context, display, dataset, checks, aligned: false, reconstructor };
        let saved = context.take_saved_state().and_then(|bytes| serde_json::from_slice::<Saved>(&bytes).ok());
        if let Some(saved) = saved.filter(|saved| saved.revision == work.dataset.revision) {
            for pair in &mut work.dataset.pairs {
                if let Some(checks) = saved.checks.get(&pair.id) {
                    pair.checks = Some(checks.clone());
                }
            }
            (work.checks, work.aligned) = (saved.checks, saved.aligned);
            if work.aligned {
                work.dataset.alignment = saved.alignment;
            }
        }
        Ok(work)
    }

    /// Gives the dataset the alignment that was asked for.
    fn align(&mut self, by: &AlignBy) -> Result<(), TaskError> {
        if !self.aligned {
            let alignment = match by {
                AlignBy::Points { photo_width_px, photo_height_px, points } => {
                    Some(self.by_points(points, [*photo_width_px, *photo_height_px])?)
                }
                AlignBy::Dots { photo } => Some(self.by_dots(photo)?),
                AlignBy::Pairs => {
                    self.check_again()?;
                    Some(self.by_pairs()?.ok_or_else(|| not_alignable(&self.dataset.id))?)
                }
                AlignBy::None => None,
            };
            self.expect_sizes(alignment.as_ref())?;
            self.decide(alignment);
        }
        self.check_again()
    }

    /// Measures what is not measured yet, and aligns the photographs where they need it and it helps.
    fn make_ready(&mut self, keep_alignment: bool) -> Result<(), TaskError> {
        self.check_again()?;
        if !self.aligned && !keep_alignment && captures::needs_alignment(&self.dataset) {
            if let Some(alignment) = self.by_pairs()? {
                self.decide(Some(alignment));
            }
            return self.check_again();
        }
        Ok(())
    }

    fn decide(&mut self, alignment: Option<Alignment>) {
        self.dataset.alignment = alignment;
        self.aligned = true;
    }

    /// Measures again what was measured with another alignment, or not at all.
    fn check_again(&mut self) -> Result<(), TaskError> {
        let homography = self.dataset.homography();
        let captures = Captures::of(&self.display, &self.dataset)?;
        let is_current = |pair: &Pair| pair.checks.as_ref().is_some_and(|checks| checks.homography == homography);
        let stale: Vec<usize> =
            (0..self.dataset.pairs.len()).filter(|&index| !is_current(&self.dataset.pairs[index])).collect();
        for (done, &index) in stale.iter().enumerate() {
            self.step(CHECK, done, stale.len())?;
            let pair = &self.dataset.pairs[index];
            let (phase, photo) = (self.context.read_artifact(&pair.phase)?, self.context.read_artifact(&pair.photo)?);
            let checks = captures::check(&captures, self.reconstructor(&captures), pair, &phase, &photo)
                .map_err(|error| unreadable(&pair.id, &error))?;
            self.checks.insert(pair.id.clone(), checks.clone());
            self.dataset.pairs[index].checks = Some(checks);
        }
        self.step(CHECK, stale.len(), stale.len())
    }

    /// The alignment that given points make.
    fn by_points(&self, points: &[PointPair], photo_px: [u32; 2]) -> Result<Alignment, TaskError> {
        let solved = captures::from_points(&Captures::of(&self.display, &self.dataset)?, points)?;
        self.kept(AlignmentMethod::Points, solved, photo_px, String::new())
    }

    /// The alignment that the photograph of the displayed dots shows.
    fn by_dots(&self, digest: &str) -> Result<Alignment, TaskError> {
        self.step(ALIGN, 0, 1)?;
        let captures = Captures::of(&self.display, &self.dataset)?;
        let file = self.context.read_artifact(digest)?;
        let refused = |error: CaptureError| {
            TaskError::permanent(
                FailureReason::InvalidPicture,
                format!("the photograph of the dots ({digest}): {error}"),
            )
        };
        let photo = captures.camera(&Pair::default(), &file).map_err(refused)?;
        let solved = captures::from_dots(&captures, &photo).map_err(refused)?;
        let size = [photo.width_px() as u32, photo.height_px() as u32];
        self.kept(AlignmentMethod::Dots, solved, size, digest.to_owned())
    }

    /// The alignment that the pairs' photographs ask for; `None` where they tell too little, or are aligned as well as that
    /// can be told.
    fn by_pairs(&self) -> Result<Option<Alignment>, TaskError> {
        let findings = captures::findings(&self.dataset);
        let good: Vec<&Pair> = self.dataset.pairs.iter().filter(|pair| !is_excluded(&findings, &pair.id)).collect();
        let Some(size) = good.first().and_then(|pair| pair.checks.as_ref()).map(|checks| checks.photo_px) else {
            return Ok(None);
        };
        let captures = Captures::of(&self.display, &self.dataset)?;
        let Some(reconstructor) = self.reconstructor(&captures) else { return Ok(None) };
        let display_px = captures.height_px() * captures.width_px();
        let pair_bytes = size_of::<f32>() * (display_px + size[0] as usize * size[1] as usize);
        let count = (ALIGNED_BY_BYTES_MAX / pair_bytes).clamp(1, ALIGNED_BY_MAX).min(good.len());
        let mut seen: Vec<(Plane<f32>, Plane<f32>)> = Vec::with_capacity(count);
        // Evenly over all, since neighbours may be alike.
        for pair in (0..count).map(|i| good[i * good.len() / count]) {
            self.step(READ, seen.len(), count)?;
            let phase = captures.phase(&self.context.read_artifact(&pair.phase)?);
            let photo = captures.camera(pair, &self.context.read_artifact(&pair.photo)?);
            let named = |error| unreadable(&pair.id, &error);
            seen.push((reconstructor.light(&phase.map_err(named)?)?, photo.map_err(named)?));
        }
        let solved = captures::from_pairs(&captures, &seen, |done| self.step(ALIGN, done, ROUNDS_MAX * count))?;
        solved.map(|solved| self.kept(AlignmentMethod::Pairs, solved, size, String::new())).transpose()
    }

    fn reconstructor(&self, captures: &Captures) -> Option<&Reconstructor> {
        self.reconstructor.get_or_init(|| Reconstructor::of(captures).ok()).as_ref()
    }

    /// An alignment with its pictures stored.
    fn kept(
        &self,
        method: AlignmentMethod,
        solved: Solved,
        [photo_width_px, photo_height_px]: [u32; 2],
        photo: String,
    ) -> Result<Alignment, TaskError> {
        let stored = |picture: Vec<u8>| match picture.is_empty() {
            true => Ok(String::new()),
            false => self.context.put_artifact(picture),
        };
        Ok(Alignment {
            method,
            homography: solved.homography.entries(),
            photo_height_px,
            photo_width_px,
            points: solved.points as u32,
            residual_px: solved.residual_px,
            corrected_px: solved.corrected_px,
            photo,
            before: stored(solved.before)?,
            after: stored(solved.after)?,
        })
    }

    /// The photographs that are there must fit the new alignment.
    fn expect_sizes(&self, alignment: Option<&Alignment>) -> Result<(), TaskError> {
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
                    "pair \"{}\" has a photograph of {width}×{height} px, but the alignment is for {}×{} px; align with \
                     photographs of the size that the dataset has",
                    pair.id, expected[0], expected[1]
                );
                Err(TaskError::permanent(FailureReason::AlignmentSize, message))
            }
        }
    }

    /// Tells how far the work is, and stops where it must.
    fn step(&self, stage: &str, done: usize, total: usize) -> Result<(), TaskError> {
        self.context.step(progress(stage, done as u32, total as u32), || {
            let saved = Saved {
                revision: self.dataset.revision,
                aligned: self.aligned,
                alignment: self.dataset.alignment.clone(),
                checks: self.checks.clone(),
            };
            // All of it was JSON before; an empty state starts over.
            serde_json::to_vec(&saved).unwrap_or_default()
        })
    }

    /// What is stored, where the dataset is still the same.
    fn output(self, closing: Option<Finalization>) -> Result<TaskOutput, TaskError> {
        let findings = captures::findings(&self.dataset);
        let closing = match closing {
            None => None,
            Some(finalization) => Some((finalization, splits(&self.dataset, &findings, finalization)?)),
        };
        let splits = closing.iter().flat_map(|(_, splits)| splits.iter().map(|(_, split)| *split));
        let result = PrepareResult {
            alignment: self.dataset.alignment.clone(),
            findings: findings.clone(),
            dataset_digest: None,
            splits: counts(splits),
        };
        let prepared = PreparedDataset {
            dataset: self.dataset.id,
            revision: self.dataset.revision,
            alignment: self.dataset.alignment,
            checks: self.checks,
            findings,
            closing,
        };
        Ok(TaskOutput { result: JobResult::Prepare(result), effect: JobEffect::Dataset(Box::new(prepared)) })
    }
}

fn progress(stage: &str, step: u32, steps_total: u32) -> Progress {
    Progress { stage: stage.to_owned(), step, steps_total, loss: 0.0, eta_s: None }
}

/// What each pair is for: those that can't be learned from have no split.
fn splits(dataset: &Dataset, findings: &[Finding], how: Finalization) -> Result<Splits, TaskError> {
    if let Some(message) = captures::refusal(dataset, findings) {
        return Err(TaskError::permanent(FailureReason::DatasetUnusable, message));
    }
    let (left_out, good): (Vec<Pair>, Vec<Pair>) =
        dataset.pairs.iter().cloned().partition(|pair| is_excluded(findings, &pair.id));
    let drawn = draw_split(&good, how.validation_fraction, how.test_fraction, how.seed);
    let mut splits: Splits = drawn
        .into_iter()
        .map(|(id, split)| (id, Some(split)))
        .chain(left_out.into_iter().map(|pair| (pair.id, None)))
        .collect();
    splits.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(splits)
}

fn is_excluded(findings: &[Finding], pair: &str) -> bool {
    findings.iter().any(|finding| finding.excludes && finding.pair == pair)
}

fn counts(splits: impl Iterator<Item = Option<Split>>) -> SplitCounts {
    let mut counts = SplitCounts::default();
    for split in splits {
        *match split {
            Some(Split::Train) => &mut counts.train,
            Some(Split::Validation) => &mut counts.validation,
            Some(Split::Test) => &mut counts.test,
            None => &mut counts.left_out,
        } += 1;
    }
    counts
}

fn unreadable(pair: &str, error: &CaptureError) -> TaskError {
    TaskError::permanent(FailureReason::DatasetUnreadable, format!("pair \"{pair}\": {error}"))
}

fn not_alignable(id: &str) -> TaskError {
    let message = format!(
        "the pairs of datasets/{id} say too little about their alignment: add some with fine structure, or photograph the \
         displayed dots (lightpath dataset calibration --help)"
    );
    TaskError::permanent(FailureReason::NotAlignable, message)
}
