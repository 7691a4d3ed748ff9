//! The verdict on each photograph: whether it is of its pattern.

use super::{Saved, Shown, bench};
use crate::display_setup::DisplaySetup;
use crate::{JobContext, TaskError};
use lightpath_domain::job::CapturePhotos;
use lightpath_media::captures::identity::{Brightness, Comparison, Details, Expectation, SATURATED_MAX, compare};
use lightpath_media::captures::{CaptureError, Captures, Reconstructor};
use lightpath_media::pictures::Photo;
use lightpath_rigs::Taken;
use serde::{Deserialize, Serialize};

/// Largest part by which the exposure of a frame may differ from the wanted one.
const EXPOSURE_TOLERANCE: f64 = 0.1;
/// Part of saturated pixels above which a photograph is useless, beside the one that the exposure was found with.
const SATURATED_MUCH: f64 = 20.0 * SATURATED_MAX;
/// Correlation with what its pattern should show below which a photograph is in doubt, if others correlate with theirs.
const CORRELATION_NONE: f64 = 0.2;
/// Median correlation of the others from which [`CORRELATION_NONE`] decides.
const CORRELATION_TELLING: f64 = 0.5;
/// Correlation with what another pattern should show from which a photograph may be of that one.
const CORRELATION_OTHER: f64 = 0.6;
/// How much more than its own pattern it must resemble that one. Pictures have features in common, such as a bright middle.
const LEAD: f64 = 0.2;
/// Largest ratio between the light of a photograph and that of the others, for the same exposure: the light beside the picture,
/// which the camera may not see, depends on the pattern.
const LIGHT_RATIO: f64 = 1.8;
/// Displacement by which a photograph may differ from the others \[px of the display\].
const SHIFT_PX: f64 = 1.5;
/// Number of earlier photographs whose details are kept.
const KEPT: usize = 2;

/// What is known of a photograph that was kept.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Evidence {
    /// Correlation with the expectation; `None`: it was not compared.
    pub(super) own: Option<f64>,
    /// Highest correlation with another expectation.
    pub(super) other: Option<f64>,
    shift_px: Option<f64>,
    /// Light for the exposure \[full scale/s\].
    light_per_s: f64,
}

/// Judges the photographs of a job.
pub(super) struct Judge {
    model: Option<Model>,
    names: Vec<String>,
    patterns: Vec<String>,
    /// Details of the latest photographs, with the numbers of their patterns.
    details: Vec<(usize, Details)>,
    evidence: Vec<Evidence>,
    /// The last photograph in doubt, with the number of its pattern.
    doubtful: Option<(usize, Details)>,
    /// Number and time of the last frame.
    last: Option<(u64, i64)>,
}

/// What the patterns should show, where the camera is aligned.
struct Model {
    captures: Captures,
    reconstructor: Reconstructor,
    coarse: Vec<Option<String>>,
}

impl Judge {
    pub(super) fn of(context: &JobContext, spec: &CapturePhotos, display: &DisplaySetup) -> Result<Self, TaskError> {
        let model = match &spec.aligned_by {
            None => None,
            Some(dataset) => {
                let dataset = context.wait(context.store().dataset(dataset))?;
                let captures = Captures::of(&display.declared, &dataset)?;
                let reconstructor = Reconstructor::of(&captures)?;
                Some(Model { captures, reconstructor, coarse: vec![None; spec.patterns.len()] })
            }
        };
        let (names, patterns) = spec.patterns.iter().map(|named| (named.id.clone(), named.pattern.clone())).unzip();
        Ok(Self { model, names, patterns, details: Vec::new(), evidence: Vec::new(), doubtful: None, last: None })
    }

    /// Takes over what an earlier attempt has kept.
    pub(super) fn remember(&mut self, context: &JobContext, saved: &Saved) -> Result<(), TaskError> {
        self.evidence.clone_from(&saved.evidence);
        self.last = saved.result.photos.last().map(|photo| (photo.frame, photo.exposure_time_ms));
        let count = saved.result.photos.len();
        for (index, photo) in saved.result.photos.iter().enumerate().skip(count.saturating_sub(KEPT)) {
            let file = context.read_artifact(&photo.photo)?;
            self.details.push((index, Details::of(&bench::photo(&file)?.light)));
        }
        Ok(())
    }

    /// The evidence that a photograph is of pattern `index`, or what is wrong with it, for people.
    pub(super) fn verdict(
        &mut self,
        context: &JobContext,
        index: usize,
        (shown, exposure_s): (&Shown, f64),
        taken: &Taken,
        (photo, brightness): (Photo, Brightness),
    ) -> Result<Result<Evidence, String>, TaskError> {
        if let Some(reason) = self.by_the_rig(shown, exposure_s, taken) {
            return Ok(Err(reason));
        }
        if brightness.is_black() {
            return Ok(Err("is black".to_owned()));
        }
        if brightness.saturated > SATURATED_MUCH {
            return Ok(Err(format!("has {:.1} % saturated pixels", 100.0 * brightness.saturated)));
        }
        let details = Details::of(&photo.light);
        if let Some(reason) = self.as_before(index, &details) {
            return Ok(Err(reason));
        }
        let mut evidence = Evidence { light_per_s: brightness.light / exposure_s, ..Evidence::default() };
        let mut doubt = self.by_its_light(evidence.light_per_s);
        if let Some(comparison) = self.compared(context, index, photo)? {
            if let Some(reason) = self.as_another(&comparison).or_else(|| self.by_its_place(&comparison)) {
                return Ok(Err(reason));
            }
            doubt = doubt.or_else(|| self.by_expectation(&comparison));
            let Comparison { own, other, shift_px } = comparison;
            evidence = Evidence { own: Some(own), other: other.map(|(_, other)| other), shift_px, ..evidence };
        }
        if let Some(reason) = doubt
            && !self.repeats(index, &details)
        {
            return Ok(Err(reason));
        }
        self.details.push((index, details));
        if self.details.len() > KEPT {
            self.details.remove(0);
        }
        self.evidence.push(evidence);
        self.last = Some((taken.frame, taken.exposure_time_ms));
        Ok(Ok(evidence))
    }

    /// What the rig itself says against a photograph.
    fn by_the_rig(&self, shown: &Shown, exposure_s: f64, taken: &Taken) -> Option<String> {
        if taken.levels_sha256 != shown.levels_sha256 {
            return Some(
                "shows other levels than those of its pattern: the SLM did not show what it was sent".to_owned(),
            );
        }
        if (taken.exposure_s / exposure_s - 1.0).abs() > EXPOSURE_TOLERANCE {
            return Some(format!("was exposed for {:.2e} s instead of {exposure_s:.2e} s", taken.exposure_s));
        }
        match self.last {
            Some((frame, time_ms)) if taken.frame == frame && taken.exposure_time_ms <= time_ms => {
                Some(format!("is frame {frame} again"))
            }
            _ => None,
        }
    }

    /// Whether the photograph has another light than the others, as when it was exposed for another time.
    fn by_its_light(&self, light_per_s: f64) -> Option<String> {
        let ratio = light_per_s / self.median(|evidence| Some(evidence.light_per_s))?;
        let is_usual = (1.0 / LIGHT_RATIO..=LIGHT_RATIO).contains(&ratio);
        (!is_usual).then(|| format!("has {ratio:.2} times the light of the others"))
    }

    /// Whether the photograph, or a part of it, shows an earlier pattern.
    fn as_before(&self, index: usize, details: &Details) -> Option<String> {
        let mut others = self.details.iter().rev().filter(|(other, _)| self.patterns[*other] != self.patterns[index]);
        others.find_map(|(other, before)| {
            let (same, all) = details.strips_as_in(before);
            let name = &self.names[*other];
            match same {
                0 => None,
                same if same == all => Some(format!("shows pattern \"{name}\" again")),
                same => Some(format!("shows pattern \"{name}\" in {same} of {all} strips of rows")),
            }
        })
    }

    fn compared(&mut self, context: &JobContext, index: usize, photo: Photo) -> Result<Option<Comparison>, TaskError> {
        if self.model.is_none() {
            return Ok(None);
        }
        // The patterns before, and the next two: a camera or a display that is ahead by more is not known.
        for each in index.saturating_sub(1)..(index + 3).min(self.patterns.len()) {
            self.expect(context, each)?;
        }
        let own = self.expectation(context, index)?;
        let Some(model) = &self.model else { return Ok(None) };
        let others = model.coarse.iter().enumerate().filter(|(other, _)| self.patterns[*other] != self.patterns[index]);
        let others = others.filter_map(|(other, coarse)| Some((other, coarse.as_deref()?)));
        Ok(own.map(|own| compare(&model.captures, photo, &own, others)).transpose()?)
    }

    /// Computes what a pattern should show on a coarse grid, unless that is known.
    fn expect(&mut self, context: &JobContext, index: usize) -> Result<(), TaskError> {
        if self.model.as_ref().is_some_and(|model| model.coarse[index].is_some()) {
            return Ok(());
        }
        let coarse = self.expectation(context, index)?.map(|expectation| expectation.coarse().to_owned());
        if let Some(model) = &mut self.model {
            model.coarse[index] = coarse;
        }
        Ok(())
    }

    fn expectation(&self, context: &JobContext, index: usize) -> Result<Option<Expectation>, TaskError> {
        let Some(Model { captures, reconstructor, .. }) = &self.model else { return Ok(None) };
        let file = context.read_artifact(&self.patterns[index])?;
        let of: Result<Expectation, CaptureError> = Expectation::of(captures, reconstructor, &file);
        Ok(Some(of?))
    }

    /// Whether the photograph is rather of another pattern.
    fn as_another(&self, comparison: &Comparison) -> Option<String> {
        let Comparison { own, other, .. } = *comparison;
        let (index, other) = other.filter(|(_, other)| *other > (own + LEAD).max(CORRELATION_OTHER))?;
        let name = &self.names[index];
        Some(format!("resembles pattern \"{name}\" ({other:.2}) more than its own ({own:.2})"))
    }

    /// Whether the photograph is displaced. A camera that was moved needs a new alignment.
    fn by_its_place(&self, comparison: &Comparison) -> Option<String> {
        let usual_px = self.median(|evidence| evidence.shift_px).unwrap_or(SHIFT_PX);
        let shift_px = comparison.shift_px.filter(|shift_px| *shift_px > usual_px + SHIFT_PX)?;
        Some(format!("is displaced by {shift_px:.1} px"))
    }

    /// What the expectation of its pattern says against a photograph.
    fn by_expectation(&self, comparison: &Comparison) -> Option<String> {
        let (own, usual) = (comparison.own, self.median(|evidence| evidence.own)?);
        (own < CORRELATION_NONE && usual > CORRELATION_TELLING)
            .then(|| format!("does not resemble what its pattern should show (correlation {own:.2})"))
    }

    /// Whether a photograph in doubt shows the same as the one in doubt before, of the same pattern. Then it is what the
    /// display shows, which may be far from ideal, and counts: no fault of a camera comes twice in the same way.
    fn repeats(&mut self, index: usize, details: &Details) -> bool {
        let before = self.doubtful.replace((index, details.clone())).filter(|(of, _)| *of == index);
        before.is_some_and(|(_, before)| {
            let (same, all) = details.strips_as_in(&before);
            same == all
        })
    }

    /// Median of a measure over the photographs that were kept; `None`: there is none.
    fn median(&self, measure: impl Fn(&Evidence) -> Option<f64>) -> Option<f64> {
        let mut values: Vec<f64> = self.evidence.iter().filter_map(measure).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    }
}
