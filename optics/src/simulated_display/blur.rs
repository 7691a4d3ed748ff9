//! Gaussian blur, of the light by the camera's lens and of the phase by cross-talk between neighbouring pixels.
//!
//! ```text
//! b(y, x) = Σ_k Σ_l g_k g_l v(y + k, x + l),   g_k ∝ e^{−k²/2σ²}
//! ```

use crate::Plane;
use crate::interrupt;
use rayon::prelude::*;

/// Blurs with standard deviation `sigma_px`. Beyond the edge, the values of the edge continue.
pub(super) fn blurred(values: &Plane<f64>, sigma_px: f64) -> Plane<f64> {
    if sigma_px <= 0.0 {
        return values.clone();
    }
    let weights = weights(sigma_px);
    let (height_px, width_px) = (values.height_px(), values.width_px());
    let half = weights.len() / 2;
    let inside = |i: usize, k: usize, side: usize| (i + k).saturating_sub(half).min(side - 1);
    let mut along_x = Plane::filled(height_px, width_px, 0.0);
    along_x.values_mut().par_chunks_mut(width_px).enumerate().for_each(|(y, out)| {
        interrupt::check();
        let row = values.row(y);
        for (x, out) in out.iter_mut().enumerate() {
            *out = weights.iter().enumerate().map(|(k, w)| w * row[inside(x, k, width_px)]).sum();
        }
    });
    let mut blurred = Plane::filled(height_px, width_px, 0.0);
    blurred.values_mut().par_chunks_mut(width_px).enumerate().for_each(|(y, out)| {
        interrupt::check();
        for (k, w) in weights.iter().enumerate() {
            let row = along_x.row(inside(y, k, height_px));
            out.iter_mut().zip(row).for_each(|(out, value)| *out += w * value);
        }
    });
    blurred
}

/// The weights g up to four standard deviations, scaled to the sum 1.
fn weights(sigma_px: f64) -> Vec<f64> {
    let half = (4.0 * sigma_px).ceil() as i32;
    let weights: Vec<f64> = (-half..=half).map(|k| (-0.5 * (f64::from(k) / sigma_px).powi(2)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|weight| weight / sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blurred_point_is_gaussian_with_same_light() {
        let point = Plane::from_fn(41, 51, |y, x| if (y, x) == (20, 25) { 1.0 } else { 0.0 });
        let blurred = blurred(&point, 1.5);
        let sum: f64 = blurred.values().iter().sum();
        let spread: f64 = (0..41)
            .flat_map(|y| (0..51).map(move |x| (y, x)))
            .fold(0.0, |sum, (y, x)| sum + blurred.at(y, x) * (x as f64 - 25.0).powi(2));
        // The cut at four standard deviations removes a thousandth of the variance.
        assert!((sum - 1.0).abs() < 1e-12 && (spread - 2.25).abs() < 0.005, "{sum}, {spread}");
        assert_eq!(super::blurred(&point, 0.0), point);
    }
}
