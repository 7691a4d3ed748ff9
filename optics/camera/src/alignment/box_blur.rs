//! Blur by means over squares. Running sums make the cost independent of the radius.

use lightpath_optics::{Plane, interrupt};

/// Replaces each pixel by the mean over the (2·radius + 1)² square around it, as far as that lies inside the plane, and
/// repeats that `passes` times. Three passes come near a Gaussian.
pub(super) fn box_blur(plane: &Plane<f32>, radius_px: usize, passes: usize) -> Plane<f32> {
    let mut blurred = plane.clone();
    if radius_px == 0 {
        return blurred;
    }
    for _ in 0..passes {
        blurred = transposed_rows(&transposed_rows(&blurred, radius_px), radius_px);
    }
    blurred
}

/// Averages along the rows, then transposes.
fn transposed_rows(plane: &Plane<f32>, radius_px: usize) -> Plane<f32> {
    let (height_px, width_px) = (plane.height_px(), plane.width_px());
    let mut out = Plane::filled(width_px, height_px, 0.0_f32);
    let mut sums = vec![0.0_f64; width_px + 1];
    for y in 0..height_px {
        interrupt::check();
        for (x, &value) in plane.row(y).iter().enumerate() {
            sums[x + 1] = sums[x] + f64::from(value);
        }
        for x in 0..width_px {
            let (start, end) = (x.saturating_sub(radius_px), (x + radius_px + 1).min(width_px));
            out.values_mut()[x * height_px + y] = ((sums[end] - sums[start]) / (end - start) as f64) as f32;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blurred_pixel_is_mean_over_square() {
        let plane = Plane::from_fn(9, 13, |y, x| ((y * 31 + x * 17) % 23) as f32);
        let blurred = box_blur(&plane, 2, 1);
        for (y, x) in [(0_usize, 0_usize), (4, 6), (8, 12), (1, 11)] {
            let rows = y.saturating_sub(2)..(y + 3).min(9);
            let columns = x.saturating_sub(2)..(x + 3).min(13);
            let all: Vec<f32> =
                rows.flat_map(|y| columns.clone().map(move |x| (y, x))).map(|(y, x)| plane.at(y, x)).collect();
            let mean = all.iter().sum::<f32>() / all.len() as f32;
            assert!((blurred.at(y, x) - mean).abs() < 1e-5);
        }
    }
}
