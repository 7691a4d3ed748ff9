//! Rotation of the camera and drift of the image.
//!
//! ```text
//! image(p) = light( m + R (p − m) + d ),   R a rotation about the middle m, d the drift of the image
//! ```
//!
//! Light between pixels is interpolated by Catmull and Rom's cubic. It blurs the finest detail of the image, but the
//! pixels of a turned camera would blur that as well.

use crate::Plane;
use crate::interrupt;
use rayon::prelude::*;

/// The light that a camera sees when it is turned about the middle and the image has drifted.
pub(super) fn moved_and_rotated(light: &Plane<f64>, rotation_rad: f64, (dx_px, dy_px): (f64, f64)) -> Plane<f64> {
    if rotation_rad == 0.0 && dx_px == 0.0 && dy_px == 0.0 {
        return light.clone();
    }
    let (height_px, width_px) = (light.height_px(), light.width_px());
    let (middle_y, middle_x) = ((height_px - 1) as f64 / 2.0, (width_px - 1) as f64 / 2.0);
    let (sine, cosine) = rotation_rad.sin_cos();
    let mut image = Plane::filled(height_px, width_px, 0.0);
    image.values_mut().par_chunks_mut(width_px).enumerate().for_each(|(y, out)| {
        interrupt::check();
        let v = y as f64 - middle_y;
        for (x, out) in out.iter_mut().enumerate() {
            let u = x as f64 - middle_x;
            *out = cubic(light, middle_y + sine * u + cosine * v + dy_px, middle_x + cosine * u - sine * v + dx_px);
        }
    });
    image
}

/// Interpolates the light between pixels. Beyond the edge, the values of the edge continue.
fn cubic(light: &Plane<f64>, y: f64, x: f64) -> f64 {
    let weights = |t: f64| {
        let (t2, t3) = (t * t, t * t * t);
        [-0.5 * t3 + t2 - 0.5 * t, 1.5 * t3 - 2.5 * t2 + 1.0, -1.5 * t3 + 2.0 * t2 + 0.5 * t, 0.5 * t3 - 0.5 * t2]
    };
    let inside = |i: f64, side: usize| i.clamp(0.0, (side - 1) as f64) as usize;
    let columns = [-1.0, 0.0, 1.0, 2.0].map(|j| inside(x.floor() + j, light.width_px()));
    let along_x = weights(x - x.floor());
    let mut sum = 0.0;
    for (i, weight) in weights(y - y.floor()).into_iter().enumerate() {
        let row = light.row(inside(y.floor() + i as f64 - 1.0, light.height_px()));
        sum += weight * columns.iter().zip(along_x).map(|(&column, w)| w * row[column]).sum::<f64>();
    }
    sum.max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spot_moves_opposite_to_camera() {
        let spot = |cy: f64, cx: f64| {
            Plane::from_fn(60, 80, |y, x| (-((y as f64 - cy).powi(2) + (x as f64 - cx).powi(2)) / 18.0).exp())
        };
        let close =
            |a: &Plane<f64>, b: &Plane<f64>| a.values().iter().zip(b.values()).all(|(a, b)| (a - b).abs() < 2e-3);
        let light = spot(29.5, 50.0);
        assert!(close(&moved_and_rotated(&light, 0.0, (2.3, -1.6)), &spot(31.1, 47.7)));
        // A quarter turn about the middle (29.5, 39.5).
        assert!(close(&moved_and_rotated(&light, std::f64::consts::FRAC_PI_2, (0.0, 0.0)), &spot(19.0, 39.5)));
        assert_eq!(moved_and_rotated(&light, 0.0, (0.0, 0.0)), light);
    }
}
