//! Whether a photograph is of the pattern that was shown.
//!
//! Two things tell it. *Details*: the differences of neighbouring pixels, mostly speckle, are those of the photograph before
//! if the camera or the display has not gone on, in all of the picture or in a part of its rows, whatever the optics are. And
//! *expectation*: a photograph resembles what its own pattern should show more than what others should.

use super::checks::Reconstructor;
use super::fingerprint;
use super::reading::{CaptureError, Captures};
use crate::pictures::{Photo, SATURATION};
use lightpath_camera::alignment::Registration;
use lightpath_optics::numerics::tiles::Tiles;
use lightpath_optics::{Plane, RegionOfInterest};

/// Strips of rows in which photographs are compared: a frame may be read out while the pattern changes.
const STRIPS: usize = 8;
/// Longest side of what is kept of a photograph \[px\].
const DETAILS_PX_MAX: usize = 1024;
/// Correlation of details above which a strip is the same as before. A static part of the light, such as fringes of a cover
/// glass, leaves less; two frames of one pattern have more, unless they are almost dark.
const SAME_DETAILS: f64 = 0.6;
/// Smallest contrast of details in a strip, as a part of full scale, root mean square, at which they can be compared: below it
/// they are noise.
const CONTRAST_MIN: f64 = 1e-3;
/// The brightest thousandth of a black photograph is below this part of full scale.
const BLACK: f64 = 0.02;
/// Part of saturated pixels from which a photograph is taken again with a shorter exposure.
pub const SATURATED_MAX: f64 = 0.001;

/// What is kept of a photograph to recognize it.
#[derive(Clone, Debug)]
pub struct Details {
    /// For each strip, differences of neighbours along x with mean 0 and norm 1; `None`: too little contrast.
    strips: Vec<Option<Vec<f32>>>,
}

impl Details {
    /// The details of a photograph, 1 is full scale.
    #[must_use]
    pub fn of(photo: &Plane<f32>) -> Self {
        let small = binned(photo);
        let strip = |index: usize| {
            let rows = index * small.height_px() / STRIPS..(index + 1) * small.height_px() / STRIPS;
            let differences = rows.flat_map(|y| small.row(y).windows(2).map(|two| two[1] - two[0]));
            normalized(differences.collect())
        };
        Self { strips: (0..STRIPS).map(strip).collect() }
    }

    /// Number of strips that show the same details as `before`, of those that can be compared.
    #[must_use]
    pub fn strips_as_in(&self, before: &Self) -> (usize, usize) {
        let both = self.strips.iter().zip(&before.strips).filter_map(|(a, b)| Some((a.as_ref()?, b.as_ref()?)));
        let same = both.map(|(a, b)| a.len() == b.len() && dot(a, b) > SAME_DETAILS);
        same.fold((0, 0), |(same, all), is_same| (same + usize::from(is_same), all + 1))
    }
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum()
}

fn normalized(mut values: Vec<f32>) -> Option<Vec<f32>> {
    let norm = dot(&values, &values).sqrt();
    if norm <= CONTRAST_MIN * (values.len() as f64).sqrt() {
        return None;
    }
    values.iter_mut().for_each(|value| *value = (f64::from(*value) / norm) as f32);
    Some(values)
}

/// The photograph in means over squares, at most [`DETAILS_PX_MAX`] long.
fn binned(photo: &Plane<f32>) -> Plane<f32> {
    let side = photo.height_px().max(photo.width_px()).div_ceil(DETAILS_PX_MAX);
    let (height_px, width_px) = (photo.height_px() / side, photo.width_px() / side);
    let scale = 1.0 / (side * side) as f32;
    Plane::from_fn(height_px, width_px, |y, x| {
        let rows = y * side..(y + 1) * side;
        scale * rows.map(|y| photo.row(y)[x * side..(x + 1) * side].iter().sum::<f32>()).sum::<f32>()
    })
}

/// Light of a photograph as a whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brightness {
    /// Value that a thousandth of the pixels reach, as a part of full scale.
    pub brightest: f64,
    /// Part of the pixels that are saturated.
    pub saturated: f64,
    /// Mean above what the darkest hundredth of the pixels has, as a part of full scale: the light, whatever the camera adds
    /// in the dark. A modulator of phase sends the same light to the camera whatever its pattern is, as far as the camera
    /// sees all of the picture.
    pub light: f64,
}

impl Brightness {
    /// Measures a photograph, 1 is full scale.
    #[must_use]
    pub fn of(photo: &Plane<f32>) -> Self {
        let mut values = photo.values().to_vec();
        let count = values.len() as f64;
        let saturated = values.iter().filter(|&&value| value >= SATURATION).count() as f64 / count;
        let mean = values.iter().map(|&value| f64::from(value)).sum::<f64>() / count;
        let at = values.len() - 1 - values.len() / 1000;
        let (_, &mut brightest, _) = values.select_nth_unstable_by(at, f32::total_cmp);
        let at = values.len() / 100;
        let (_, &mut darkest, _) = values.select_nth_unstable_by(at, f32::total_cmp);
        Self { brightest: brightest.into(), saturated, light: mean - f64::from(darkest) }
    }

    /// Whether the photograph is black.
    #[must_use]
    pub fn is_black(&self) -> bool {
        self.brightest < BLACK
    }
}

/// What a pattern should show on the ideal display.
#[derive(Clone, Debug)]
pub struct Expectation {
    light: Plane<f32>,
    coarse: String,
}

impl Expectation {
    /// What the pattern in a file should show.
    ///
    /// # Errors
    ///
    /// [`CaptureError`] for a file that is no pattern of the display.
    pub fn of(captures: &Captures, reconstructor: &Reconstructor, pattern: &[u8]) -> Result<Self, CaptureError> {
        let light = reconstructor.light(&captures.phase(pattern)?)?;
        let coarse = fingerprint::of(&light, region(captures));
        Ok(Self { light, coarse })
    }

    /// The expectation on a coarse grid, which can be kept for many patterns.
    #[must_use]
    pub fn coarse(&self) -> &str {
        &self.coarse
    }
}

/// How a photograph compares with what patterns should show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Correlation with the expectation of its own pattern.
    pub own: f64,
    /// The pattern of another number whose expectation it resembles most, with the correlation; `None`: there is no other.
    pub other: Option<(usize, f64)>,
    /// Displacement from the expectation \[px of the display\]; `None`: not measurable.
    pub shift_px: Option<f64>,
}

/// Compares a photograph with what its own pattern should show, and coarsely with the expectations of `others`.
///
/// # Errors
///
/// [`CaptureError::Size`] for a photograph that has not the size of the alignment's.
pub fn compare<'a>(
    captures: &Captures,
    photo: Photo,
    own: &Expectation,
    others: impl Iterator<Item = (usize, &'a str)>,
) -> Result<Comparison, CaptureError> {
    let (seen, region) = (captures.on_grid(photo.light)?, region(captures));
    let coarse = fingerprint::of(&seen, region);
    let with = |expected: &str| fingerprint::correlation(&coarse, expected).unwrap_or(0.0);
    let others = others.map(|(index, expected)| (index, with(expected)));
    let registration = Tiles::cover(region).and_then(|mut tiles| {
        tiles.add(&own.light, &seen, SATURATION);
        Registration::of(&tiles, region)
    });
    Ok(Comparison {
        own: with(&own.coarse),
        other: others.max_by(|(_, a), (_, b)| a.total_cmp(b)),
        shift_px: registration.map(|found| found.shift_px),
    })
}

fn region(captures: &Captures) -> RegionOfInterest {
    RegionOfInterest::middle(&captures.setup().grid())
}
