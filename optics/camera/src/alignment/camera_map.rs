//! The map from a picture to a camera: perspective, then the lens's distortion.
//!
//! ```text
//! u = ( a₀ + a₁ξ + a₂η,  b₀ + b₁ξ + b₂η ) / (1 + gξ + hη),   r = |u|
//! v = u (1 + k₁ r² + k₂ r⁴) + ( 2 p₁ u₁u₂ + p₂ (r² + 2 u₁²),  p₁ (r² + 2 u₂²) + 2 p₂ u₁u₂ )
//! ```
//!
//! (ξ, η) is the point of the picture relative to the picture's centre, in halves of its diagonal. v is the point of
//! the photograph relative to the photograph's centre, in halves of its diagonal, so r = 1 in the photograph's corners.
//! The distortion is that of D. C. Brown, Photogrammetric Engineering 37, 855 (1971): radial, and decentring for lenses
//! that are tilted or off their axis.

use super::error::AlignmentError;
use super::homography::{Homography, Point};
use lightpath_optics::Plane;

/// Number of parameters: six of an affine map, two of the perspective, four of the distortion.
pub(super) const PARAMETERS: usize = 12;

/// The map from a point of the target to its place in the photograph, both in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraMap {
    /// a₀, a₁, a₂, b₀, b₁, b₂, g, h, k₁, k₂, p₁, p₂.
    parameters: [f64; PARAMETERS],
    target: Frame,
    camera: Frame,
}

/// Centre and half diagonal of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Frame {
    centre: Point,
    half_px: f64,
}

impl Frame {
    pub(super) fn of(plane: &Plane<f32>) -> Self {
        Self::of_size(plane.height_px(), plane.width_px())
    }

    pub(super) fn of_size(height_px: usize, width_px: usize) -> Self {
        let (width, height) = (width_px as f64, height_px as f64);
        Self { centre: [(width - 1.0) / 2.0, (height - 1.0) / 2.0], half_px: width.hypot(height) / 2.0 }
    }
}

impl CameraMap {
    /// The affine map p ↦ `place` + `matrix` (p − centre of the target), without perspective and distortion.
    pub(super) fn affine(target: Frame, camera: Frame, matrix: [[f64; 2]; 2], place: Point) -> Self {
        let ratio = target.half_px / camera.half_px;
        let [[xx, xy], [yx, yy]] = matrix;
        let start = [0, 1].map(|axis| (place[axis] - camera.centre[axis]) / camera.half_px);
        let mut parameters = [0.0; PARAMETERS];
        parameters[..6].copy_from_slice(&[start[0], xx * ratio, xy * ratio, start[1], yx * ratio, yy * ratio]);
        Self { parameters, target, camera }
    }

    /// The map of a homography, without distortion.
    pub(super) fn of_homography(target: Frame, camera: Frame, homography: &Homography) -> Self {
        let place = |frame: Frame| {
            let [x, y] = frame.centre;
            Homography::similarity([0.0; 2], 0.0, 1.0 / frame.half_px, [-x / frame.half_px, -y / frame.half_px])
        };
        let [a1, a2, a0, b1, b2, b0, g, h, _] =
            place(camera).after(homography).after(&place(target).inverse()).entries();
        Self { parameters: [a0, a1, a2, b0, b1, b2, g, h, 0.0, 0.0, 0.0, 0.0], target, camera }
    }

    /// Creates the map of a homography, followed by the distortion k₁, k₂, p₁ and p₂. `target_px` and `photo_px` are the
    /// rows and columns of the target and of the photograph.
    ///
    /// # Errors
    ///
    /// [`AlignmentError::Impossible`] for a distortion that is not finite.
    pub fn try_new(
        homography: &Homography,
        distortion: [f64; 4],
        target_px: [usize; 2],
        photo_px: [usize; 2],
    ) -> Result<Self, AlignmentError> {
        if distortion.iter().any(|value| !value.is_finite()) {
            return Err(AlignmentError::Impossible("a lens's distortion must be finite numbers".to_owned()));
        }
        let frame = |[height_px, width_px]: [usize; 2]| Frame::of_size(height_px, width_px);
        let mut map = Self::of_homography(frame(target_px), frame(photo_px), homography);
        map.parameters[8..].copy_from_slice(&distortion);
        Ok(map)
    }

    /// The composition that applies `first` to a point of the target, then this map.
    #[must_use]
    pub fn after(&self, first: &Homography) -> Self {
        let mut map = Self::of_homography(self.target, self.camera, &self.homography().after(first));
        map.parameters[8..].copy_from_slice(&self.distortion());
        map
    }

    /// Place of a point of the target in the photograph \[px\]. NaN for a point that the perspective sends to infinity.
    #[must_use]
    pub fn apply(&self, point: Point) -> Point {
        let [a0, a1, a2, b0, b1, b2, g, h, ..] = self.parameters;
        let [xi, eta] = self.relative(point);
        let w = 1.0 + g * xi + h * eta;
        if w <= 0.0 {
            return [f64::NAN; 2];
        }
        let v = self.distorted([(a0 + a1 * xi + a2 * eta) / w, (b0 + b1 * xi + b2 * eta) / w]);
        [0, 1].map(|axis| self.camera.centre[axis] + self.camera.half_px * v[axis])
    }

    fn distorted(&self, u: Point) -> Point {
        let [.., k1, k2, p1, p2] = self.parameters;
        let r2 = u[0] * u[0] + u[1] * u[1];
        let (stretch, cross) = (1.0 + k1 * r2 + k2 * r2 * r2, 2.0 * u[0] * u[1]);
        [
            u[0] * stretch + p1 * cross + p2 * (r2 + 2.0 * u[0] * u[0]),
            u[1] * stretch + p1 * (r2 + 2.0 * u[1] * u[1]) + p2 * cross,
        ]
    }

    /// The perspective alone, without the distortion.
    #[must_use]
    pub fn homography(&self) -> Homography {
        let [a0, a1, a2, b0, b1, b2, g, h, ..] = self.parameters;
        let ([tx, ty], s) = (self.target.centre, 1.0 / self.target.half_px);
        let ([cx, cy], half) = (self.camera.centre, self.camera.half_px);
        let shrink = Homography::similarity([0.0; 2], 0.0, s, [-s * tx, -s * ty]);
        let grow = Homography::similarity([0.0; 2], 0.0, half, [cx, cy]);
        // Every search ends with an invertible map; a degenerate one is refused before.
        let middle = Homography::try_new([a1, a2, a0, b1, b2, b0, g, h, 1.0]).unwrap_or(Homography::IDENTITY);
        grow.after(&middle).after(&shrink)
    }

    /// The distortion's k₁, k₂, p₁ and p₂, for a radius of 1 in the photograph's corners.
    #[must_use]
    pub fn distortion(&self) -> [f64; 4] {
        let [.., k1, k2, p1, p2] = self.parameters;
        [k1, k2, p1, p2]
    }

    /// Number of camera pixels along the side of one pixel at `point`: the square root of its area. NaN at infinity.
    #[must_use]
    pub fn magnification(&self, point: Point) -> f64 {
        self.determinant(point).abs().sqrt()
    }

    /// Whether the photograph shows the target as in a mirror.
    #[must_use]
    pub fn is_mirrored(&self) -> bool {
        self.determinant(self.target.centre) < 0.0
    }

    fn determinant(&self, [x, y]: Point) -> f64 {
        let [start, right, below] = [[x, y], [x + 1.0, y], [x, y + 1.0]].map(|point| self.apply(point));
        let (u, v) = ([right[0] - start[0], right[1] - start[1]], [below[0] - start[0], below[1] - start[1]]);
        u[0] * v[1] - u[1] * v[0]
    }

    /// Centre of the target.
    pub(super) fn target_centre(&self) -> Point {
        self.target.centre
    }

    /// The place of a point, and its derivatives by the parameters \[px\].
    pub(super) fn derivatives(&self, point: Point) -> (Point, [[f64; PARAMETERS]; 2]) {
        let [a0, a1, a2, b0, b1, b2, g, h, k1, k2, p1, p2] = self.parameters;
        let [xi, eta] = self.relative(point);
        let w = 1.0 / (1.0 + g * xi + h * eta);
        let u = [(a0 + a1 * xi + a2 * eta) * w, (b0 + b1 * xi + b2 * eta) * w];
        let r2 = u[0] * u[0] + u[1] * u[1];
        let (stretch, bend) = (1.0 + k1 * r2 + k2 * r2 * r2, 2.0 * k1 + 4.0 * k2 * r2);
        let half = self.camera.half_px;
        let v = self.distorted(u);
        let place = [0, 1].map(|axis| self.camera.centre[axis] + half * v[axis]);
        let (cross, off_axis) = (2.0 * u[0] * u[1], 2.0 * (p1 * u[0] + p2 * u[1]));
        let on_axis = 2.0 * (p1 * u[1] + p2 * u[0]);
        let bent = [[on_axis + 4.0 * p2 * u[0], off_axis], [off_axis, on_axis + 4.0 * p1 * u[1]]];
        let decentred = [[cross, r2 + 2.0 * u[0] * u[0]], [r2 + 2.0 * u[1] * u[1], cross]];
        let rows = [0, 1].map(|axis| {
            // The derivatives of v along this axis by u.
            let own = |other: usize| if axis == other { stretch } else { 0.0 };
            let by = [0, 1].map(|other| half * (bend * u[axis] * u[other] + own(other) + bent[axis][other]));
            let towards = by[0] * u[0] + by[1] * u[1];
            [
                by[0] * w,
                by[0] * w * xi,
                by[0] * w * eta,
                by[1] * w,
                by[1] * w * xi,
                by[1] * w * eta,
                -towards * w * xi,
                -towards * w * eta,
                half * u[axis] * r2,
                half * u[axis] * r2 * r2,
                half * decentred[axis][0],
                half * decentred[axis][1],
            ]
        });
        (place, rows)
    }

    pub(super) fn parameters(&self) -> &[f64; PARAMETERS] {
        &self.parameters
    }

    /// The map with its parameters changed.
    pub(super) fn moved(&self, step: &[f64; PARAMETERS]) -> Self {
        Self { parameters: std::array::from_fn(|i| self.parameters[i] + step[i]), ..*self }
    }

    fn relative(&self, point: Point) -> Point {
        [0, 1].map(|axis| (point[axis] - self.target.centre[axis]) / self.target.half_px)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> CameraMap {
        let step = [0.01, 0.0, 0.0, -0.02, 0.0, 0.0, 0.03, -0.02, 0.05, -0.02, 0.01, -0.015];
        let (target, camera) = (Frame::of(&Plane::filled(90, 160, 0.0)), Frame::of(&Plane::filled(100, 200, 0.0)));
        CameraMap::affine(target, camera, [[0.9, 0.02], [-0.03, 0.91]], camera.centre).moved(&step)
    }

    #[test]
    fn derivatives_match_differences() {
        let (map, point) = (example(), [31.0, 70.0]);
        let (place, rows) = map.derivatives(point);
        let there = map.apply(point);
        assert!((place[0] - there[0]).abs() < 1e-9 && (place[1] - there[1]).abs() < 1e-9);
        for (parameter, slopes) in rows[0].iter().zip(&rows[1]).enumerate() {
            let at = |by: f64| map.moved(&std::array::from_fn(|i| if i == parameter { by } else { 0.0 })).apply(point);
            let (after, before) = (at(1e-6), at(-1e-6));
            for (axis, slope) in [slopes.0, slopes.1].into_iter().enumerate() {
                let difference = (after[axis] - before[axis]) / 2e-6;
                assert!((difference - slope).abs() < 1e-4, "{parameter}: {difference}");
            }
        }
    }

    #[test]
    fn homography_is_the_map_without_distortion() {
        let mut flat = example();
        flat.parameters[8..].fill(0.0);
        let homography = example().homography();
        for point in [[0.0, 0.0], [159.0, 3.0], [60.0, 89.0]] {
            let (a, b) = (flat.apply(point), homography.apply(point));
            assert!((a[0] - b[0]).abs() < 1e-9 && (a[1] - b[1]).abs() < 1e-9, "{a:?} {b:?}");
        }
        assert_eq!(example().distortion(), [0.05, -0.02, 0.01, -0.015]);
        let again = CameraMap::try_new(&homography, example().distortion(), [90, 160], [100, 200]).unwrap();
        let shift = Homography::similarity([0.0; 2], 0.0, 1.0, [3.0, -2.0]);
        for (a, b) in [
            (again.apply([20.0, 70.0]), example().apply([20.0, 70.0])),
            (again.after(&shift).apply([20.0, 70.0]), example().apply([23.0, 68.0])),
        ] {
            assert!((a[0] - b[0]).abs() < 1e-9 && (a[1] - b[1]).abs() < 1e-9, "{a:?} {b:?}");
        }
        assert!(CameraMap::try_new(&homography, [0.0, f64::NAN, 0.0, 0.0], [90, 160], [100, 200]).is_err());
        assert!(!example().is_mirrored() && (example().magnification([80.0, 45.0]) - 0.9).abs() < 0.05);
    }
}
