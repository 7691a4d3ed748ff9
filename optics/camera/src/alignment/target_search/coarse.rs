//! Search for a target in a photograph without a start: every scale, several turns, all mirror images.
//!
//! ```text
//! c(d) = ( S_tp − S_t S_p / N ) / √( (S_tt − S_t² / N) (S_pp − S_p² / N) ),   z(d) = atanh c(d) · √N
//! ```
//!
//! The S are sums over the N pixels in which the turned, scaled and shifted target and the photograph overlap, each
//! computed for all shifts d at once by Fourier transforms (D. Padfield, IEEE Trans. Image Processing 21, 2706 (2012)).
//! z compares places with different overlaps: for unrelated pictures it does not depend on N (R. Fisher 1915).

use super::pyramid::Pyramid;
use crate::alignment::box_blur::box_blur;
use crate::alignment::camera_map::{CameraMap, Frame};
use crate::alignment::homography::Point;
use lightpath_optics::Plane;
use lightpath_optics::reference::{Direction, fft2};
use num_complex::Complex64;
use rayon::prelude::*;

/// Longer side of the reduced photograph \[px\].
const PHOTO_PX: f64 = 56.0;
/// Side of the transforms \[px\]: room for the photograph and the largest target without overlap around the edges.
const SIDE: usize = 128;
/// Smallest and largest longer side of the target, in longer sides of the photograph.
pub(super) const SCALES: [f64; 2] = [0.3, 1.3];
const SCALE_STEP: f64 = 1.08;
/// Turns from x towards y \[degrees\].
const TURNS_DEG: [f64; 5] = [0.0, -5.0, 5.0, -10.0, 10.0];
/// Signs of x and y: as it is, mirrored, upside down, and turned by half a turn.
const FLIPS: [[f64; 2]; 4] = [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
/// Least part of the target that must lie inside the photograph.
const INSIDE_MIN: f64 = 0.6;
/// Places that are refined.
const PLACES: usize = 32;
/// Distance of places that count as the same \[reduced px\].
const SAME_PX: f64 = 2.5;

/// Where the target may be in the photograph, how large and how turned, and its z.
#[derive(Clone, Copy, Debug)]
struct Pose {
    z: f64,
    /// Scale \[camera px per target px\], turn and flip.
    scale: f64,
    turn: usize,
    flip: usize,
    /// Place of the target's centre \[camera px\].
    centre: Point,
}

/// The best places of the target in the photograph, the best first.
pub(super) fn places(target: &Pyramid, photo: &Pyramid) -> Vec<CameraMap> {
    let px = photo.whole().width_px().max(photo.whole().height_px()) as f64 / PHOTO_PX;
    let scene = Scene::of(photo, px);
    let longer = target.whole().width_px().max(target.whole().height_px()) as f64;
    let count = ((SCALES[1] / SCALES[0]).ln() / SCALE_STEP.ln()).floor() as usize + 1;
    let all: Vec<(usize, usize, usize)> = (0..count)
        .flat_map(|scale| {
            (0..TURNS_DEG.len()).flat_map(move |turn| (0..FLIPS.len()).map(move |flip| (scale, turn, flip)))
        })
        .collect();
    let mut found: Vec<Pose> = all
        .into_par_iter()
        .filter_map(|(step, turn, flip)| {
            let scale = SCALES[0] * SCALE_STEP.powi(step as i32) * PHOTO_PX * px / longer;
            scene.place(target, Pose { z: 0.0, scale, turn, flip, centre: [0.0; 2] })
        })
        .collect();
    found.sort_by(|a, b| b.z.total_cmp(&a.z));
    let (target, camera) = (Frame::of(target.whole()), Frame::of(photo.whole()));
    distinct(found, px).iter().map(|place| place.map(target, camera)).collect()
}

/// The best places without those that lead to the same refined place.
fn distinct(found: Vec<Pose>, px: f64) -> Vec<Pose> {
    let mut kept: Vec<Pose> = Vec::new();
    for place in found {
        let same = |other: &Pose| {
            let apart = (place.centre[0] - other.centre[0]).hypot(place.centre[1] - other.centre[1]);
            let alike = (place.scale / other.scale).ln().abs() < 1.5 * SCALE_STEP.ln();
            place.flip == other.flip && alike && apart < SAME_PX * px
        };
        if kept.len() < PLACES && !kept.iter().any(same) {
            kept.push(place);
        }
    }
    kept
}

impl Pose {
    /// The matrix from the target's pixels to the camera's.
    fn matrix(&self) -> [[f64; 2]; 2] {
        let (sine, cosine) = TURNS_DEG[self.turn].to_radians().sin_cos();
        let [x, y] = FLIPS[self.flip].map(|sign| sign * self.scale);
        [[cosine * x, -sine * y], [sine * x, cosine * y]]
    }

    fn map(&self, target: Frame, camera: Frame) -> CameraMap {
        CameraMap::affine(target, camera, self.matrix(), self.centre)
    }
}

/// The reduced photograph, ready for comparisons.
struct Scene {
    /// Camera pixels along the side of a reduced pixel.
    px: f64,
    /// Spectra of the photograph's area, its light, and the light's square.
    area: Plane<Complex64>,
    light: Plane<Complex64>,
    squares: Plane<Complex64>,
}

impl Scene {
    fn of(photo: &Pyramid, px: f64) -> Self {
        let side = |length: usize| ((length as f64 / px).round() as usize).clamp(1, SIDE);
        let (height, width) = (side(photo.whole().height_px()), side(photo.whole().width_px()));
        let reduced = box_blur(&Plane::from_fn(height, width, |y, x| mean(photo, px, [x, y])), 1, 1);
        let spectrum = |of: &dyn Fn(f64) -> f64| {
            let padded = Plane::from_fn(SIDE, SIDE, |y, x| {
                let value = if y < height && x < width { of(f64::from(reduced.at(y, x))) } else { 0.0 };
                Complex64::from(value)
            });
            fft2(&padded, Direction::Forward)
        };
        Self { px, area: spectrum(&|_| 1.0), light: spectrum(&|v| v), squares: spectrum(&|v| v * v) }
    }

    /// The best shift of a scaled, turned and flipped target. `None` if it does not fit into the transform.
    fn place(&self, target: &Pyramid, place: Pose) -> Option<Pose> {
        let (template, start) = self.template(target, &place)?;
        let plane = |of: &dyn Fn(Option<f64>) -> Complex64| {
            fft2(&Plane::from_fn(SIDE, SIDE, |y, x| of(template.at(y, x).map(f64::from))), Direction::Forward)
        };
        // Two real planes make one complex transform: light and its square in one, the area in another.
        let both = plane(&|v| v.map_or(Complex64::ZERO, |v| Complex64::new(v, v * v)));
        let area = plane(&|v| Complex64::from(if v.is_some() { 1.0 } else { 0.0 }));
        let [light, squares] = separated(&both);
        let correlated = |a: [&Plane<Complex64>; 2], b: [&Plane<Complex64>; 2]| {
            let values = (0..SIDE * SIDE).map(|i| {
                let product = |pair: [&Plane<Complex64>; 2]| pair[0].values()[i].conj() * pair[1].values()[i];
                product(a) + Complex64::I * product(b)
            });
            let sum = Plane::try_from_vec(SIDE, SIDE, values.collect()).ok()?;
            Some(fft2(&sum, Direction::Inverse))
        };
        let sums = [
            correlated([&area, &self.area], [&light, &self.light])?,
            correlated([&light, &self.area], [&squares, &self.area])?,
            correlated([&area, &self.light], [&area, &self.squares])?,
        ];
        let total = template.values().iter().flatten().count() as f64;
        let best = (0..SIDE * SIDE).map(|i| (z([0, 1, 2].map(|k| sums[k].values()[i]), total), i));
        let (z, i) = best.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let signed = |v: usize| if v < SIDE * 5 / 8 { v as f64 } else { v as f64 - SIDE as f64 };
        let at = |v: usize, start: f64| self.px * (signed(v) - start + 0.5) - 0.5;
        let centre = [at(i % SIDE, start[0]), at(i / SIDE, start[1])];
        z.is_finite().then_some(Pose { z, centre, ..place })
    }

    /// The target as the place shows it, in reduced pixels from the upper left corner, and the position of that corner
    /// relative to the target's centre. `None` if the target is too large.
    fn template(&self, target: &Pyramid, place: &Pose) -> Option<(Plane<Option<f32>>, Point)> {
        let [[xx, xy], [yx, yy]] = place.matrix();
        let size = [target.whole().width_px() as f64, target.whole().height_px() as f64];
        let half = [xx.abs() * size[0] + xy.abs() * size[1], yx.abs() * size[0] + yy.abs() * size[1]]
            .map(|extent| (extent / self.px / 2.0).ceil());
        if half.iter().any(|half| 2.0 * half >= (SIDE * 5 / 8) as f64) {
            return None;
        }
        let determinant = xx * yy - xy * yx;
        let inverse = [[yy / determinant, -xy / determinant], [-yx / determinant, xx / determinant]];
        let step = self.px / place.scale;
        let (height, width) = (2 * half[1] as usize + 1, 2 * half[0] as usize + 1);
        let template = Plane::from_fn(SIDE, SIDE, |y, x| {
            if y >= height || x >= width {
                return None;
            }
            let offset = [(x as f64 - half[0]) * self.px, (y as f64 - half[1]) * self.px];
            let at = |axis: usize| {
                let along = inverse[axis][0] * offset[0] + inverse[axis][1] * offset[1];
                along + (size[axis] - 1.0) / 2.0
            };
            area_mean(target, step, [at(0), at(1)])
        });
        Some((template, half.map(|half| -half)))
    }
}

/// Light of the reduced pixel (x, y) of a photograph.
fn mean(photo: &Pyramid, px: f64, [x, y]: [usize; 2]) -> f32 {
    let at = |i: usize| px * (i as f64 + 0.5) - 0.5;
    area_mean(photo, px, [at(x), at(y)]).unwrap_or(0.0)
}

/// Mean of nine values in the square around a point whose side is 1.5 · `px`; `None` outside of the picture. So much
/// blur makes the correlation's peak as wide as the steps of the search.
fn area_mean(picture: &Pyramid, px: f64, [x, y]: Point) -> Option<f32> {
    let step = picture.step_below(px / 2.0);
    let centre = picture.value(step, [x, y])?;
    let (mut sum, mut count) = (centre, 1.0);
    for [dx, dy] in
        [[-1.0, -1.0], [0.0, -1.0], [1.0, -1.0], [-1.0, 0.0], [1.0, 0.0], [-1.0, 1.0], [0.0, 1.0], [1.0, 1.0]]
    {
        if let Some(value) = picture.value(step, [x + 0.5 * px * dx, y + 0.5 * px * dy]) {
            (sum, count) = (sum + value, count + 1.0);
        }
    }
    Some(sum / count)
}

/// The spectra of the real and the imaginary part of a plane, from the plane's spectrum.
fn separated(both: &Plane<Complex64>) -> [Plane<Complex64>; 2] {
    let mirrored = |y: usize, x: usize| both.at((SIDE - y) % SIDE, (SIDE - x) % SIDE).conj();
    [
        Plane::from_fn(SIDE, SIDE, |y, x| (both.at(y, x) + mirrored(y, x)) / 2.0),
        Plane::from_fn(SIDE, SIDE, |y, x| (both.at(y, x) - mirrored(y, x)) / Complex64::new(0.0, 2.0)),
    ]
}

/// z of one shift. The sums are N and S_tp, S_t and S_tt, S_p and S_pp, as real and imaginary parts.
fn z([first, target, photo]: [Complex64; 3], total: f64) -> f64 {
    let (n, product) = (first.re, first.im);
    if n < INSIDE_MIN * total {
        return f64::NEG_INFINITY;
    }
    let variance = |sums: Complex64| sums.im - sums.re * sums.re / n;
    let both = variance(target).max(0.0) * variance(photo).max(0.0);
    let covariance = product - target.re * photo.re / n;
    // Rounding leaves a little variance where there is none.
    if both <= (1e-9 * n * n).powi(2) {
        f64::NEG_INFINITY
    } else {
        (covariance / both.sqrt()).clamp(-0.999, 0.999).atanh() * n.sqrt()
    }
}
