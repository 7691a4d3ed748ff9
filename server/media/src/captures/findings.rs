//! What the checks mean, pair beside pair.
//!
//! A photograph of another hologram is told by comparison. Correlations with the ideal display's reconstruction are never
//! perfect, since the display is not, and pictures have much in common: bright middles, horizons, the source's own profile.
//! So what all pairs have in common is taken off first, where there are enough of them, and a photograph must then be more
//! like its own reconstruction than chance would have it.

use super::fingerprint::{self, Compared};
use super::{DISTORTION_PX_MAX, MISALIGNMENT_PX_MAX};
use lightpath_domain::dataset::{Dataset, Finding, FindingKind, Pair, PairChecks};

/// A photograph whose brightest light is below this part of full scale is black.
const BLACK: f64 = 0.01;
/// Parts of the pixels.
const SATURATED_SOME: f64 = 0.01;
const SATURATED_MOST: f64 = 0.5;
const BLACK_CLIPPED: f64 = 0.25;
/// Standard deviation over mean.
const CONTRAST_LOW: f64 = 0.15;
const CONTRAST_NONE: f64 = 0.005;
/// A photograph that is this much like its own reconstruction shows it, whatever else.
const CORRELATION_SURE: f64 = 0.85;
/// A photograph this much more like another pair's reconstruction than like its own shows the other one.
const CORRELATION_LEAD: f64 = 0.15;
/// Below this, and below [`CORRELATION_PART`] of the median of all pairs, it shows nothing of its hologram.
const CORRELATION_MIN: f64 = 0.5;
const CORRELATION_PART: f64 = 0.6;
/// Below this it does not, whatever the other pairs do.
const CORRELATION_NONE: f64 = 0.2;
/// Fewest pairs that tell what all have in common.
const COMMON_MIN: usize = 4;
const VIGNETTING: f64 = 0.4;
/// Pairs that each one is compared with, at most: the first ones.
const COMPARED_MAX: usize = 500;

/// What should be known about the dataset, in the order of the pairs, then what concerns all of it.
#[must_use]
pub fn findings(dataset: &Dataset) -> Vec<Finding> {
    let beside = Beside::of(dataset);
    let mut all: Vec<Finding> = (0..beside.checked.len()).flat_map(|index| beside.findings(index)).collect();
    all.extend(of_dataset(dataset, &beside.checked));
    all
}

/// What should be known about one of the pairs, beside all others, then what concerns all of the dataset.
#[must_use]
pub fn findings_with(dataset: &Dataset, pair: &str) -> Vec<Finding> {
    let beside = Beside::of(dataset);
    let index = beside.checked.iter().position(|(checked, _)| checked.id == pair);
    let mut all = index.map(|index| beside.findings(index)).unwrap_or_default();
    all.extend(of_dataset(dataset, &beside.checked));
    all
}

/// The pairs that were checked, ready to be compared.
struct Beside<'a> {
    checked: Vec<(&'a Pair, &'a PairChecks)>,
    /// What the pairs' photographs, and the first pairs' reconstructions, look like, without what all have in common.
    seen: Vec<Option<Compared>>,
    expected: Vec<Option<Compared>>,
    /// Of each pair's photograph with its own reconstruction.
    own: Vec<Option<f64>>,
    median: f64,
}

impl<'a> Beside<'a> {
    fn of(dataset: &'a Dataset) -> Self {
        let checked: Vec<(&Pair, &PairChecks)> =
            dataset.pairs.iter().filter_map(|pair| Some((pair, pair.checks.as_ref()?))).collect();
        let seen = fingerprint::compared(checked.iter().map(|(_, checks)| checks.seen.as_str()), COMMON_MIN);
        let expected = fingerprint::compared(checked.iter().map(|(_, checks)| checks.expected.as_str()), COMMON_MIN);
        let own: Vec<Option<f64>> =
            seen.iter().zip(&expected).map(|(seen, expected)| seen.as_ref()?.correlation(expected.as_ref()?)).collect();
        let median = median(own.iter().flatten().copied()).unwrap_or(0.0);
        Self { checked, seen, expected, own, median }
    }

    fn findings(&self, index: usize) -> Vec<Finding> {
        let (pair, checks) = self.checked[index];
        let mut all = Vec::new();
        let mut add = |kind, excludes, message: String| {
            all.push(Finding { pair: pair.id.clone(), kind, excludes, message });
        };
        of_light(checks, &mut add);
        of_copies(&self.checked[..index], checks, &mut add);
        if let Some(message) = self.wrong_hologram(index) {
            add(FindingKind::WrongHologram, true, message);
        }
        all
    }

    fn wrong_hologram(&self, index: usize) -> Option<String> {
        let (_, checks) = self.checked[index];
        let (raw, own) = (checks.correlation?, self.own[index]?);
        // Alike enough, so that the others, of which there may be many, say nothing new.
        if raw >= CORRELATION_SURE || own >= CORRELATION_MIN.max(CORRELATION_PART * self.median) {
            return None;
        }
        let seen = self.seen[index].as_ref()?;
        let correlation = |(i, expected): (usize, &Option<Compared>)| {
            let correlation = seen.correlation(expected.as_ref()?)?;
            (i != index).then_some((&self.checked[i].0.id, correlation))
        };
        let others = self.expected.iter().enumerate().take(COMPARED_MAX);
        let best = others.filter_map(correlation).max_by(|a, b| a.1.total_cmp(&b.1));
        let shows = format!("correlates {own:.2} with its hologram");
        if let Some((other, correlation)) = best
            && correlation > own + CORRELATION_LEAD
            && correlation > CORRELATION_MIN
        {
            return Some(format!("{shows}, but {correlation:.2} with that of pair \"{other}\""));
        }
        if own < CORRELATION_MIN && own < CORRELATION_PART * self.median {
            return Some(format!("{shows}, where other pairs correlate {:.2}", self.median));
        }
        // Where all are wrong there is no other to compare with.
        (own < CORRELATION_NONE).then_some(shows)
    }
}

/// Why nothing can be learned from the dataset; `None`: something can.
#[must_use]
pub fn refusal(dataset: &Dataset, findings: &[Finding]) -> Option<String> {
    let id = &dataset.id;
    if dataset.pairs.is_empty() {
        return Some(format!("datasets/{id} has no pairs; add some: lightpath dataset add --help"));
    }
    let excluded = |kind: Option<FindingKind>| {
        let of_kind = |finding: &&Finding| finding.excludes && kind.is_none_or(|kind| kind == finding.kind);
        let mut pairs: Vec<&str> = findings.iter().filter(of_kind).map(|finding| finding.pair.as_str()).collect();
        pairs.dedup();
        pairs.len()
    };
    let count = dataset.pairs.len();
    if 2 * excluded(None) <= count {
        return None;
    }
    let (kind, most) = [
        (
            FindingKind::WrongHologram,
            "show other holograms than theirs: are files and ids matched, is the image upright, or \
         does the dataset need an alignment (lightpath dataset align --help)?",
        ),
        (FindingKind::Black, "are black: expose the camera longer, or check black_level"),
        (FindingKind::Saturated, "are saturated at most pixels: expose the camera less"),
        (FindingKind::LowContrast, "are even grey: is the hologram displayed, and the camera in focus?"),
        (FindingKind::Duplicate, "are copies of others: photograph every hologram once"),
    ]
    .into_iter()
    .max_by_key(|(kind, _)| excluded(Some(*kind)))?;
    let faulty = excluded(Some(kind));
    let first = findings.iter().find(|finding| finding.excludes && finding.kind == kind);
    let example = first.map(|finding| format!("; for example pair \"{}\" {}", finding.pair, finding.message));
    Some(format!("{faulty} of {count} photographs of datasets/{id} {most}{}", example.unwrap_or_default()))
}

fn of_light(checks: &PairChecks, add: &mut impl FnMut(FindingKind, bool, String)) {
    let percent = |part: f64| format!("{:.1} %", 100.0 * part);
    if checks.brightest < BLACK {
        let brightest = percent(checks.brightest.max(0.0));
        add(FindingKind::Black, true, format!("is black: its brightest light is {brightest} of full scale"));
        return;
    }
    if checks.saturated > SATURATED_SOME {
        let excludes = checks.saturated > SATURATED_MOST;
        let saturated = percent(checks.saturated);
        add(FindingKind::Saturated, excludes, format!("is saturated, or not shown, at {saturated} of its pixels"));
    }
    if checks.black > BLACK_CLIPPED {
        add(
            FindingKind::BlackClipped,
            false,
            format!("is cut off at black at {} of its pixels", percent(checks.black)),
        );
    }
    if checks.contrast < CONTRAST_LOW && checks.saturated <= SATURATED_MOST {
        let excludes = checks.contrast < CONTRAST_NONE;
        add(FindingKind::LowContrast, excludes, format!("has a contrast of {:.3} only", checks.contrast));
    }
}

fn of_copies(before: &[(&Pair, &PairChecks)], checks: &PairChecks, add: &mut impl FnMut(FindingKind, bool, String)) {
    let same = |of: fn(&PairChecks) -> &str| before.iter().find(|(_, other)| of(other) == of(checks));
    if let Some((other, _)) = same(|checks| &checks.photo_values) {
        add(FindingKind::Duplicate, true, format!("has the same photograph as pair \"{}\"", other.id));
    } else if let Some((other, _)) = same(|checks| &checks.phase_values) {
        add(FindingKind::Duplicate, true, format!("has the same hologram as pair \"{}\"", other.id));
    }
}

fn of_dataset(dataset: &Dataset, checked: &[(&Pair, &PairChecks)]) -> Vec<Finding> {
    let whole = |kind, message| Finding { pair: String::new(), kind, excludes: false, message };
    let mut all = Vec::new();
    if let Some([misalignment, distortion]) = misalignment(checked).filter(|found| is_misaligned(Some(*found))) {
        let what = format!(
            "photographs are {misalignment:.2} px off what their holograms should show, {distortion:.2} px of it turn, scale \
             and shear (median of {} pairs); finalizing aligns them unless told not to",
            checked.len()
        );
        all.push(whole(FindingKind::Misaligned, what));
    }
    if let Some(vignetting) = median(checked.iter().filter_map(|(_, checks)| checks.vignetting))
        && vignetting > VIGNETTING
    {
        let percent = 100.0 * vignetting;
        let what = format!(
            "the corners have {percent:.0} % less light than the middle; the display model learns that as source"
        );
        all.push(whole(FindingKind::Vignetting, what));
    }
    let known = dataset.pairs.iter().filter(|pair| pair.exposure.is_known()).count();
    if known > 0 && known < dataset.pairs.len() {
        let what = format!(
            "{known} of {} pairs say how they were exposed; the others are taken for exposed at 1 s and a gain of 1",
            dataset.pairs.len()
        );
        all.push(whole(FindingKind::ExposureUnknown, what));
    }
    all
}

/// Whether the photographs lie so far off that learning would suffer.
#[must_use]
pub fn needs_alignment(dataset: &Dataset) -> bool {
    let checked: Vec<(&Pair, &PairChecks)> =
        dataset.pairs.iter().filter_map(|pair| Some((pair, pair.checks.as_ref()?))).collect();
    is_misaligned(misalignment(&checked))
}

fn is_misaligned(misalignment: Option<[f64; 2]>) -> bool {
    misalignment.is_some_and(|[all, distortion]| all > MISALIGNMENT_PX_MAX || distortion > DISTORTION_PX_MAX)
}

/// Medians of misalignment and distortion \[px\]; `None` where too few pairs tell.
fn misalignment(checked: &[(&Pair, &PairChecks)]) -> Option<[f64; 2]> {
    let both = [
        median(checked.iter().filter_map(|(_, checks)| checks.misalignment_px))?,
        median(checked.iter().filter_map(|(_, checks)| checks.distortion_px))?,
    ];
    Some(both)
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
