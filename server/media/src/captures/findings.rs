//! Findings about a dataset, from the measurements of all its pairs.
//!
//! A photograph of another hologram is found by comparing correlations. The correlation of a photograph with the
//! reconstruction on the ideal display is never 1, because a real display is not ideal. Correlations between different
//! pictures are not 0 either, because pictures have features in common: a bright middle, a horizon, the profile of the
//! source. If the dataset has enough pairs, the mean over all pairs is therefore subtracted first. A photograph must
//! then correlate with its own reconstruction more than by chance.

use super::fingerprint::{self, Normalized};
use super::{SHIFT_PX_MAX, STRETCH_PX_MAX, TURN_PX_MAX};
use crate::pictures::SATURATION;
use lightpath_domain::dataset::{Dataset, Finding, FindingKind, LargestValue, Pair, PairChecks};
use std::collections::HashSet;

/// Light of black photographs: the brightest light is below this fraction of full scale.
const BLACK: f64 = 0.01;
/// Fraction of saturated pixels above which a photograph gets a finding.
const SATURATED_SOME: f64 = 0.01;
/// Fraction of saturated pixels above which a photograph is excluded.
const SATURATED_MOST: f64 = 0.5;
/// Fraction of pixels with exactly the largest value above which a photograph may be clipped.
const CLIPPED: f64 = 0.001;
/// Bits of cameras whose photographs are stored in files of 16 bits.
const CAMERA_BITS: [u32; 3] = [10, 12, 14];
/// Fraction of black pixels above which a photograph gets a finding.
const BLACK_CLIPPED: f64 = 0.25;
/// Contrast (standard deviation divided by mean) below which a photograph gets a finding.
const CONTRAST_LOW: f64 = 0.15;
/// Contrast below which a photograph is excluded.
const CONTRAST_NONE: f64 = 0.005;
/// Correlation with its own reconstruction above which a photograph certainly shows its hologram.
const CORRELATION_SURE: f64 = 0.85;
/// Difference of correlations above which a photograph shows the hologram of another pair: its correlation with the
/// other reconstruction minus that with its own.
const CORRELATION_LEAD: f64 = 0.15;
/// Correlation below which a photograph does not show its hologram, if it is also below [`CORRELATION_PART`] times the
/// median over all pairs.
const CORRELATION_MIN: f64 = 0.5;
/// Factor of the median for [`CORRELATION_MIN`].
const CORRELATION_PART: f64 = 0.6;
/// Median from which the ideal display explains the photographs so well that [`CORRELATION_PART`] decides. Below it the
/// display is far from ideal, and good photographs scatter as widely; then learning decides, with a display that it
/// fitted.
const CORRELATION_TELLING: f64 = 0.75;
/// Correlation below which a photograph does not show its hologram, for any median.
const CORRELATION_NONE: f64 = 0.2;
/// Smallest number of pairs from which the common features of all pairs are computed.
const COMMON_MIN: usize = 4;
/// Displacement by scale and shear above which the dataset gets a finding \[px\].
const STRETCH_PX_SOME: f64 = 0.35;
/// Loss of light in the corners above which the dataset gets a finding.
const VIGNETTING: f64 = 0.4;
/// Largest number of pairs with which each pair is compared. The first pairs are used.
const COMPARED_MAX: usize = 500;

/// Findings about all pairs, in the order of the pairs, followed by findings about the whole dataset.
#[must_use]
pub fn findings(dataset: &Dataset) -> Vec<Finding> {
    let checked = CheckedPairs::of(dataset);
    let mut findings: Vec<Finding> = (0..checked.pairs.len()).flat_map(|index| checked.findings(index)).collect();
    findings.extend(dataset_findings(dataset, &checked.pairs));
    findings
}

/// Findings about some pairs, each compared with all others, followed by findings about the whole dataset.
#[must_use]
pub fn findings_with(dataset: &Dataset, pairs: &HashSet<String>) -> Vec<Finding> {
    let checked = CheckedPairs::of(dataset);
    let wanted = (0..checked.pairs.len()).filter(|index| pairs.contains(&checked.pairs[*index].0.id));
    let mut findings: Vec<Finding> = wanted.flat_map(|index| checked.findings(index)).collect();
    findings.extend(dataset_findings(dataset, &checked.pairs));
    findings
}

/// The pairs that have measurements, prepared for comparison.
struct CheckedPairs<'a> {
    pairs: Vec<(&'a Pair, &'a PairChecks)>,
    /// Fingerprints of the photographs, without the features that all have in common.
    seen: Vec<Option<Normalized>>,
    /// Fingerprints of the reconstructions, without the features that all have in common.
    expected: Vec<Option<Normalized>>,
    /// Correlation of each photograph with its own reconstruction.
    own_correlations: Vec<Option<f64>>,
    /// Median of `own_correlations`.
    median: f64,
}

impl<'a> CheckedPairs<'a> {
    fn of(dataset: &'a Dataset) -> Self {
        let pairs = with_checks(dataset);
        let seen = fingerprint::without_common(pairs.iter().map(|(_, checks)| checks.seen.as_str()), COMMON_MIN);
        let expected =
            fingerprint::without_common(pairs.iter().map(|(_, checks)| checks.expected.as_str()), COMMON_MIN);
        let own_correlations: Vec<Option<f64>> =
            seen.iter().zip(&expected).map(|(seen, expected)| seen.as_ref()?.correlation(expected.as_ref()?)).collect();
        let median = median(own_correlations.iter().flatten().copied()).unwrap_or(0.0);
        Self { pairs, seen, expected, own_correlations, median }
    }

    fn findings(&self, index: usize) -> Vec<Finding> {
        let (pair, checks) = self.pairs[index];
        let mut all = Vec::new();
        let mut add = |kind, excludes, message: String| {
            all.push(Finding { pair: pair.id.clone(), kind, excludes, message });
        };
        light_findings(checks, &mut add);
        copy_findings(&self.pairs[..index], checks, &mut add);
        if let Some((message, excludes)) = self.wrong_hologram(index) {
            add(FindingKind::WrongHologram, excludes, message);
        }
        all
    }

    /// Why the photograph of a pair seems to show another hologram, and whether this is certain enough to leave it out.
    fn wrong_hologram(&self, index: usize) -> Option<(String, bool)> {
        let (_, checks) = self.pairs[index];
        let (raw, own) = (checks.correlation?, self.own_correlations[index]?);
        // The photograph is similar enough to its reconstruction. The comparison with all others is not needed.
        if raw >= CORRELATION_SURE || own >= CORRELATION_MIN.max(CORRELATION_PART * self.median) {
            return None;
        }
        let seen = self.seen[index].as_ref()?;
        let correlation = |(i, expected): (usize, &Option<Normalized>)| {
            let correlation = seen.correlation(expected.as_ref()?)?;
            (i != index).then_some((&self.pairs[i].0.id, correlation))
        };
        let others = self.expected.iter().enumerate().take(COMPARED_MAX);
        let best = others.filter_map(correlation).max_by(|a, b| a.1.total_cmp(&b.1));
        let finding = format!("correlates {own:.2} with its hologram");
        if let Some((other, correlation)) = best
            && correlation > own + CORRELATION_LEAD
            && correlation > CORRELATION_MIN
        {
            return Some((format!("{finding}, but {correlation:.2} with the hologram of pair \"{other}\""), true));
        }
        // If most photographs are wrong, the median is low, and only a fixed limit can find them.
        let excludes = own < CORRELATION_NONE || self.median >= CORRELATION_TELLING;
        if own < CORRELATION_MIN && own < CORRELATION_PART * self.median {
            return Some((format!("{finding}; the median of all pairs is {:.2}", self.median), excludes));
        }
        (own < CORRELATION_NONE).then_some((finding, excludes))
    }
}

/// Message that tells why the dataset cannot be used for learning; `None`: it can be used.
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
            "show other holograms than theirs: check that each photograph belongs to its hologram and is upright, or \
             align the dataset (lightpath dataset align --help)",
        ),
        (FindingKind::Black, "are black: expose the camera longer, or check black_level"),
        (FindingKind::Saturated, "are saturated at most pixels: use a shorter exposure"),
        (FindingKind::LowContrast, "are uniformly grey: check that the hologram is displayed and the camera in focus"),
        (FindingKind::Duplicate, "are copies of others: photograph each hologram only once"),
    ]
    .into_iter()
    .max_by_key(|(kind, _)| excluded(Some(*kind)))?;
    let faulty = excluded(Some(kind));
    let first = findings.iter().find(|finding| finding.excludes && finding.kind == kind);
    let example = first.map(|finding| format!("; for example pair \"{}\" {}", finding.pair, finding.message));
    Some(format!("{faulty} of {count} photographs of datasets/{id} {most}{}", example.unwrap_or_default()))
}

fn light_findings(checks: &PairChecks, add: &mut impl FnMut(FindingKind, bool, String)) {
    let percent = |part: f64| format!("{:.1} %", 100.0 * part);
    if checks.brightest < BLACK {
        let brightest = percent(checks.brightest.max(0.0));
        add(FindingKind::Black, true, format!("is black: its brightest light is {brightest} of full scale"));
        return;
    }
    if checks.saturated > SATURATED_SOME {
        let excludes = checks.saturated > SATURATED_MOST;
        let saturated = percent(checks.saturated);
        let message = format!("is saturated, or outside the camera's view, at {saturated} of the pixels");
        add(FindingKind::Saturated, excludes, message);
    }
    if let Some(message) = clipped(checks) {
        add(FindingKind::Clipped, false, message);
    }
    if checks.black > BLACK_CLIPPED {
        add(
            FindingKind::BlackClipped,
            false,
            format!("is at or below the black level at {} of the pixels", percent(checks.black)),
        );
    }
    if checks.contrast < CONTRAST_LOW && checks.saturated <= SATURATED_MOST {
        let excludes = checks.contrast < CONTRAST_NONE;
        add(FindingKind::LowContrast, excludes, format!("has a contrast of only {:.3}", checks.contrast));
    }
}

/// Something clipped the values of a photograph below full scale, such as a camera or a converter with fewer bits: many
/// pixels have the largest value and few lie close below, as no picture has them.
fn clipped(checks: &PairChecks) -> Option<String> {
    let LargestValue { value, full_scale, share, share_below } = checks.largest?;
    let is_clipped = share > CLIPPED && share > share_below && value < f64::from(SATURATION) * full_scale;
    is_clipped.then(|| {
        format!(
            "has its largest value, {value} of {full_scale}, at {:.1} % of the pixels: it seems to be clipped there, but \
             these pixels do not count as saturated; use a shorter exposure, or the camera's full scale",
            100.0 * share
        )
    })
}

/// A question about photographs that have no value above that of fewer bits than their files have.
fn fewer_bits(dataset: &Dataset, checked: &[(&Pair, &PairChecks)]) -> Option<String> {
    let largest: Vec<LargestValue> = checked.iter().filter_map(|(_, checks)| checks.largest).collect();
    if dataset.photo_bit_depth != 0 || largest.iter().any(|largest| largest.full_scale != f64::from(u16::MAX)) {
        return None;
    }
    let value = largest.iter().map(|largest| largest.value).reduce(f64::max)?;
    let most = |bits: u32| f64::from((1_u32 << bits) - 1);
    let reaches = CAMERA_BITS.into_iter().find(|&bits| value == most(bits));
    let below = CAMERA_BITS.into_iter().find(|&bits| value <= most(bits) && bits <= 12);
    let bits = reaches.or(below)?;
    let share = largest.iter().map(|largest| if largest.value == value { largest.share } else { 0.0 }).sum::<f64>();
    Some(format!(
        "the photographs are files of 16 bits, but no value is above {value}, which {:.1} % of the pixels have; 2^{bits} − 1 \
         is {}: does the camera have {bits} bits? Then make the dataset anew with a bit depth of {bits} (lightpath dataset \
         create --photo-bit-depth {bits}), or saturated pixels are taken for light",
        100.0 * share / largest.len() as f64,
        most(bits)
    ))
}

fn copy_findings(
    before: &[(&Pair, &PairChecks)],
    checks: &PairChecks,
    add: &mut impl FnMut(FindingKind, bool, String),
) {
    let same = |of: fn(&PairChecks) -> &str| before.iter().find(|(_, other)| of(other) == of(checks));
    if let Some((other, _)) = same(|checks| &checks.photo_values) {
        add(FindingKind::Duplicate, true, format!("has the same photograph as pair \"{}\"", other.id));
    } else if let Some((other, _)) = same(|checks| &checks.phase_values) {
        add(FindingKind::Duplicate, true, format!("has the same hologram as pair \"{}\"", other.id));
    }
}

fn dataset_findings(dataset: &Dataset, checked: &[(&Pair, &PairChecks)]) -> Vec<Finding> {
    let whole = |kind, message| Finding { pair: String::new(), kind, excludes: false, message };
    let mut all = Vec::new();
    if let Some(displacement) = Displacement::of(checked) {
        all.extend(displacement.findings().map(|(kind, message)| whole(kind, message)));
    }
    all.extend(fewer_bits(dataset, checked).map(|message| whole(FindingKind::FewerBits, message)));
    if let Some(vignetting) = median(checked.iter().filter_map(|(_, checks)| checks.vignetting))
        && vignetting > VIGNETTING
    {
        let percent = 100.0 * vignetting;
        let message = format!(
            "the corners have {percent:.0} % less light than the middle; the models display and varying learn this as \
             the profile of the source"
        );
        all.push(whole(FindingKind::Vignetting, message));
    }
    let known = dataset.pairs.iter().filter(|pair| pair.exposure.is_known()).count();
    if known > 0 && known < dataset.pairs.len() {
        let message = format!(
            "the exposure is known for only {known} of {} pairs; the others count as exposed for 1 s with a gain of 1",
            dataset.pairs.len()
        );
        all.push(whole(FindingKind::ExposureUnknown, message));
    }
    all
}

/// Whether finalizing aligns the photographs, if their registration with all pairs together confirms it.
#[must_use]
pub fn needs_alignment(dataset: &Dataset) -> bool {
    Displacement::of(&with_checks(dataset)).is_some_and(|displacement| displacement.is_misaligned())
}

/// The pairs that have measurements.
fn with_checks(dataset: &Dataset) -> Vec<(&Pair, &PairChecks)> {
    dataset.pairs.iter().filter_map(|pair| Some((pair, pair.checks.as_ref()?))).collect()
}

/// Displacement of the photographs from the reconstructions, as medians over the pairs \[px\].
#[derive(Clone, Copy, Debug)]
struct Displacement {
    pairs: usize,
    shift_px: f64,
    turn_px: f64,
    turn_uncertainty_px: f64,
    stretch_px: f64,
}

impl Displacement {
    /// `None`: it is unknown for all pairs.
    fn of(checked: &[(&Pair, &PairChecks)]) -> Option<Self> {
        let all = |of: fn(&PairChecks) -> Option<f64>| checked.iter().filter_map(move |(_, checks)| of(checks));
        let pairs = all(|checks| checks.turn_px).count();
        Some(Self {
            pairs,
            shift_px: median(all(|checks| checks.shift_px))?,
            turn_px: median(all(|checks| checks.turn_px))?.abs(),
            turn_uncertainty_px: median(all(|checks| checks.turn_uncertainty_px))? / (pairs as f64).sqrt(),
            stretch_px: median(all(|checks| checks.stretch_px))?,
        })
    }

    fn is_turned(&self) -> bool {
        self.turn_px > TURN_PX_MAX.max(self.turn_uncertainty_px)
    }

    fn is_misaligned(&self) -> bool {
        self.is_turned() || self.shift_px > SHIFT_PX_MAX || self.stretch_px > STRETCH_PX_MAX
    }

    fn findings(&self) -> impl Iterator<Item = (FindingKind, String)> + use<> {
        let Self { pairs, shift_px, turn_px, turn_uncertainty_px, stretch_px } = *self;
        let misaligned = self.is_misaligned().then(|| {
            let message = format!(
                "photographs are displaced from their reconstructions: by a shift of {shift_px:.2} px and a turn of \
                 {turn_px:.2} ± {turn_uncertainty_px:.2} px (medians of {pairs} pairs); finalizing corrects them unless \
                 keep_alignment is set"
            );
            (FindingKind::Misaligned, message)
        });
        let stretched = (stretch_px > STRETCH_PX_SOME).then(|| {
            let what = if stretch_px > STRETCH_PX_MAX {
                format!("finalizing takes more than {STRETCH_PX_MAX} px for the camera's and corrects them")
            } else {
                "they are left to learning, which describes them as the phase of the source (models display and varying)"
                    .to_owned()
            };
            let message = format!(
                "{stretch_px:.2} px of scale and shear may be the camera's or the modulator's surface; {what}; if they are the \
                 camera's, align by points of an object of known size in the image plane (lightpath dataset align --points) \
                 or by the pairs (--pairs)"
            );
            (FindingKind::Stretched, message)
        });
        misaligned.into_iter().chain(stretched)
    }
}

fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_domain::dataset::Encoding;
    use lightpath_domain::units::{Distance, Wavelength};
    use std::fmt::Write as _;

    /// Pairs whose photographs have these correlations with their holograms.
    fn dataset(correlations: &[f64]) -> Dataset {
        let (wavelength, distance) = (Wavelength::from_m(515e-9).unwrap(), Distance::from_m(0.05).unwrap());
        let mut dataset = Dataset::empty("d".into(), "bench".into(), wavelength, distance, Encoding::Linear);
        for (i, &correlation) in correlations.iter().enumerate() {
            let noise =
                |j: usize, seed: f64| (43_758.5 * (12.9898 * j as f64 + seed + i as f64).sin()).rem_euclid(1.0) - 0.5;
            let hex = |value: &dyn Fn(usize) -> f64| {
                (0..576).fold(String::new(), |mut text, j| {
                    let _ = write!(text, "{:02x}", (127.0 + 120.0 * value(j)) as u8);
                    text
                })
            };
            let other = (1.0 - correlation * correlation).sqrt();
            let checks = PairChecks {
                brightest: 1.0,
                contrast: 1.0,
                correlation: Some(correlation),
                seen: hex(&|j| correlation * noise(j, 0.0) + other * noise(j, 1000.5)),
                expected: hex(&|j| noise(j, 0.0)),
                photo_values: format!("photo {i}"),
                phase_values: format!("phase {i}"),
                ..PairChecks::default()
            };
            dataset.pairs.push(Pair { id: format!("p{i}"), checks: Some(checks), ..Pair::default() });
        }
        dataset
    }

    /// Kinds of the findings about the whole dataset, and whether it needs an alignment.
    fn displaced(shift_px: f64, turn_px: [f64; 3], stretch_px: f64) -> (Vec<FindingKind>, bool) {
        let mut dataset = dataset(&[0.9; 3]);
        for (pair, turn_px) in dataset.pairs.iter_mut().zip(turn_px) {
            let checks = pair.checks.as_mut().unwrap();
            (checks.shift_px, checks.stretch_px) = (Some(shift_px), Some(stretch_px));
            (checks.turn_px, checks.turn_uncertainty_px) = (Some(turn_px), Some(0.5));
        }
        let all = findings(&dataset).into_iter();
        (all.filter(|finding| finding.pair.is_empty()).map(|finding| finding.kind).collect(), needs_alignment(&dataset))
    }

    #[test]
    fn only_what_is_clearly_the_cameras_needs_an_alignment() {
        use FindingKind::{Misaligned, Stretched};
        assert_eq!(displaced(0.9, [0.1, -0.6, 0.2], 0.2), (vec![], false));
        // Turns of both signs are noise, and scale and shear may be the modulator's.
        assert_eq!(displaced(0.9, [0.6, -0.6, 0.2], 0.9), (vec![Stretched], false));
        assert_eq!(displaced(0.0, [-0.8, -0.7, -0.9], 0.9), (vec![Misaligned, Stretched], true));
        assert_eq!(displaced(1.8, [0.0; 3], 0.0), (vec![Misaligned], true));
        assert_eq!(displaced(0.0, [0.0; 3], STRETCH_PX_MAX + 0.1), (vec![Misaligned, Stretched], true));
    }

    /// Kinds of the findings about three photographs with a largest value, and the message of the last finding.
    fn with_largest(bit_depth: u32, [value, full_scale]: [f64; 2], shares: [f64; 2]) -> (Vec<FindingKind>, String) {
        let mut dataset = dataset(&[0.9; 3]);
        dataset.photo_bit_depth = bit_depth;
        for pair in &mut dataset.pairs {
            let [share, share_below] = shares;
            pair.checks.as_mut().unwrap().largest = Some(LargestValue { value, full_scale, share, share_below });
        }
        let mut all = findings(&dataset);
        all.dedup_by_key(|finding| finding.kind);
        (all.iter().map(|finding| finding.kind).collect(), all.pop().map(|last| last.message).unwrap_or_default())
    }

    #[test]
    fn photographs_that_are_clipped_below_full_scale_are_found() {
        use FindingKind::{Clipped, FewerBits};
        for (bits, most) in [(10, 1023.0), (12, 4095.0), (14, 16383.0)] {
            let (kinds, message) = with_largest(0, [most, 65535.0], [0.05, 0.001]);
            assert_eq!(kinds, [Clipped, FewerBits]);
            assert!(message.contains(&format!("above {most}, which 5.0 % of the pixels have")), "{message}");
            assert!(message.contains(&format!("--photo-bit-depth {bits})")), "{message}");
            // As it should be declared, and with the left-over bits filled.
            assert_eq!(with_largest(bits, [most, most], [0.05, 0.001]).0, []);
            let shifted = most * f64::from(1 << (16 - bits));
            assert_eq!(with_largest(0, [shifted, 65535.0], [0.05, 0.001]).0, []);
        }
        for (value, full_scale) in [(235.0, 255.0), (250.0, 255.0), (4000.0, 4095.0), (0.0625, 1.0)] {
            let (kinds, message) = with_largest(0, [value, full_scale], [0.02, 0.001]);
            assert_eq!(kinds, [Clipped], "{value}");
            assert!(message.contains(&format!("{value} of {full_scale}, at 2.0 % of the pixels")), "{message}");
        }
        // Dark, but not clipped.
        assert_eq!(with_largest(0, [3000.0, 65535.0], [1e-5, 1e-5]).0, [FewerBits]);
    }

    #[test]
    fn photographs_that_use_all_values_have_no_finding_about_their_bits() {
        assert_eq!(with_largest(0, [65535.0, 65535.0], [0.005, 0.0]).0, []);
        assert_eq!(with_largest(0, [5000.0, 65535.0], [1e-5, 1e-4]).0, []);
        assert_eq!(with_largest(0, [208.0, 255.0], [2e-5, 0.0]).0, []);
        // A white wall: many pixels are nearly as bright.
        assert_eq!(with_largest(0, [208.0, 255.0], [0.1, 0.2]).0, []);
    }

    fn wrong(correlations: &[f64]) -> Vec<(String, bool)> {
        let all = findings(&dataset(correlations)).into_iter();
        let wrong = all.filter(|finding| finding.kind == FindingKind::WrongHologram);
        wrong.map(|finding| (finding.pair, finding.excludes)).collect()
    }

    #[test]
    fn far_from_an_ideal_display_learning_decides_about_photographs_that_resemble_little() {
        assert_eq!(wrong(&[0.9, 0.95, 0.9, 0.35, 0.93, 0.9]), [("p3".to_owned(), true)]);
        assert_eq!(wrong(&[0.65, 0.6, 0.7, 0.3, 0.65, 0.6]), [("p3".to_owned(), false)]);
        assert_eq!(wrong(&[0.65, 0.6, 0.7, 0.0, 0.65, 0.6]), [("p3".to_owned(), true)]);
        assert_eq!(wrong(&[0.65, 0.6, 0.7, 0.45, 0.65, 0.6]), []);
    }
}
