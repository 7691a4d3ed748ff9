//! Fits of a camera's map, with its lens's distortion, to points.
//!
//! The fit starts with the [`Homography`] of the points. Gauss–Newton then minimizes the distances in the photograph over
//! all parameters of the [`CameraMap`], with Huber's weights against wrong points. The distortion is kept if it explains
//! more than noise would: if
//!
//! ```text
//! F = ((S₀ − S₁) / 4) / (S₁ / (2 n − 12))
//! ```
//!
//! exceeds [`F_MIN`]. S₀ and S₁ are the sums of the squared distances without and with the four parameters of the
//! distortion, and n is the number of points. If the distances were nothing but noise, F would have Fisher's
//! distribution with 4 and 2n − 12 degrees of freedom.
//!
//! Displayed dots are not only displaced by noise: the display's own aberrations displace neighbours alike, a little as a
//! lens does. So S₁ must also be at most half of S₀. A lens that moves the points less than that is not worth a
//! correction.

use super::camera_map::{CameraMap, Frame, PARAMETERS};
use super::homography::{distance, huber_weights, inliers};
use super::{AlignmentError, Homography, PointPair};
use crate::least_squares::NormalEquations;

/// A camera's map that was fitted to points, and the quality of the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraFit {
    /// The fitted map. Its distortion is 0 if a homography describes the points as well.
    pub map: CameraMap,
    /// Root mean square distance of the inliers from the map \[display px\].
    pub residual_px: f64,
    /// Number of inliers: points at a distance of at most four typical ones.
    pub inliers: usize,
}

/// Least number of points for a fit of the distortion: twice as many equations as unknowns.
const DISTORTED_POINTS_MIN: usize = 12;
/// Least F of a distortion that is kept. By noise alone it is exceeded in less than one of 1000 fits to 12 points, and
/// in less than one of a million fits to 100.
const F_MIN: f64 = 12.0;
/// Largest part of the squares that a distortion which is kept leaves.
const SHARE_LEFT_MAX: f64 = 0.5;
/// Largest distance whose square counts fully in F, in root mean square distances of the inliers without distortion.
const WRONG: f64 = 4.0;
const ITERATIONS_MAX: usize = 60;

impl CameraMap {
    /// Fits the map from the points' display side to their camera side. `display_px` and `photo_px` are the rows and
    /// columns of the display and of the photograph. The middle of the photograph is taken for the lens's axis.
    ///
    /// # Errors
    ///
    /// Those of [`Homography::from_points`].
    pub fn from_points(
        pairs: &[PointPair],
        display_px: [usize; 2],
        photo_px: [usize; 2],
    ) -> Result<CameraFit, AlignmentError> {
        let plain = Homography::from_points(pairs)?;
        let frame = |[height_px, width_px]: [usize; 2]| Frame::of_size(height_px, width_px);
        let straight = Self::of_homography(frame(display_px), frame(photo_px), &plain.homography);
        let map = with_distortion(&straight, pairs).unwrap_or(straight);
        let (inliers, residual) = inliers(pairs, |point| map.apply(point));
        let magnification = plain.homography.magnification(map.target_centre());
        Ok(CameraFit { map, residual_px: residual / magnification, inliers })
    }
}

/// The map with its distortion fitted. `None`: the points do not show one.
fn with_distortion(straight: &CameraMap, pairs: &[PointPair]) -> Option<CameraMap> {
    if pairs.len() < DISTORTED_POINTS_MIN {
        return None;
    }
    let mut map = *straight;
    for _ in 0..ITERATIONS_MAX {
        let step = gauss_newton_step(&map, pairs)?;
        map = map.moved(&step);
        if step.iter().all(|change| change.abs() < 1e-12) {
            break;
        }
    }
    let (_, typical) = inliers(pairs, |point| straight.apply(point));
    let squares = |map: &CameraMap| -> f64 {
        let far = |pair: &PointPair| distance(map.apply(pair.display), pair.camera).min(WRONG * typical).powi(2);
        pairs.iter().map(far).sum()
    };
    let (without, with) = (squares(straight), squares(&map));
    let freedom = (2 * pairs.len() - PARAMETERS) as f64;
    // A NaN is no improvement. Distances of 1e-6 px are rounding errors.
    let with = with + 1e-12 * pairs.len() as f64;
    ((without - with) / 4.0 > F_MIN * with / freedom && with < SHARE_LEFT_MAX * without).then_some(map)
}

fn gauss_newton_step(map: &CameraMap, pairs: &[PointPair]) -> Option<[f64; PARAMETERS]> {
    let distances: Vec<f64> = pairs.iter().map(|pair| distance(map.apply(pair.display), pair.camera)).collect();
    let mut equations = NormalEquations::<PARAMETERS>::new();
    for (pair, weight) in pairs.iter().zip(huber_weights(&distances)) {
        let (place, rows) = map.derivatives(pair.display);
        for axis in [0, 1] {
            equations.add(&rows[axis], pair.camera[axis] - place[axis], weight);
        }
    }
    equations.solve()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::alignment::Point;

    const DISPLAY_PX: [usize; 2] = [360, 640];
    const PHOTO_PX: [usize; 2] = [800, 1400];

    /// A camera off the display's axis, whose lens moves the photograph's corners by `k1` of their distance. This is
    /// Brown's formula written out again.
    fn camera([x, y]: Point, k1: f64) -> Point {
        let w = 1.0 + 4e-5 * x - 2e-5 * y;
        let (x, y) = ((2.0 * x + 0.03 * y + 55.0) / w, (-0.02 * x + 2.0 * y + 45.0) / w);
        let (u, v) = (x - 699.5, y - 399.5);
        let half = 1400.0_f64.hypot(800.0) / 2.0;
        let stretch = 1.0 + k1 * (u * u + v * v) / (half * half);
        [699.5 + stretch * u, 399.5 + stretch * v]
    }

    /// Points on a grid in the middle of the display, each off by up to `noise_px` in the photograph.
    fn points(k1: f64, noise_px: f64) -> Vec<PointPair> {
        let mut state = 7_u64;
        let mut noise = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            noise_px * ((state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0)
        };
        (0..144)
            .map(|i| [32.0 + 36.0 * f64::from(i % 16), 36.0 + 36.0 * f64::from(i / 16)])
            .map(|display| {
                let [x, y] = camera(display, k1);
                PointPair { display, camera: [x + noise(), y + noise()] }
            })
            .collect()
    }

    fn worst_px(map: &CameraMap, k1: f64) -> f64 {
        let off = |point: Point| distance(map.apply(point), camera(point, k1));
        [[32.0, 36.0], [608.0, 36.0], [319.5, 179.5], [32.0, 324.0], [608.0, 324.0]]
            .into_iter()
            .map(off)
            .fold(0.0, f64::max)
    }

    #[test]
    fn exact_points_give_exact_distortion() {
        for k1 in [0.01, -0.05] {
            let fit = CameraMap::from_points(&points(k1, 0.0), DISPLAY_PX, PHOTO_PX).unwrap();
            assert!(worst_px(&fit.map, k1) < 1e-6, "{k1}: {}", worst_px(&fit.map, k1));
            let [found, ..] = fit.map.distortion();
            assert!((found - k1).abs() < 1e-8, "{found}");
            assert!(fit.residual_px < 1e-7 && fit.inliers == 144, "{fit:?}");
        }
    }

    #[test]
    fn wrong_points_change_distortion_little() {
        let mut pairs = points(0.01, 0.3);
        pairs[5].camera[0] += 60.0;
        pairs[100].camera[1] -= 45.0;
        let fit = CameraMap::from_points(&pairs, DISPLAY_PX, PHOTO_PX).unwrap();
        assert_eq!(fit.inliers, 142);
        assert!(worst_px(&fit.map, 0.01) < 0.3, "{}", worst_px(&fit.map, 0.01));
        // Uniform errors of up to 0.3 px of the camera along both axes, two of which are a pixel of the display.
        assert!((fit.residual_px - 0.3 * (2.0_f64 / 3.0).sqrt() / 2.0).abs() < 0.03, "{}", fit.residual_px);
    }

    #[test]
    fn straight_lens_and_few_points_keep_homography() {
        let few: Vec<PointPair> = points(0.01, 0.3).into_iter().step_by(14).collect();
        assert_eq!(few.len(), DISTORTED_POINTS_MIN - 1);
        for pairs in [points(0.0, 0.3), points(0.0, 0.0), few] {
            let plain = Homography::from_points(&pairs).unwrap();
            let fit = CameraMap::from_points(&pairs, DISPLAY_PX, PHOTO_PX).unwrap();
            assert_eq!(fit.map.distortion(), [0.0; 4]);
            assert_eq!(fit.inliers, plain.inliers);
            for point in [[0.0, 0.0], [639.0, 359.0], [100.0, 300.0]] {
                assert!(distance(fit.map.apply(point), plain.homography.apply(point)) < 1e-8);
            }
        }
        assert!(CameraMap::from_points(&points(0.01, 0.0)[..3], DISPLAY_PX, PHOTO_PX).is_err());
    }
}
