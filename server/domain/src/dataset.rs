//! Datasets: immutable sets of (phase hologram, photograph) pairs.

mod alignment;
mod checks;
mod prepared;

pub use alignment::{Alignment, AlignmentMethod, CameraMap};
pub use checks::{Finding, FindingKind, LargestValue, PairChecks};
pub use prepared::{Finalization, PreparedDataset, SplitCounts, Splits};

use crate::digests::digest_of;
use crate::kernel::KernelKey;
use crate::units::{Distance, Wavelength};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// Limit on the pairs of a dataset: they are read as a whole, and learning holds them in memory.
pub const PAIRS_MAX: u32 = 10_000;

/// Limit on the pairs that one call adds: as many as a JSON body holds. They are measured one after the other.
pub const ADDED_PAIRS_MAX: usize = 500;

/// Limit on the datasets of a display: several a day for years. They are kept until someone deletes them.
pub const DATASETS_MAX: u32 = 10_000;

/// A dataset with its pairs.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    /// Id: the last part of the resource name.
    pub id: String,
    /// Id of the display.
    pub display: String,
    /// Wavelength: one of the display's wavelengths.
    pub wavelength: Wavelength,
    /// Distance from the SLM to the plane of the camera.
    pub distance: Distance,
    /// Encoding of light in the grey values of the photographs.
    pub photo_encoding: Encoding,
    /// Bits per value of the camera, 8 to 16, if the photographs' files have more; 0: as in the files.
    pub photo_bit_depth: u32,
    /// Map from pixels of the display to pixels of the camera; `None`: one camera pixel for each pixel of the display.
    pub alignment: Option<Alignment>,
    /// Pairs in the order of their ids.
    pub pairs: Vec<Pair>,
    /// Number of pairs. It is also set if `pairs` was left out.
    pub pair_count: u32,
    /// Findings about the pairs, in the order of the pairs, followed by findings about the whole dataset. Without the
    /// pairs, only the latter. A pair was compared with those that were there when it was added or when a job last
    /// checked all pairs.
    pub findings: Vec<Finding>,
    /// Number that grows with every change.
    pub revision: u64,
    /// Options with which the dataset was finalized; `None` while it is open.
    pub finalization: Option<Finalization>,
    /// Numbers of pairs by their use; `None` while the dataset is open.
    pub split_counts: Option<SplitCounts>,
    /// Digest of the properties, alignment, pairs and split; `None` until the dataset is finalized.
    pub digest: Option<String>,
    /// Time when the dataset was created \[ms since 1970\].
    pub create_time_ms: i64,
    /// Time when the dataset was finalized \[ms since 1970\]; `None`: it is open.
    pub finalize_time_ms: Option<i64>,
}

impl Dataset {
    /// The kernel that is learned from the dataset.
    #[must_use]
    pub fn kernel_key(&self) -> KernelKey {
        KernelKey { display: self.display.clone(), wavelength: self.wavelength, distance: self.distance }
    }

    /// Creates an open dataset without pairs.
    #[must_use]
    pub fn empty(
        id: String,
        display: String,
        wavelength: Wavelength,
        distance: Distance,
        photo_encoding: Encoding,
    ) -> Self {
        Self {
            id,
            display,
            wavelength,
            distance,
            photo_encoding,
            photo_bit_depth: 0,
            alignment: None,
            pairs: Vec::new(),
            pair_count: 0,
            findings: Vec::new(),
            revision: 1,
            finalization: None,
            split_counts: None,
            digest: None,
            create_time_ms: 0,
            finalize_time_ms: None,
        }
    }

    /// The map of the dataset's alignment.
    #[must_use]
    pub fn camera_map(&self) -> Option<CameraMap> {
        self.alignment.as_ref().map(|alignment| alignment.map)
    }
}

/// Encoding of light in grey values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Encoding {
    /// The intensity is the value divided by full scale.
    Linear,
    /// Values are encoded as in sRGB (IEC 61966-2-1).
    Srgb,
}

/// A hologram and its photograph, as digests of artifacts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pair {
    /// Id, unique in the dataset.
    pub id: String,
    /// Artifact digest of the hologram.
    pub pattern: String,
    /// Artifact digest of the photograph.
    pub photo: String,
    /// Use of the pair. If it is not given, it is drawn when the dataset is finalized. `None` in a finalized dataset:
    /// the pair is not used.
    pub split: Option<Split>,
    /// Exposure of the photograph.
    pub exposure: Exposure,
    /// Measurements of the pair.
    pub checks: Option<PairChecks>,
}

impl Pair {
    /// Whether the pair was measured with this map of an alignment.
    #[must_use]
    pub fn is_measured_with(&self, map: Option<CameraMap>) -> bool {
        self.checks.as_ref().is_some_and(|checks| checks.map == map)
    }

    /// Whether somebody who adds `given` adds this pair again. A pair that is given without a use may have one.
    #[must_use]
    pub fn is_given_again_by(&self, given: &Self) -> bool {
        (given.split.is_none() || given.split == self.split)
            && (&self.id, &self.pattern, &self.photo, self.exposure)
                == (&given.id, &given.pattern, &given.photo, given.exposure)
    }
}

/// Exposure of a photograph.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Exposure {
    /// Value of the camera in the dark, as a fraction of full scale.
    pub black_level: f64,
    /// Exposure time \[s\]; 0: unknown.
    pub exposure_s: f64,
    /// Gain of the camera, as a factor; 0: unknown.
    pub camera_gain: f64,
}

impl Exposure {
    /// Whether the exposure time or the gain is known. The photographs of a dataset can be compared only if the same of
    /// these values are known for all of them.
    #[must_use]
    pub fn is_known(&self) -> bool {
        self.exposure_s > 0.0 || self.camera_gain > 0.0
    }

    /// Relative brightness of a photograph for the same light: time × gain. An unknown value counts as 1.
    #[must_use]
    pub fn sensitivity(&self) -> f64 {
        let or_one = |value: f64| if value > 0.0 { value } else { 1.0 };
        or_one(self.exposure_s) * or_one(self.camera_gain)
    }
}

/// Use of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Split {
    /// For learning.
    Train,
    /// For watching the loss during learning.
    Validation,
    /// For measuring the kernel once, after learning.
    Test,
}

/// Draws the use of each pair, and returns the id of every pair with its split, in the order of the ids.
///
/// Pairs that have a split keep it. Of the others, a share of `test_fraction` is for testing (at least one pair if no
/// pair was given as a test pair), and then a share of `validation_fraction` is for validation. Both numbers are
/// rounded to whole pairs. The rest is for training, at least one pair if there is another one and no pair was given
/// for it. The draw orders pairs by a hash of the seed and the pair's id, so it does not depend on the order in which
/// pairs were added.
#[must_use]
pub fn draw_split(pairs: &[Pair], validation_fraction: f64, test_fraction: f64, seed: u64) -> Vec<(String, Split)> {
    let mut free: Vec<&Pair> = pairs.iter().filter(|pair| pair.split.is_none()).collect();
    free.sort_by_cached_key(|pair| drawn_number(&pair.id, seed));
    let share = |fraction: f64| (fraction * free.len() as f64).round() as usize;
    let missing = |split| usize::from(pairs.iter().all(|pair| pair.split != Some(split)));
    let test = share(test_fraction).max(missing(Split::Test)).min(free.len());
    let validation = share(validation_fraction).min((free.len() - test).saturating_sub(missing(Split::Train)));

    let drawn = free.iter().enumerate().map(|(rank, pair)| {
        let split = match rank {
            rank if rank < test => Split::Test,
            rank if rank < test + validation => Split::Validation,
            _ => Split::Train,
        };
        (pair.id.clone(), split)
    });
    let given = pairs.iter().filter_map(|pair| pair.split.map(|split| (pair.id.clone(), split)));
    let mut splits: Vec<_> = drawn.chain(given).collect();
    splits.sort_by(|a, b| a.0.cmp(&b.0));
    splits
}

/// Gives a training pair another use, if no pair has that use, and returns its id. At least one training pair is kept.
/// Of all training pairs, one without a given split is taken if there is one. `None`: nothing changed.
pub fn replace_missing(splits: &mut [(String, Split)], pairs: &[Pair], missing: Split, seed: u64) -> Option<String> {
    let count = |wanted: Split| splits.iter().filter(|(_, split)| *split == wanted).count();
    if count(missing) > 0 || count(Split::Train) < 2 {
        return None;
    }
    let is_given = |id: &str| pairs.iter().any(|pair| pair.id == id && pair.split.is_some());
    let training = splits.iter_mut().filter(|(_, split)| *split == Split::Train);
    let (id, split) = training.min_by_key(|(id, _)| (is_given(id), drawn_number(id, seed)))?;
    *split = missing;
    Some(id.clone())
}

/// Number by which pairs are drawn.
fn drawn_number(id: &str, seed: u64) -> [u8; 32] {
    let mut hasher = Sha256::new();
    hasher.update(seed.to_le_bytes());
    hasher.update(id.as_bytes());
    hasher.finalize().into()
}

/// Digest (`sha256-…`) of the display, optics, pairs and split. Learning from datasets with the same digest gives the
/// same result.
///
/// Pairs are hashed in the order of their ids. The id of the dataset and its times are not hashed.
#[must_use]
pub fn digest(dataset: &Dataset) -> String {
    #[derive(Serialize)]
    struct Content<'a> {
        display: &'a str,
        wavelength_pm: i64,
        distance_nm: i64,
        photo_encoding: Encoding,
        pairs: Vec<(&'a str, &'a str, &'a str, Option<Split>)>,
        // Properties that older datasets lack are left out when they are not set, so that the digests of those stay the
        // same.
        #[serde(skip_serializing_if = "is_zero")]
        photo_bit_depth: u32,
        #[serde(skip_serializing_if = "Option::is_none")]
        alignment: Option<([f64; 9], u32, u32)>,
        #[serde(skip_serializing_if = "Option::is_none")]
        distortion: Option<[f64; 4]>,
        #[serde(skip_serializing_if = "Vec::is_empty")]
        exposures: Vec<Exposure>,
    }

    let mut pairs: Vec<_> = dataset
        .pairs
        .iter()
        .map(|pair| (pair.id.as_str(), pair.pattern.as_str(), pair.photo.as_str(), pair.split))
        .collect();
    pairs.sort_by_key(|pair| pair.0);
    let mut exposures: Vec<_> = dataset.pairs.iter().map(|pair| (&pair.id, pair.exposure)).collect();
    exposures.sort_by_key(|(id, _)| *id);
    let mut exposures: Vec<Exposure> = exposures.into_iter().map(|(_, exposure)| exposure).collect();
    if exposures.iter().all(|exposure| *exposure == Exposure::default()) {
        exposures.clear();
    }
    let content = Content {
        display: &dataset.display,
        wavelength_pm: dataset.wavelength.pm,
        distance_nm: dataset.distance.nm,
        photo_encoding: dataset.photo_encoding,
        pairs,
        photo_bit_depth: dataset.photo_bit_depth,
        alignment: dataset.alignment.as_ref().map(|a| (a.map.homography, a.photo_height_px, a.photo_width_px)),
        distortion: dataset.camera_map().map(|map| map.distortion).filter(|distortion| *distortion != [0.0; 4]),
        exposures,
    };
    // JSON of this private struct is stable; its debug output could change with the code.
    digest_of(&serde_json::to_vec(&content).unwrap_or_default())
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde calls it with a reference")]
fn is_zero(value: &u32) -> bool {
    *value == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(count: usize) -> Vec<Pair> {
        (0..count)
            .map(|n| Pair {
                id: format!("p{n:02}"),
                pattern: format!("a{n}"),
                photo: format!("b{n}"),
                ..Pair::default()
            })
            .collect()
    }

    fn count(splits: &[(String, Split)], split: Split) -> usize {
        splits.iter().filter(|(_, s)| *s == split).count()
    }

    fn aligned(distortion: [f64; 4]) -> Alignment {
        Alignment {
            method: AlignmentMethod::Points,
            map: CameraMap { homography: [1.0, 0.0, 2.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], distortion },
            photo_height_px: 9,
            photo_width_px: 9,
            points: 4,
            residual_px: 0.0,
            corrected_px: 0.0,
            left_px: 0.0,
            explanation: String::new(),
            photo: String::new(),
            before: String::new(),
            after: String::new(),
        }
    }

    #[test]
    fn split_has_the_requested_shares_and_does_not_depend_on_order() {
        let pairs = pairs(20);
        let splits = draw_split(&pairs, 0.1, 0.2, 7);
        assert_eq!((count(&splits, Split::Test), count(&splits, Split::Validation)), (4, 2));
        assert_eq!(count(&splits, Split::Train), 14);
        let reversed: Vec<Pair> = pairs.iter().rev().cloned().collect();
        assert_eq!(draw_split(&reversed, 0.1, 0.2, 7), splits);
        assert_ne!(draw_split(&pairs, 0.1, 0.2, 8), splits);
    }

    #[test]
    fn given_splits_are_kept_and_at_least_one_test_pair_is_drawn() {
        let mut pairs = pairs(3);
        let splits = draw_split(&pairs, 0.0, 0.0, 1);
        assert_eq!(count(&splits, Split::Test), 1);
        pairs[1].split = Some(Split::Test);
        let splits = draw_split(&pairs, 0.0, 0.0, 1);
        assert_eq!(splits[1], ("p01".to_owned(), Split::Test));
        assert_eq!((count(&splits, Split::Test), count(&splits, Split::Train)), (1, 2));
        assert_eq!(draw_split(&[], 0.2, 0.2, 1), []);
    }

    #[test]
    fn few_pairs_leave_one_for_training() {
        for (pairs_total, expected) in [(2, (1, 0, 1)), (3, (1, 1, 1)), (4, (2, 1, 1)), (5, (3, 1, 1))] {
            let splits = draw_split(&pairs(pairs_total), 0.2, 0.2, 1);
            let counts = (count(&splits, Split::Train), count(&splits, Split::Validation), count(&splits, Split::Test));
            assert_eq!(counts, expected, "{pairs_total} pairs");
        }
        let splits = draw_split(&pairs(3), 0.8, 0.0, 1);
        assert_eq!((count(&splits, Split::Train), count(&splits, Split::Validation)), (1, 1));
    }

    #[test]
    fn missing_use_is_given_to_training_pair_that_was_drawn() {
        let mut pairs = pairs(5);
        pairs[0].split = Some(Split::Train);
        pairs[1].split = Some(Split::Test);
        let mut splits = draw_split(&pairs, 0.0, 0.0, 1);
        let moved = replace_missing(&mut splits, &pairs, Split::Validation, 1).unwrap();
        assert!(moved.as_str() > "p01", "{moved} was drawn");
        assert_eq!((count(&splits, Split::Train), count(&splits, Split::Validation)), (3, 1));
        assert_eq!(replace_missing(&mut splits, &pairs, Split::Validation, 1), None);
        let mut last = vec![("p00".to_owned(), Split::Train), ("p01".to_owned(), Split::Test)];
        assert_eq!(replace_missing(&mut last, &pairs, Split::Validation, 1), None, "the last training pair stays");
    }

    #[test]
    fn digest_depends_on_content_but_not_on_id_time_or_order() {
        let (wavelength, distance) = (Wavelength { pm: 515_000 }, Distance { nm: 150_000_000 });
        let mut dataset = Dataset::empty("d".into(), "lab".into(), wavelength, distance, Encoding::Linear);
        dataset.pairs = pairs(3);
        let first = digest(&dataset);
        assert_eq!(first.len(), 71);
        let mut other = dataset.clone();
        other.id = "e".into();
        other.create_time_ms = 5;
        other.pairs.reverse();
        assert_eq!(digest(&other), first);
        other.pairs[0].split = Some(Split::Test);
        assert_ne!(digest(&other), first);
        for change in [
            (|d: &mut Dataset| d.photo_bit_depth = 12) as fn(&mut Dataset),
            |d| d.pairs[1].exposure.exposure_s = 0.1,
            |d| d.alignment = Some(aligned([0.0; 4])),
        ] {
            let mut other = dataset.clone();
            change(&mut other);
            assert_ne!(digest(&other), first);
        }
        let with = |distortion| digest(&Dataset { alignment: Some(aligned(distortion)), ..dataset.clone() });
        assert_ne!(with([0.01, 0.0, 0.0, 0.0]), with([0.0; 4]));
    }
}
