//! Fitting of a picture of any size to a display, or to an area of it.
//!
//! Each axis is resampled separately, in linear light, with the Catmull-Rom kernel. When the picture shrinks, the
//! kernel is widened so that every source pixel counts:
//!
//! ```text
//! out(i) = Σ_j k((j + ½ − c_i)/s) in(j) / Σ_j k((j + ½ − c_i)/s),   c_i = start + (i + ½) · length / outputs
//! ```
//!
//! s = max(1, length/outputs), k the cubic kernel of Keys (1981) with a = −½. Its overshoot is clipped to [0, 1].

use super::PictureError;
use lightpath_domain::job::Fit;
use lightpath_optics::{Plane, RegionOfInterest, interrupt};
use rayon::prelude::*;

/// A part of a picture or of a display.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rectangle {
    /// First column \[px\].
    pub x_px: usize,
    /// First row \[px\].
    pub y_px: usize,
    /// Number of columns, at least 1.
    pub width_px: usize,
    /// Number of rows, at least 1.
    pub height_px: usize,
}

impl Rectangle {
    /// Checks that the rectangle is a part of `height_px` × `width_px` pixels.
    pub(crate) fn require_inside(self, height_px: usize, width_px: usize) -> Result<(), PictureError> {
        let is_inside =
            |start: usize, length: usize, side| length > 0 && start.checked_add(length).is_some_and(|end| end <= side);
        if is_inside(self.x_px, self.width_px, width_px) && is_inside(self.y_px, self.height_px, height_px) {
            return Ok(());
        }
        Err(PictureError::RegionOutside { width_px: width_px as u32, height_px: height_px as u32 })
    }
}

impl From<RegionOfInterest> for Rectangle {
    fn from(region: RegionOfInterest) -> Self {
        let (x_px, y_px) = (region.x_px(), region.y_px());
        Self { x_px, y_px, width_px: region.width_px(), height_px: region.height_px() }
    }
}

/// Where a picture goes on a display, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// How the picture is fitted to the area.
    pub fit: Fit,
    /// The rectangle of the display that the picture fills, with black around it; `None`: the whole display.
    pub area: Option<Rectangle>,
    /// Rows of the display \[px\].
    pub height_px: usize,
    /// Columns of the display \[px\].
    pub width_px: usize,
}

impl Placement {
    /// A picture that fills the whole display.
    #[must_use]
    pub fn whole(fit: Fit, height_px: usize, width_px: usize) -> Self {
        Self { fit, area: None, height_px, width_px }
    }
}

/// Fits the picture to an area of a display, and returns the light of all the display's pixels.
///
/// - [`Fit::Contain`]: scales the picture to fit inside the area, centres it, and fills the rest with black;
/// - [`Fit::Cover`]: scales the picture to cover the area, and crops the overhang evenly;
/// - [`Fit::Stretch`]: scales each axis separately;
/// - [`Fit::Exact`]: accepts only a picture of the area's size.
///
/// The pixels of a picture that has the area's size stay unchanged, to the last bit.
///
/// # Errors
///
/// [`PictureError::WrongSize`] for [`Fit::Exact`] and a picture of another size, [`PictureError::RegionOutside`] for an
/// area that leaves the display.
pub fn fit(picture: Plane<f32>, placement: &Placement) -> Result<Plane<f32>, PictureError> {
    let &Placement { fit, area, height_px, width_px } = placement;
    let Some(area) = area else { return filling(picture, fit, height_px, width_px) };
    area.require_inside(height_px, width_px)?;
    let inner = filling(picture, fit, area.height_px, area.width_px)?;
    if (inner.height_px(), inner.width_px()) == (height_px, width_px) {
        return Ok(inner);
    }
    Ok(bordered(&inner, (area.y_px, area.x_px), height_px, width_px))
}

fn filling(picture: Plane<f32>, fit: Fit, height_px: usize, width_px: usize) -> Result<Plane<f32>, PictureError> {
    let (h, w) = (picture.height_px(), picture.width_px());
    if (h, w) == (height_px, width_px) {
        return Ok(picture);
    }
    let (scale_y, scale_x) = (height_px as f64 / h as f64, width_px as f64 / w as f64);
    match fit {
        Fit::Exact => Err(PictureError::WrongSize {
            width_px: width_px as u32,
            height_px: height_px as u32,
            actual_width_px: w as u32,
            actual_height_px: h as u32,
        }),
        Fit::Stretch => Ok(resized(&picture, height_px, width_px)),
        Fit::Cover => {
            let scale = scale_y.max(scale_x);
            Ok(resample(&picture, Span::middle(h, height_px, scale), Span::middle(w, width_px, scale)))
        }
        Fit::Contain => {
            let scale = scale_y.min(scale_x);
            let inside = |side: usize, most: usize| ((side as f64 * scale).round() as usize).clamp(1, most);
            let (inner_h, inner_w) = (inside(h, height_px), inside(w, width_px));
            let corner = ((height_px - inner_h) / 2, (width_px - inner_w) / 2);
            Ok(bordered(&resized(&picture, inner_h, inner_w), corner, height_px, width_px))
        }
    }
}

/// The picture at another size; each axis is scaled separately.
#[must_use]
pub fn resized(picture: &Plane<f32>, height_px: usize, width_px: usize) -> Plane<f32> {
    resample(picture, Span::whole(picture.height_px(), height_px), Span::whole(picture.width_px(), width_px))
}

/// The picture with black around it; its first pixel is at `top`, `left`.
fn bordered(inner: &Plane<f32>, (top, left): (usize, usize), height_px: usize, width_px: usize) -> Plane<f32> {
    let mut out = Plane::filled(height_px, width_px, 0.0);
    for y in 0..inner.height_px() {
        out.values_mut()[(top + y) * width_px + left..][..inner.width_px()].copy_from_slice(inner.row(y));
    }
    out
}

/// The part of an axis to resample, and the number of output pixels.
#[derive(Clone, Copy)]
struct Span {
    inputs: usize,
    start: f64,
    length: f64,
    outputs: usize,
}

impl Span {
    fn whole(inputs: usize, outputs: usize) -> Self {
        Self { inputs, start: 0.0, length: inputs as f64, outputs }
    }

    fn middle(inputs: usize, outputs: usize, scale: f64) -> Self {
        let length = outputs as f64 / scale;
        Self { inputs, start: (inputs as f64 - length) / 2.0, length, outputs }
    }

    /// For every output pixel: the first input pixel, and the weights of the input pixels from there on. Weights sum to
    /// 1.
    fn weights(self) -> Vec<(usize, Vec<f32>)> {
        let widening = (self.length / self.outputs as f64).max(1.0);
        let reach = 2.0 * widening;
        let of_output = |i: usize| {
            let centre = self.start + (i as f64 + 0.5) * self.length / self.outputs as f64;
            let first = ((centre - reach).floor().max(0.0) as usize).min(self.inputs - 1);
            let end = ((centre + reach).ceil() as usize).clamp(first + 1, self.inputs);
            let raw: Vec<f64> = (first..end).map(|j| catmull_rom((j as f64 + 0.5 - centre) / widening)).collect();
            let sum: f64 = raw.iter().sum();
            (first, raw.iter().map(|weight| (weight / sum) as f32).collect())
        };
        (0..self.outputs).map(of_output).collect()
    }
}

fn catmull_rom(x: f64) -> f64 {
    match x.abs() {
        x if x < 1.0 => (1.5 * x - 2.5) * x * x + 1.0,
        x if x < 2.0 => ((-0.5 * x + 2.5) * x - 4.0) * x + 2.0,
        _ => 0.0,
    }
}

/// Resamples rows, then columns. A long and narrow picture for a long and narrow display that lies across it would have a
/// huge intermediate, and is resampled in the other order. So no intermediate is larger than picture and result: the
/// product of the two possible ones is the product of these.
fn resample(picture: &Plane<f32>, rows: Span, columns: Span) -> Plane<f32> {
    let larger = picture.values().len().max(rows.outputs * columns.outputs);
    let mut out = if picture.height_px() * columns.outputs > larger {
        resample_rows(&resample_columns(picture, &rows.weights()), &columns.weights())
    } else {
        resample_columns(&resample_rows(picture, &columns.weights()), &rows.weights())
    };
    out.values_mut().par_iter_mut().for_each(|value| *value = value.clamp(0.0, 1.0));
    out
}

/// First input and weights of each output.
type Weights = [(usize, Vec<f32>)];

fn resample_columns(picture: &Plane<f32>, weights: &Weights) -> Plane<f32> {
    let width_px = picture.width_px();
    let mut out = Plane::filled(weights.len(), width_px, 0.0);
    out.values_mut().par_chunks_mut(width_px).zip(weights).for_each(|(out_row, (first, weights))| {
        interrupt::check();
        for (i, weight) in weights.iter().enumerate() {
            for (value, input) in out_row.iter_mut().zip(picture.row(first + i)) {
                *value += weight * input;
            }
        }
    });
    out
}

fn resample_rows(picture: &Plane<f32>, weights: &Weights) -> Plane<f32> {
    let mut out = Plane::filled(picture.height_px(), weights.len(), 0.0);
    out.values_mut().par_chunks_mut(weights.len()).enumerate().for_each(|(y, out_row)| {
        interrupt::check();
        let row = picture.row(y);
        for (value, (first, weights)) in out_row.iter_mut().zip(weights) {
            *value = weights.iter().zip(&row[*first..]).map(|(weight, input)| weight * input).sum();
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(height_px: usize, width_px: usize) -> Plane<f32> {
        Plane::from_fn(height_px, width_px, |y, x| (y + 2 * x) as f32 / (height_px + 2 * width_px) as f32)
    }

    fn whole(picture: Plane<f32>, policy: Fit, height_px: usize, width_px: usize) -> Result<Plane<f32>, PictureError> {
        fit(picture, &Placement::whole(policy, height_px, width_px))
    }

    #[test]
    fn picture_of_the_same_size_is_unchanged() {
        for policy in [Fit::Contain, Fit::Cover, Fit::Stretch, Fit::Exact] {
            assert_eq!(whole(ramp(9, 17), policy, 9, 17).unwrap(), ramp(9, 17));
        }
        assert!(matches!(whole(ramp(9, 17), Fit::Exact, 9, 18), Err(PictureError::WrongSize { .. })));
    }

    #[test]
    fn flat_pictures_stay_flat_at_every_scale() {
        for (h, w) in [(8, 8), (3, 200), (333, 127)] {
            let out = whole(Plane::filled(h, w, 0.3), Fit::Stretch, 40, 31).unwrap();
            assert!(out.values().iter().all(|value| (value - 0.3).abs() < 1e-6));
            let out = whole(Plane::filled(h, w, 0.3), Fit::Cover, 40, 31).unwrap();
            assert!(out.values().iter().all(|value| (value - 0.3).abs() < 1e-6));
        }
    }

    #[test]
    fn contain_centres_between_black_borders() {
        let out = whole(Plane::filled(10, 20, 1.0), Fit::Contain, 40, 40).unwrap();
        let light = |y: usize| out.row(y).iter().sum::<f32>();
        assert_eq!((light(9), light(30)), (0.0, 0.0));
        assert!((light(10) - 40.0).abs() < 1e-3 && (light(29) - 40.0).abs() < 1e-3);
    }

    #[test]
    fn cover_crops_both_ends_evenly() {
        let striped = Plane::from_fn(16, 48, |_, x| if (16..32).contains(&x) { 1.0 } else { 0.0 });
        let out = whole(striped, Fit::Cover, 16, 16).unwrap();
        assert!(out.values().iter().all(|&value| value > 0.99), "only the middle third is left");
    }

    #[test]
    fn shrinking_averages_instead_of_skipping() {
        let fine_stripes = Plane::from_fn(64, 64, |_, x| (x % 2) as f32);
        let out = whole(fine_stripes, Fit::Stretch, 8, 8).unwrap();
        assert!(out.values().iter().all(|value| (value - 0.5).abs() < 0.05), "{:?}", out.values());
    }

    #[test]
    fn ramp_is_not_distorted_or_shifted() {
        let (source, out) = (ramp(40, 60), whole(ramp(40, 60), Fit::Stretch, 20, 30).unwrap());
        for (y, x) in [(5, 7), (10, 15), (14, 22)] {
            let under: f32 =
                [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(dy, dx)| source.at(2 * y + dy, 2 * x + dx)).iter().sum();
            assert!((out.at(y, x) - under / 4.0).abs() < 1e-4);
        }
    }

    #[test]
    fn a_picture_fills_its_area_and_nothing_else() {
        let area = Rectangle { x_px: 3, y_px: 2, width_px: 10, height_px: 5 };
        let placed =
            |picture, fit| super::fit(picture, &Placement { fit, area: Some(area), height_px: 9, width_px: 20 });
        let inside = |y: usize, x: usize| (2..7).contains(&y) && (3..13).contains(&x);
        for policy in [Fit::Cover, Fit::Stretch] {
            let out = placed(Plane::filled(40, 40, 1.0), policy).unwrap();
            // Weights sum to 1 but for rounding.
            assert_eq!(out.map(f32::round), Plane::from_fn(9, 20, |y, x| f32::from(u8::from(inside(y, x)))));
        }
        // A square is as high as the area, in its middle.
        let out = placed(Plane::filled(40, 40, 1.0), Fit::Contain).unwrap();
        let square = |y, x| inside(y, x) && (5..10).contains(&x);
        assert_eq!(out.map(f32::round), Plane::from_fn(9, 20, |y, x| f32::from(u8::from(square(y, x)))));
        let out = placed(ramp(5, 10), Fit::Exact).unwrap();
        assert_eq!((out.at(2, 3), out.at(6, 12)), (ramp(5, 10).at(0, 0), ramp(5, 10).at(4, 9)));
        assert!(matches!(placed(ramp(9, 20), Fit::Exact), Err(PictureError::WrongSize { width_px: 10, .. })));
        let outside = Placement { fit: Fit::Cover, area: Some(area), height_px: 9, width_px: 12 };
        assert!(matches!(super::fit(ramp(9, 20), &outside), Err(PictureError::RegionOutside { width_px: 12, .. })));
    }
}
