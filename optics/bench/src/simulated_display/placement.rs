//! Where the camera sees the image: rotation, drift, and distortion by its lens.
//!
//! ```text
//! image(p) = light( m + R (p − m) (1 + k |p − m|² / c²) + d )
//! ```
//!
//! R is a rotation about the middle m, d the drift of the image, k the radial distortion and c the distance of the
//! corner from the middle. Light between pixels is interpolated by Catmull and Rom's cubic. It blurs the finest detail
//! of the image, but the pixels of a turned camera would blur that as well.

use lightpath_optics::{Plane, interrupt};
use rayon::prelude::*;

/// What a camera sees of the image plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct View {
    pub(super) rotation_rad: f64,
    pub(super) drift_px: (f64, f64),
    /// Displacement of the corner, as a part of its distance from the middle.
    pub(super) distortion: f64,
}

impl View {
    fn is_straight(&self) -> bool {
        *self == Self { rotation_rad: 0.0, drift_px: (0.0, 0.0), distortion: 0.0 }
    }

    /// The light at each pixel of the camera.
    pub(super) fn of(&self, light: &Plane<f64>) -> Plane<f64> {
        if self.is_straight() {
            return light.clone();
        }
        let (height_px, width_px) = (light.height_px(), light.width_px());
        let mut image = Plane::filled(height_px, width_px, 0.0);
        image.values_mut().par_chunks_mut(width_px).enumerate().for_each(|(y, out)| {
            interrupt::check();
            for (x, out) in out.iter_mut().enumerate() {
                let sum: f64 = self.taps(light, y, x).map(|(at, weight)| weight * light.values()[at]).sum();
                *out = sum.max(0.0);
            }
        });
        image
    }

    /// The adjoint of [`Self::of`], where that is not cut off at 0.
    pub(super) fn adjoint(&self, slope: &Plane<f64>) -> Plane<f64> {
        if self.is_straight() {
            return slope.clone();
        }
        let (height_px, width_px) = (slope.height_px(), slope.width_px());
        let mut sum = Plane::filled(height_px, width_px, 0.0);
        for y in 0..height_px {
            interrupt::check();
            for x in 0..width_px {
                for (at, weight) in self.taps(slope, y, x) {
                    sum.values_mut()[at] += weight * slope.at(y, x);
                }
            }
        }
        sum
    }

    /// The pixels of the light that a pixel of the camera sees, with their weights. Beyond the edge, the values of the
    /// edge continue.
    fn taps(&self, light: &Plane<f64>, y: usize, x: usize) -> impl Iterator<Item = (usize, f64)> + use<> {
        let (height_px, width_px) = (light.height_px(), light.width_px());
        let (middle_y, middle_x) = ((height_px - 1) as f64 / 2.0, (width_px - 1) as f64 / 2.0);
        let (v, u) = (y as f64 - middle_y, x as f64 - middle_x);
        let outwards = (u * u + v * v) / (middle_y * middle_y + middle_x * middle_x).max(1.0);
        let (v, u) = (v * (1.0 + self.distortion * outwards), u * (1.0 + self.distortion * outwards));
        let (sine, cosine) = self.rotation_rad.sin_cos();
        let y = middle_y + sine * u + cosine * v + self.drift_px.1;
        let x = middle_x + cosine * u - sine * v + self.drift_px.0;
        let inside = |i: f64, side_px: usize| i.clamp(0.0, (side_px - 1) as f64) as usize;
        let rows = [-1.0, 0.0, 1.0, 2.0].map(|i| inside(y.floor() + i, height_px) * width_px);
        let columns = [-1.0, 0.0, 1.0, 2.0].map(|j| inside(x.floor() + j, width_px));
        let (along_y, along_x) = (cubic(y - y.floor()), cubic(x - x.floor()));
        (0..16).map(move |k| (rows[k / 4] + columns[k % 4], along_y[k / 4] * along_x[k % 4]))
    }
}

/// Weights of four neighbours, at the part `t` of the way from the second to the third.
fn cubic(t: f64) -> [f64; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [-0.5 * t3 + t2 - 0.5 * t, 1.5 * t3 - 2.5 * t2 + 1.0, -1.5 * t3 + 2.0 * t2 + 0.5 * t, 0.5 * t3 - 0.5 * t2]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(rotation_rad: f64, drift_px: (f64, f64), distortion: f64) -> View {
        View { rotation_rad, drift_px, distortion }
    }

    #[test]
    fn spot_moves_opposite_to_camera() {
        let spot = |cy: f64, cx: f64| {
            Plane::from_fn(60, 80, |y, x| (-((y as f64 - cy).powi(2) + (x as f64 - cx).powi(2)) / 18.0).exp())
        };
        let close =
            |a: &Plane<f64>, b: &Plane<f64>| a.values().iter().zip(b.values()).all(|(a, b)| (a - b).abs() < 2e-3);
        let light = spot(29.5, 50.0);
        assert!(close(&view(0.0, (2.3, -1.6), 0.0).of(&light), &spot(31.1, 47.7)));
        // A quarter turn about the middle (29.5, 39.5).
        assert!(close(&view(std::f64::consts::FRAC_PI_2, (0.0, 0.0), 0.0).of(&light), &spot(19.0, 39.5)));
        assert_eq!(view(0.0, (0.0, 0.0), 0.0).of(&light), light);
        // A lens with pincushion distortion looks farther out, so the spot moves towards the middle.
        let seen = view(0.0, (0.0, 0.0), 0.05).of(&light);
        let brightest = (0..80).max_by(|&a, &b| seen.at(29, a).total_cmp(&seen.at(29, b))).unwrap();
        assert!((48..=50).contains(&brightest), "{brightest}");
    }

    #[test]
    fn adjoint_matches_the_view() {
        let noise = |by: usize| Plane::from_fn(20, 31, |y, x| ((y * 31 + x) * by % 29) as f64);
        let product =
            |a: &Plane<f64>, b: &Plane<f64>| a.values().iter().zip(b.values()).map(|(a, b)| a * b).sum::<f64>();
        // Smooth light, which the cubic never makes negative.
        let light = Plane::from_fn(20, 31, |y, x| 2.0 + (0.3 * y as f64).sin() + (0.2 * x as f64).cos());
        let (view, slope) = (view(0.05, (1.3, -0.4), 0.03), noise(11));
        let (there, back) = (product(&view.of(&light), &slope), product(&light, &view.adjoint(&slope)));
        assert!((there - back).abs() < 1e-9 * there, "{there}, {back}");
    }
}
