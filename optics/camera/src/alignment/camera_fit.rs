//! Fits of a camera's map, with its lens's distortion, to points.
//!
//! The fit starts with the [`Homography`] of the points. Gauss–Newton then minimizes the distances in the photograph with
//! Huber's weights against wrong points: first over the homography and the main radial term of the distortion, then over
//! all parameters of the [`CameraMap`]. Each of the two fits is kept if it lowers the squares of the distances far more
//! than noise would: if
//!
//! ```text
//! F = ((S₀ − S₁) / (p₁ − p₀)) / (S₁ / (2 n − p₁))
//! ```
//!
//! exceeds [`RADIAL_F_MIN`] in the first fit and [`OTHERS_F_MIN`] in the second. S₀ and S₁ are the sums of the squared distances before and after, p₀ and p₁ the numbers of fitted
//! parameters, and n is the number of points. If the distances were nothing but noise, F would have Fisher's distribution
//! with p₁ − p₀ and 2n − p₁ degrees of freedom.

use super::camera_map::{CameraMap, Frame, PARAMETERS};
use super::error::AlignmentError;
use super::homography::{Homography, PointPair, distance, huber_weights, inliers};
use lightpath_optics::numerics::least_squares::NormalEquations;

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
/// Least F of the main radial term, if it is kept. Noise alone exceeds it in less than one of 10 000 fits to 12 points. But
/// displayed dots are not only displaced by noise: the display's own aberrations displace neighbours alike, a little as a
/// lens does.
const RADIAL_F_MIN: f64 = 25.0;
/// Least F of all other terms. Aberrations and bent modulators imitate them more: there F reached 37 with straight lenses.
const OTHERS_F_MIN: f64 = 50.0;
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
        let map = with_distortion(straight, pairs);
        let (inliers, residual) = inliers(pairs, |point| map.apply(point));
        let magnification = plain.homography.magnification(map.target_centre());
        Ok(CameraFit { map, residual_px: residual / magnification, inliers })
    }
}

/// Number of parameters of a homography.
const STRAIGHT: usize = PARAMETERS - 4;
/// Number of parameters of a homography and the main radial term of the distortion.
const RADIAL: usize = STRAIGHT + 1;

/// The map with what the points show of its distortion.
fn with_distortion(straight: CameraMap, pairs: &[PointPair]) -> CameraMap {
    if pairs.len() < DISTORTED_POINTS_MIN {
        return straight;
    }
    let (_, typical) = inliers(pairs, |point| straight.apply(point));
    let squares = |map: &CameraMap| -> f64 {
        let square = |pair: &PointPair| distance(map.apply(pair.display), pair.camera).min(WRONG * typical).powi(2);
        pairs.iter().map(square).sum()
    };
    let (mut kept, mut parameters) = (straight, STRAIGHT);
    let fits = [
        (fitted::<RADIAL>(kept, pairs), RADIAL, RADIAL_F_MIN),
        (fitted::<PARAMETERS>(kept, pairs), PARAMETERS, OTHERS_F_MIN),
    ];
    for (fitted, more, f_min) in fits {
        let Some(map) = fitted else { continue };
        // Distances of 1e-6 px are rounding errors.
        let left = (squares(&map) + 1e-12 * pairs.len() as f64) / (2 * pairs.len() - more) as f64;
        let lowered = (squares(&kept) - squares(&map)) / (more - parameters) as f64;
        if lowered > f_min * left {
            (kept, parameters) = (map, more);
        }
    }
    kept
}

/// The map with its first N parameters fitted. `None`: the points do not tell them.
fn fitted<const N: usize>(mut map: CameraMap, pairs: &[PointPair]) -> Option<CameraMap> {
    for _ in 0..ITERATIONS_MAX {
        let step = gauss_newton_step::<N>(&map, pairs)?;
        map = map.moved(&step);
        if step.iter().all(|change| change.abs() < 1e-12) {
            break;
        }
    }
    Some(map)
}

fn gauss_newton_step<const N: usize>(map: &CameraMap, pairs: &[PointPair]) -> Option<[f64; PARAMETERS]> {
    let distances: Vec<f64> = pairs.iter().map(|pair| distance(map.apply(pair.display), pair.camera)).collect();
    let mut equations = NormalEquations::<N>::none();
    for (pair, weight) in pairs.iter().zip(huber_weights(&distances)) {
        let (place, rows) = map.derivatives(pair.display);
        for axis in [0, 1] {
            let row = std::array::from_fn(|parameter| rows[axis][parameter]);
            equations.add(&row, pair.camera[axis] - place[axis], weight);
        }
    }
    let step = equations.solve()?;
    Some(std::array::from_fn(|parameter| step.get(parameter).copied().unwrap_or(0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::alignment::homography::Point;

    const DISPLAY_PX: [usize; 2] = [360, 640];
    const PHOTO_PX: [usize; 2] = [800, 1400];

    /// A camera off the display's axis, whose lens moves the photograph's corners by `k1` of their distance, and is off its
    /// own axis by `p1`. This is Brown's formula written out again.
    fn camera([x, y]: Point, [k1, p1]: [f64; 2]) -> Point {
        let w = 1.0 + 4e-5 * x - 2e-5 * y;
        let (x, y) = ((2.0 * x + 0.03 * y + 55.0) / w, (-0.02 * x + 2.0 * y + 45.0) / w);
        let (u, v) = (x - 699.5, y - 399.5);
        let half = 1400.0_f64.hypot(800.0) / 2.0;
        let (u, v) = (u / half, v / half);
        let stretch = 1.0 + k1 * (u * u + v * v);
        let (u, v) = (stretch * u + 2.0 * p1 * u * v, stretch * v + p1 * (u * u + 3.0 * v * v));
        [699.5 + half * u, 399.5 + half * v]
    }

    /// Points on a grid in the middle of the display, each off by up to `noise_px` in the photograph.
    fn points(lens: [f64; 2], noise_px: f64) -> Vec<PointPair> {
        let mut state = 7_u64;
        let mut noise = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            noise_px * ((state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0)
        };
        (0..144)
            .map(|i| [32.0 + 36.0 * f64::from(i % 16), 36.0 + 36.0 * f64::from(i / 16)])
            .map(|display| {
                let [x, y] = camera(display, lens);
                PointPair { display, camera: [x + noise(), y + noise()] }
            })
            .collect()
    }

    fn worst_px(map: &CameraMap, lens: [f64; 2]) -> f64 {
        let off = |point: Point| distance(map.apply(point), camera(point, lens));
        [[32.0, 36.0], [608.0, 36.0], [319.5, 179.5], [32.0, 324.0], [608.0, 324.0]]
            .into_iter()
            .map(off)
            .fold(0.0, f64::max)
    }

    #[test]
    fn exact_points_give_exact_distortion() {
        for lens in [[0.01, 0.0], [-0.05, 0.0], [0.01, 0.004]] {
            let fit = CameraMap::from_points(&points(lens, 0.0), DISPLAY_PX, PHOTO_PX).unwrap();
            assert!(worst_px(&fit.map, lens) < 1e-6, "{lens:?}: {}", worst_px(&fit.map, lens));
            let [k1, k2, p1, p2] = fit.map.distortion();
            let off = [k1 - lens[0], k2, p1 - lens[1], p2];
            assert!(off.iter().all(|term| term.abs() < 1e-8), "{lens:?}: {off:?}");
            assert!(fit.residual_px < 1e-7 && fit.inliers == 144, "{fit:?}");
        }
    }

    #[test]
    fn wrong_points_change_distortion_little() {
        let lens = [0.01, 0.0];
        let mut pairs = points(lens, 0.3);
        pairs[5].camera[0] += 60.0;
        pairs[100].camera[1] -= 45.0;
        let fit = CameraMap::from_points(&pairs, DISPLAY_PX, PHOTO_PX).unwrap();
        assert_eq!(fit.inliers, 142);
        let [_, others @ ..] = fit.map.distortion();
        assert_eq!(others, [0.0; 3], "terms that the noise alone would give");
        assert!(worst_px(&fit.map, lens) < 0.3, "{}", worst_px(&fit.map, lens));
        // Uniform errors of up to 0.3 px of the camera along both axes, two of which are a pixel of the display.
        assert!((fit.residual_px - 0.3 * (2.0_f64 / 3.0).sqrt() / 2.0).abs() < 0.03, "{}", fit.residual_px);
    }

    #[test]
    fn straight_lens_and_few_points_keep_homography() {
        let few: Vec<PointPair> = points([0.01, 0.0], 0.3).into_iter().step_by(14).collect();
        assert_eq!(few.len(), DISTORTED_POINTS_MIN - 1);
        for pairs in [points([0.0; 2], 0.3), points([0.0; 2], 0.0), few] {
            let plain = Homography::from_points(&pairs).unwrap();
            let fit = CameraMap::from_points(&pairs, DISPLAY_PX, PHOTO_PX).unwrap();
            assert_eq!(fit.map.distortion(), [0.0; 4]);
            assert_eq!(fit.inliers, plain.inliers);
            for point in [[0.0, 0.0], [639.0, 359.0], [100.0, 300.0]] {
                assert!(distance(fit.map.apply(point), plain.homography.apply(point)) < 1e-8);
            }
        }
        assert!(CameraMap::from_points(&points([0.01, 0.0], 0.0)[..3], DISPLAY_PX, PHOTO_PX).is_err());
    }
}
