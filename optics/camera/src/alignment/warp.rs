//! Resampling of photographs on the display's grid.
//!
//! ```text
//! out(p) = mean over n × n sub-pixels s of  Σ_q L(q_x − H(p + s)_x) L(q_y − H(p + s)_y) photo(q),   L(t) = sinc(t) sinc(t/3), |t| < 3
//! ```
//!
//! H is the map to the camera, such as a homography. n is the number of camera pixels along a display pixel, rounded
//! up, so that the pixels of a fine camera are averaged over the area of a display pixel. L is Lanczos's kernel, with
//! weights scaled to the sum 1. K. Turkowski, Graphics Gems I, 147 (1990).

use super::camera_map::CameraMap;
use super::homography::{Homography, Point};
use lightpath_optics::{Plane, interrupt};
use rayon::prelude::*;
use std::f64::consts::PI;

const REACH: i64 = 3;
const TAPS: usize = 2 * REACH as usize;
/// Number of positions between two pixels with tabulated weights. Half a step is 1/2048 px.
const STEPS: usize = 1024;
/// Most sub-pixels along an axis. A camera more than sixteen times as fine as the display is sampled, not fully
/// averaged.
const SUBPIXELS_MAX: usize = 16;

/// A map from the display's pixels to the camera's.
pub trait MapToCamera: Sync {
    /// Maps a point \[px\].
    fn apply(&self, point: Point) -> Point;

    /// Number of camera pixels along the side of one display pixel at `point`.
    fn magnification(&self, point: Point) -> f64;
}

impl MapToCamera for Homography {
    fn apply(&self, point: Point) -> Point {
        self.apply(point)
    }

    fn magnification(&self, point: Point) -> f64 {
        self.magnification(point)
    }
}

impl MapToCamera for CameraMap {
    fn apply(&self, point: Point) -> Point {
        self.apply(point)
    }

    fn magnification(&self, point: Point) -> f64 {
        self.magnification(point)
    }
}

/// Resamples the photograph on `height_px` × `width_px` pixels of the display. A pixel gets the value `left_out` where
/// it depends on a saturated camera pixel (at or above `saturated`) or on the outside of the photograph: its light is
/// unknown.
#[must_use]
pub fn warp(
    photo: &Plane<f32>,
    map: &impl MapToCamera,
    height_px: usize,
    width_px: usize,
    saturated: f32,
    left_out: f32,
) -> Plane<f32> {
    let centre = [(width_px as f64 - 1.0) / 2.0, (height_px as f64 - 1.0) / 2.0];
    let subpixels = ((map.magnification(centre) - 0.05).ceil() as usize).clamp(1, SUBPIXELS_MAX);
    let offsets: Vec<f64> = (0..subpixels).map(|i| (i as f64 + 0.5) / subpixels as f64 - 0.5).collect();
    let table = weights();
    let mut out = Plane::filled(height_px, width_px, left_out);
    out.values_mut().par_chunks_mut(width_px).enumerate().for_each(|(y, row)| {
        interrupt::check();
        for (x, value) in row.iter_mut().enumerate() {
            let mut sum = 0.0;
            let samples = offsets.iter().flat_map(|dy| offsets.iter().map(move |dx| [x as f64 + dx, y as f64 + dy]));
            for point in samples {
                sum += sample(photo, &table, map.apply(point), saturated);
            }
            // One NaN among the samples makes the sum NaN.
            if sum.is_finite() {
                *value = sum / (subpixels * subpixels) as f32;
            }
        }
    });
    out
}

/// The photograph interpolated between its pixels. NaN where a saturated pixel or the outside contributes.
fn sample(photo: &Plane<f32>, table: &[[f32; TAPS]], [x, y]: [f64; 2], saturated: f32) -> f32 {
    let (w, h) = (photo.width_px() as f64, photo.height_px() as f64);
    if !(x >= -0.5 && y >= -0.5 && x <= w - 0.5 && y <= h - 0.5) {
        return f32::NAN;
    }
    let (left, top) = (x.floor(), y.floor());
    let of = |fraction: f64| &table[(fraction * STEPS as f64).round() as usize];
    let (along_x, along_y) = (of(x - left), of(y - top));
    let index =
        |start: f64, k: usize, side: usize| (start as i64 + k as i64 - REACH + 1).clamp(0, side as i64 - 1) as usize;
    let mut sum = 0.0;
    for (j, weight_y) in along_y.iter().enumerate() {
        let row = photo.row(index(top, j, photo.height_px()));
        let mut along_row = 0.0;
        for (i, weight_x) in along_x.iter().enumerate() {
            let value = row[index(left, i, photo.width_px())];
            // Only the four inner pixels are checked: they carry the value, and the outer lobes only sharpen it.
            if value >= saturated && (2..4).contains(&i) && (2..4).contains(&j) && weight_x * weight_y != 0.0 {
                return f32::NAN;
            }
            along_row += weight_x * value;
        }
        sum += weight_y * along_row;
    }
    sum
}

/// Weights of the six pixels around each tabulated position.
fn weights() -> Vec<[f32; TAPS]> {
    let of = |step: usize| {
        let fraction = step as f64 / STEPS as f64;
        let raw: [f64; TAPS] = std::array::from_fn(|k| lanczos(k as f64 - (REACH - 1) as f64 - fraction));
        let sum: f64 = raw.iter().sum();
        raw.map(|weight| (weight / sum) as f32)
    };
    (0..=STEPS).map(of).collect()
}

fn lanczos(t: f64) -> f64 {
    let sinc = |t: f64| if t == 0.0 { 1.0 } else { (PI * t).sin() / (PI * t) };
    // The computed sine is not exactly zero at whole numbers. The weight must be, so that a position on a pixel keeps
    // its value.
    match t.abs() {
        t if t >= REACH as f64 => 0.0,
        t if t.fract() == 0.0 && t > 0.0 => 0.0,
        t => sinc(t) * sinc(t / REACH as f64),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A scene of waves with periods of 5 to 20 pixels of the display.
    fn scene([x, y]: [f64; 2]) -> f64 {
        0.5 + 0.2 * (1.2 * x + 0.3 * y).sin() * (0.9 * y - 0.2 * x).cos() + 0.1 * (0.35 * x - 0.31 * y).cos()
    }

    #[test]
    fn identity_leaves_photograph_unchanged() {
        let photo = Plane::from_fn(20, 30, |y, x| scene([x as f64, y as f64]) as f32);
        assert_eq!(warp(&photo, &Homography::IDENTITY, 20, 30, 2.0, 1.0), photo);
    }

    #[test]
    fn rotated_and_magnified_photograph_is_restored() {
        for (scale, bound) in [(1.0, 1e-2), (1.7, 3e-2)] {
            let map = Homography::similarity([40.0, 30.0], 0.02, scale, [12.3 * scale, 11.6 * scale]);
            let (back, side) = (map.inverse(), (160.0 * scale) as usize);
            let photo = Plane::from_fn(side, side, |y, x| scene(back.apply([x as f64, y as f64])) as f32);
            let resampled = warp(&photo, &map, 60, 80, 2.0, 1.0);
            let mut worst = 0.0_f64;
            for (y, x) in (8..52).flat_map(|y| (8..72).map(move |x| (y, x))) {
                worst = worst.max((f64::from(resampled.at(y, x)) - scene([x as f64, y as f64])).abs());
            }
            assert!(worst < bound, "scale {scale}: {worst}");
        }
    }

    #[test]
    fn fine_camera_pixels_are_averaged() {
        // Stripes one camera pixel wide, one in each display pixel of three camera pixels.
        let photo = Plane::from_fn(90, 90, |_, x| (x % 3 == 0) as u8 as f32);
        let map = Homography::similarity([0.0, 0.0], 0.0, 3.0, [1.0, 1.0]);
        let resampled = warp(&photo, &map, 30, 30, 2.0, 1.0);
        assert!((resampled.at(15, 15) - 1.0 / 3.0).abs() < 1e-3, "{}", resampled.at(15, 15));
    }

    #[test]
    fn saturated_and_missing_light_is_left_out() {
        let mut photo = Plane::filled(20, 20, 0.4);
        photo.values_mut()[10 * 20 + 10] = 1.0;
        let map = Homography::similarity([0.0, 0.0], 0.0, 1.0, [0.5, 0.0]);
        let resampled = warp(&photo, &map, 20, 25, 0.999, 1.0);
        assert_eq!((resampled.at(10, 9), resampled.at(10, 10)), (1.0, 1.0));
        assert!((resampled.at(5, 5) - 0.4).abs() < 1e-6);
        assert_eq!(resampled.at(5, 22), 1.0, "beyond the photograph");
    }
}
