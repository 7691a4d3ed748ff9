//! Gaussian blur, of the light by the camera's lens and of the phase by cross-talk between neighbouring pixels.
//!
//! ```text
//! b(y, x) = Σ_k Σ_l g_k g_l v(y + k, x + l),   g_k ∝ e^{−k²/2σ²}
//! ```

use lightpath_optics::{Plane, interrupt};
use rayon::prelude::*;

/// Blurs with standard deviation `sigma_px`. Beyond the edge, the values of the edge continue.
pub(super) fn blurred(values: &Plane<f64>, sigma_px: f64) -> Plane<f64> {
    blurred_along(values, [sigma_px; 2])
}

/// [`blurred`] with a standard deviation along x and one along y \[px\].
pub(super) fn blurred_along(values: &Plane<f64>, sigma_px: [f64; 2]) -> Plane<f64> {
    if sigma_px == [0.0; 2] {
        return values.clone();
    }
    let [weights_x, weights_y] = sigma_px.map(weights);
    let (height_px, width_px) = (values.height_px(), values.width_px());
    let mut along_x = Plane::filled(height_px, width_px, 0.0);
    along_x.values_mut().par_chunks_mut(width_px).enumerate().for_each(|(y, out)| {
        interrupt::check();
        let row = values.row(y);
        for (x, out) in out.iter_mut().enumerate() {
            *out = weights_x.iter().enumerate().map(|(k, w)| w * row[neighbour(x, k, &weights_x, width_px)]).sum();
        }
    });
    let mut blurred = Plane::filled(height_px, width_px, 0.0);
    blurred.values_mut().par_chunks_mut(width_px).enumerate().for_each(|(y, out)| {
        interrupt::check();
        for (k, w) in weights_y.iter().enumerate() {
            let row = along_x.row(neighbour(y, k, &weights_y, height_px));
            out.iter_mut().zip(row).for_each(|(out, value)| *out += w * value);
        }
    });
    blurred
}

/// The adjoint of [`blurred_along`]: each value goes to the pixels that it came from.
pub(super) fn spread_along(values: &Plane<f64>, sigma_px: [f64; 2]) -> Plane<f64> {
    if sigma_px == [0.0; 2] {
        return values.clone();
    }
    let [weights_x, weights_y] = sigma_px.map(weights);
    let (height_px, width_px) = (values.height_px(), values.width_px());
    let mut spread = Plane::filled(height_px, width_px, 0.0);
    for y in 0..height_px {
        interrupt::check();
        let mut row = vec![0.0; width_px];
        for (x, value) in values.row(y).iter().enumerate() {
            for (k, w) in weights_x.iter().enumerate() {
                row[neighbour(x, k, &weights_x, width_px)] += w * value;
            }
        }
        for (k, w) in weights_y.iter().enumerate() {
            let to = neighbour(y, k, &weights_y, height_px) * width_px;
            spread.values_mut()[to..][..width_px].iter_mut().zip(&row).for_each(|(out, value)| *out += w * value);
        }
    }
    spread
}

/// The pixel whose value weight k of pixel i multiplies.
fn neighbour(i: usize, k: usize, weights: &[f64], side_px: usize) -> usize {
    (i + k).saturating_sub(weights.len() / 2).min(side_px - 1)
}

/// The weights g up to four standard deviations, scaled to the sum 1.
fn weights(sigma_px: f64) -> Vec<f64> {
    if sigma_px <= 0.0 {
        return vec![1.0];
    }
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
    #[test]
    fn spreading_is_adjoint_of_blurring() {
        let noise = |by: usize| Plane::from_fn(9, 13, |y, x| ((y * 13 + x) * by % 29) as f64 - 14.0);
        let product =
            |a: &Plane<f64>, b: &Plane<f64>| a.values().iter().zip(b.values()).map(|(a, b)| a * b).sum::<f64>();
        for sigma_px in [[0.5, 1.2], [0.0, 0.8], [2.0, 0.0]] {
            let (a, b) = (noise(7), noise(11));
            let (there, back) = (product(&blurred_along(&a, sigma_px), &b), product(&a, &spread_along(&b, sigma_px)));
            assert!((there - back).abs() < 1e-9 * there.abs().max(1.0), "{sigma_px:?}: {there}, {back}");
        }
    }
}
