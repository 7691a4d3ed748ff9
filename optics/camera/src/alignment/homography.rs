//! Homographies: projective maps from plane to plane, as a camera makes them.
//!
//! ```text
//! (x', y') = ( (h₀x + h₁y + h₂) / w, (h₃x + h₄y + h₅) / w ),   w = h₆x + h₇y + h₈
//! ```
//!
//! A fit to points starts with the direct linear transform on normalized coordinates (R. Hartley, IEEE TPAMI 19, 580
//! (1997)). Gauss–Newton then minimizes the distances in the camera's plane, with Huber's weights against wrong points.

use super::error::AlignmentError;
use lightpath_optics::numerics::least_squares::NormalEquations;

/// A point: x and y \[px\].
pub type Point = [f64; 2];

/// A point of the image plane \[display px\] and its position in the photograph \[camera px\].
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PointPair {
    /// Position in pixels of the display.
    pub display: Point,
    /// Position in pixels of the camera.
    pub camera: Point,
}

/// A projective map of the plane, from the display's pixels to the camera's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Homography([f64; 9]);

/// A homography that was fitted to points, and the quality of the fit.
#[derive(Clone, Debug, PartialEq)]
pub struct PointFit {
    /// The fitted map.
    pub homography: Homography,
    /// Root mean square distance of the inliers from the map \[display px\].
    pub residual_px: f64,
    /// Number of inliers: points at a distance of at most four typical ones.
    pub inliers: usize,
}

/// Distance, in typical distances, beyond which Huber's weight of a point falls as 1/distance.
const HUBER_DEVIATIONS: f64 = 1.5;
/// Largest distance of an inlier, in typical distances. Points beyond it are left out of the residual.
const OUTLIER_DEVIATIONS: f64 = 4.0;
const ITERATIONS_MAX: usize = 60;

impl Homography {
    /// The identity, which maps each point to itself.
    pub const IDENTITY: Self = Self([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);

    /// Creates a homography from its nine entries h₀ … h₈, row by row.
    ///
    /// # Errors
    ///
    /// [`AlignmentError::Impossible`] for entries that are not finite, or a map that has no inverse.
    pub fn try_new(entries: [f64; 9]) -> Result<Self, AlignmentError> {
        if entries.iter().any(|entry| !entry.is_finite()) {
            return Err(AlignmentError::Impossible("a homography's entries must be finite numbers".to_owned()));
        }
        let homography = Self(entries).normalized();
        match homography.determinant().abs() > 1e-12 && homography.0.iter().all(|entry| entry.is_finite()) {
            true => Ok(homography),
            false => Err(AlignmentError::Impossible("the homography maps the plane to a line".to_owned())),
        }
    }

    /// Creates a rotation by `angle_rad` (from x towards y) and scaling about `centre`, followed by a shift.
    #[must_use]
    pub fn similarity(centre: Point, angle_rad: f64, scale: f64, shift: Point) -> Self {
        let (sine, cosine) = angle_rad.sin_cos();
        let [a, b] = [scale * cosine, scale * sine];
        let [x, y] = centre;
        Self([a, -b, x - a * x + b * y + shift[0], b, a, y - b * x - a * y + shift[1], 0.0, 0.0, 1.0])
    }

    /// The nine entries, row by row. The last is 1 unless the map sends the origin to infinity.
    #[must_use]
    pub fn entries(&self) -> [f64; 9] {
        self.0
    }

    /// Maps a point.
    #[must_use]
    pub fn apply(&self, [x, y]: Point) -> Point {
        let h = &self.0;
        let w = h[6] * x + h[7] * y + h[8];
        [(h[0] * x + h[1] * y + h[2]) / w, (h[3] * x + h[4] * y + h[5]) / w]
    }

    /// The composition that applies `first`, then this map.
    #[must_use]
    pub fn after(&self, first: &Self) -> Self {
        let (a, b) = (&self.0, &first.0);
        Self(std::array::from_fn(|i| (0..3).map(|k| a[i / 3 * 3 + k] * b[k * 3 + i % 3]).sum())).normalized()
    }

    /// The inverse map.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let [a, b, c, d, e, f, g, h, i] = self.0;
        let adjugate = [
            e * i - f * h,
            c * h - b * i,
            b * f - c * e,
            f * g - d * i,
            a * i - c * g,
            c * d - a * f,
            d * h - e * g,
            b * g - a * h,
            a * e - b * d,
        ];
        Self(adjugate).normalized()
    }

    /// Number of camera pixels along the side of one display pixel at `point`: the square root of its area in camera
    /// pixels.
    #[must_use]
    pub fn magnification(&self, point: Point) -> f64 {
        let [x, y] = self.apply(point);
        let along = |step: Point| {
            let [a, b] = self.apply([point[0] + step[0], point[1] + step[1]]);
            [a - x, b - y]
        };
        let (u, v) = (along([1.0, 0.0]), along([0.0, 1.0]));
        (u[0] * v[1] - u[1] * v[0]).abs().sqrt()
    }

    /// Fits the map from the points' display side to their camera side, by the distances in the camera's plane.
    ///
    /// # Errors
    ///
    /// [`AlignmentError::TooFewPoints`] for fewer than 4 points, [`AlignmentError::Degenerate`] for points on a line,
    /// [`AlignmentError::Impossible`] for coordinates that are not finite.
    pub fn from_points(pairs: &[PointPair]) -> Result<PointFit, AlignmentError> {
        if pairs.len() < 4 {
            return Err(AlignmentError::TooFewPoints(pairs.len()));
        }
        if pairs.iter().any(|pair| pair.display.iter().chain(&pair.camera).any(|value| !value.is_finite())) {
            return Err(AlignmentError::Impossible("a point's coordinates must be finite numbers".to_owned()));
        }
        let from = Normalization::of(pairs.iter().map(|pair| pair.display)).ok_or(AlignmentError::Degenerate)?;
        let to = Normalization::of(pairs.iter().map(|pair| pair.camera)).ok_or(AlignmentError::Degenerate)?;
        let points: Vec<(Point, Point)> =
            pairs.iter().map(|pair| (from.apply(pair.display), to.apply(pair.camera))).collect();
        let mut parameters = direct_linear_transform(&points).ok_or(AlignmentError::Degenerate)?;
        for _ in 0..ITERATIONS_MAX {
            let Some(step) = gauss_newton_step(&parameters, &points) else { break };
            parameters.iter_mut().zip(step).for_each(|(h, change)| *h += change);
            if step.iter().all(|change| change.abs() < 1e-13) {
                break;
            }
        }
        let homography = to.homography().inverse().after(&Self::of(&parameters)).after(&from.homography());
        let homography = Self::try_new(homography.0).map_err(|_| AlignmentError::Degenerate)?;
        let back = homography.magnification(from.centre);
        let (inliers, residual) = inliers(pairs, |point| homography.apply(point));
        Ok(PointFit { homography, residual_px: residual / back, inliers })
    }

    fn of(parameters: &[f64; 8]) -> Self {
        let [a, b, c, d, e, f, g, h] = *parameters;
        Self([a, b, c, d, e, f, g, h, 1.0])
    }

    fn determinant(&self) -> f64 {
        let [a, b, c, d, e, f, g, h, i] = self.0;
        a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    }

    fn normalized(self) -> Self {
        let last = self.0[8];
        let largest = self.0.iter().fold(0.0_f64, |most, entry| most.max(entry.abs()));
        if last.abs() > 1e-12 * largest { Self(self.0.map(|entry| entry / last)) } else { self }
    }
}

/// Shift and scale that centre points on the origin, at a mean distance of √2.
struct Normalization {
    centre: Point,
    scale: f64,
}

impl Normalization {
    fn of(points: impl Iterator<Item = Point> + Clone) -> Option<Self> {
        let count = points.clone().count() as f64;
        let sum = points.clone().fold([0.0; 2], |sum, p| [sum[0] + p[0], sum[1] + p[1]]);
        let centre = sum.map(|value| value / count);
        let mean = points.map(|point| distance(point, centre)).sum::<f64>() / count;
        (mean > 0.0 && mean.is_finite()).then(|| Self { centre, scale: 2.0_f64.sqrt() / mean })
    }

    fn apply(&self, [x, y]: Point) -> Point {
        [self.scale * (x - self.centre[0]), self.scale * (y - self.centre[1])]
    }

    fn homography(&self) -> Homography {
        let (s, [x, y]) = (self.scale, self.centre);
        Homography([s, 0.0, -s * x, 0.0, s, -s * y, 0.0, 0.0, 1.0])
    }
}

/// Solves for h₀ … h₇ with h₈ = 1, which is allowed because the centre of the points is not mapped to infinity.
fn direct_linear_transform(points: &[(Point, Point)]) -> Option<[f64; 8]> {
    let mut equations = NormalEquations::<8>::none();
    for &([x, y], [u, v]) in points {
        equations.add(&[x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y], u, 1.0);
        equations.add(&[0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y], v, 1.0);
    }
    equations.solve()
}

fn gauss_newton_step(parameters: &[f64; 8], points: &[(Point, Point)]) -> Option<[f64; 8]> {
    let map = Homography::of(parameters);
    let distances: Vec<f64> = points.iter().map(|&(from, to)| distance(map.apply(from), to)).collect();
    let mut equations = NormalEquations::<8>::none();
    for (&([x, y], to), weight) in points.iter().zip(huber_weights(&distances)) {
        let [u, v] = map.apply([x, y]);
        let w = 1.0 / (parameters[6] * x + parameters[7] * y + 1.0);
        equations.add(&[x * w, y * w, w, 0.0, 0.0, 0.0, -u * x * w, -u * y * w], to[0] - u, weight);
        equations.add(&[0.0, 0.0, 0.0, x * w, y * w, w, -v * x * w, -v * y * w], to[1] - v, weight);
    }
    equations.solve()
}

/// Number of inliers of a map, and their root mean square distance from it \[px of the camera\].
pub(super) fn inliers(pairs: &[PointPair], map: impl Fn(Point) -> Point) -> (usize, f64) {
    let mut distances: Vec<f64> = pairs.iter().map(|pair| distance(map(pair.display), pair.camera)).collect();
    distances.sort_by(f64::total_cmp);
    let limit = OUTLIER_DEVIATIONS * typical(&distances) + 1e-9;
    let inliers = distances.iter().filter(|&&distance| distance <= limit).count().max(1);
    let squares: f64 = distances.iter().take(inliers).map(|distance| distance * distance).sum();
    (inliers, (squares / inliers as f64).sqrt())
}

/// Huber's weight of each distance: 1, and less beyond [`HUBER_DEVIATIONS`] typical distances.
pub(super) fn huber_weights(distances: &[f64]) -> Vec<f64> {
    let mut sorted = distances.to_vec();
    sorted.sort_by(f64::total_cmp);
    let threshold = HUBER_DEVIATIONS * typical(&sorted);
    let weight = |&distance: &f64| if distance > threshold && threshold > 0.0 { threshold / distance } else { 1.0 };
    distances.iter().map(weight).collect()
}

/// The standard deviation along one axis of normally distributed errors with this median distance.
fn typical(sorted: &[f64]) -> f64 {
    const MEDIAN_OF_RAYLEIGH: f64 = 1.177_41;
    sorted[sorted.len() / 2] / MEDIAN_OF_RAYLEIGH
}

pub(super) fn distance(a: Point, b: Point) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn perspective() -> Homography {
        let tilt = Homography::try_new([1.9, 0.04, 120.0, -0.03, 2.1, 75.0, 3e-5, -5e-5, 1.0]).unwrap();
        tilt.after(&Homography::similarity([320.0, 180.0], 0.03, 1.0, [2.0, -1.0]))
    }

    fn pairs(map: &Homography) -> Vec<PointPair> {
        (0..35)
            .map(|i| [30.0 + 90.0 * f64::from(i % 7), 25.0 + 70.0 * f64::from(i / 7)])
            .map(|display| PointPair { display, camera: map.apply(display) })
            .collect()
    }

    #[test]
    fn four_or_more_exact_points_give_exact_map() {
        let truth = perspective();
        let all = pairs(&truth);
        for chosen in [vec![all[0], all[6], all[28], all[34]], all] {
            let fit = Homography::from_points(&chosen).unwrap();
            assert!(fit.residual_px < 1e-9, "{}", fit.residual_px);
            for point in [[0.0, 0.0], [640.0, 360.0], [100.0, 300.0]] {
                assert!(distance(fit.homography.apply(point), truth.apply(point)) < 1e-6);
            }
        }
    }

    #[test]
    fn few_wrong_points_change_map_little() {
        let truth = perspective();
        let mut all = pairs(&truth);
        for (i, pair) in all.iter_mut().enumerate() {
            let noise = [(i * 37 % 11) as f64 / 11.0 - 0.45, (i * 53 % 13) as f64 / 13.0 - 0.46];
            pair.camera = [pair.camera[0] + 0.2 * noise[0], pair.camera[1] + 0.2 * noise[1]];
        }
        all[5].camera[0] += 40.0;
        all[20].camera[1] -= 25.0;
        let fit = Homography::from_points(&all).unwrap();
        assert_eq!(fit.inliers, 33);
        for point in [[30.0, 25.0], [570.0, 305.0]] {
            let error = distance(fit.homography.apply(point), truth.apply(point));
            assert!(error < 0.2, "{error}");
        }
    }

    #[test]
    fn inverse_after_map_is_identity() {
        let map = perspective();
        let round = map.inverse().after(&map);
        for point in [[0.0, 0.0], [1919.0, 3.0], [500.5, 1079.0]] {
            assert!(distance(round.apply(point), point) < 1e-8);
        }
        let turned = Homography::similarity([10.0, 20.0], 1.0, 2.0, [1.0, 0.0]);
        assert!(distance(turned.apply([10.0, 20.0]), [11.0, 20.0]) < 1e-12);
        assert!((turned.magnification([3.0, 4.0]) - 2.0).abs() < 1e-9);
    }

    #[test]
    fn degenerate_and_invalid_points_are_refused() {
        let line: Vec<_> = (0..9).map(f64::from).map(|t| PointPair { display: [t, 2.0 * t], camera: [t, t] }).collect();
        assert_eq!(Homography::from_points(&line), Err(AlignmentError::Degenerate));
        assert_eq!(Homography::from_points(&line[..3]), Err(AlignmentError::TooFewPoints(3)));
        let mut bad = pairs(&perspective());
        bad[3].camera[0] = f64::NAN;
        assert!(matches!(Homography::from_points(&bad), Err(AlignmentError::Impossible(_))));
        assert!(Homography::try_new([1.0, 2.0, 0.0, 2.0, 4.0, 0.0, 0.0, 0.0, 1.0]).is_err());
    }
}
