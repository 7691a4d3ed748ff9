//! Multi-scale structural similarity.
//!
//! ```text
//! MS-SSIM = SSIM₅^w₅ · Π_{j=1…4} CS_j^w_j,   w = 0.0448, 0.2856, 0.3001, 0.2363, 0.1333
//! ```
//!
//! SSIM_j and CS_j are the means of l · cs and of cs (see [`ssim`](super::ssim())) at scale j. Scale 1 is the image
//! itself. Each further scale has the means of 2×2 samples of the previous one; an odd last row or column is left out.
//! A negative mean counts as 0. Z. Wang, E. P. Simoncelli, A. C. Bovik: Multiscale structural similarity for image
//! quality assessment, Asilomar Conference on Signals, Systems and Computers (2003).
//!
//! The weights were measured for five scales. Images too small for five scales have no value, because a value from
//! fewer scales would not be comparable.

use super::pair::{Gain, ImagePair};
use super::ssim::{SSIM_SIDE_MIN, Similarity, similarity};
use crate::error::{Error, Result};
use crate::interrupt;
use crate::numerics::{Plane, RegionOfInterest};
use rayon::prelude::*;

const WEIGHTS: [f64; 5] = [0.0448, 0.2856, 0.3001, 0.2363, 0.1333];

/// Fewest samples along a side of a region of interest: an SSIM window at the coarsest of five scales, 11 · 2⁴.
pub const MS_SSIM_SIDE_MIN: usize = SSIM_SIDE_MIN << (WEIGHTS.len() - 1);

/// Multi-scale structural similarity in the region of interest: 1 when the two are equal after the gain, 0 at worst.
///
/// # Errors
///
/// [`Error::SizeMismatch`] when the reconstruction is not of the target's size or a whole multiple of it;
/// [`Error::OutOfRange`] when the region leaves the target, or when one of its sides has less than
/// [`MS_SSIM_SIDE_MIN`] samples.
pub fn ms_ssim(reconstruction: &Plane<f32>, target: &Plane<f32>, roi: RegionOfInterest, gain: Gain) -> Result<f64> {
    let pair = ImagePair::new(reconstruction, target, roi, gain)?;
    ssim_at_all_scales(&pair).1.ok_or_else(|| {
        let (value, allowed) = (pair.height().min(pair.width()) as f64, "at least 176 samples for five scales of SSIM");
        Error::OutOfRange { name: "region_of_interest's shorter side", value, allowed }
    })
}

/// Computes SSIM and MS-SSIM, which share the finest scale. `None` for a metric whose window does not fit into the
/// region.
pub(crate) fn ssim_at_all_scales(pair: &ImagePair<'_>) -> (Option<f64>, Option<f64>) {
    let side = pair.height().min(pair.width());
    if side < SSIM_SIDE_MIN {
        return (None, None);
    }
    let finest = similarity(pair);
    if side < MS_SSIM_SIDE_MIN {
        return (Some(finest.ssim), None);
    }
    let mut scales = [finest; WEIGHTS.len()];
    let (mut light, mut target) = halved(pair);
    for (i, scale) in scales.iter_mut().enumerate().skip(1) {
        let coarser = ImagePair::whole(&light, &target);
        *scale = similarity(&coarser);
        if i + 1 < WEIGHTS.len() {
            (light, target) = halved(&coarser);
        }
    }
    (Some(finest.ssim), Some(product(scales)))
}

fn product(scales: [Similarity; WEIGHTS.len()]) -> f64 {
    let last = WEIGHTS.len() - 1;
    let terms = scales.iter().zip(WEIGHTS).enumerate().map(|(i, (scale, weight))| {
        let mean = if i == last { scale.ssim } else { scale.contrast_structure };
        mean.max(0.0).powf(weight)
    });
    terms.product()
}

/// Means of 2×2 samples of the light after the gain and of the target; an odd last row or column is left out.
fn halved(pair: &ImagePair<'_>) -> (Plane<f32>, Plane<f32>) {
    let (height, width) = (pair.height() / 2, pair.width() / 2);
    let mut planes = (Plane::filled(height, width, 0.0), Plane::filled(height, width, 0.0));
    let rows = (planes.0.values_mut().par_chunks_mut(width), planes.1.values_mut().par_chunks_mut(width));
    rows.into_par_iter().enumerate().for_each_init(
        || std::array::from_fn::<_, 4, _>(|_| vec![0.0; pair.width()]),
        |[upper_light, upper_target, lower_light, lower_target], (y, (light, target))| {
            interrupt::check();
            pair.read_row(2 * y, upper_light, upper_target);
            pair.read_row(2 * y + 1, lower_light, lower_target);
            mean_of_squares(upper_light, lower_light, light);
            mean_of_squares(upper_target, lower_target, target);
        },
    );
    planes
}

fn mean_of_squares(upper: &[f64], lower: &[f64], out: &mut [f32]) {
    for (out, (upper, lower)) in out.iter_mut().zip(upper.chunks_exact(2).zip(lower.chunks_exact(2))) {
        *out = ((upper[0] + upper[1] + lower[0] + lower[1]) / 4.0) as f32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::ssim::ssim;
    use crate::metrics::test_images::{card, noisy_card};
    use crate::numerics::Grid;

    fn whole(plane: &Plane<f32>) -> RegionOfInterest {
        RegionOfInterest::full(&Grid::try_new(plane.height_px(), plane.width_px(), 8e-6).unwrap())
    }

    /// Expected values are from pytorch-msssim 1.0.0 on float64 tensors of the same arrays:
    /// `ms_ssim(gain * p, t, data_range=1.0)`. Its window is in float32, which limits its values to about 1e-7. The
    /// sides are even at every scale, because it pads odd ones.
    #[test]
    fn ms_ssim_matches_pytorch_msssim() {
        let (p, t) = (noisy_card(192, 224), card(192, 224));
        for (gain, expected) in [(1.0, 0.922_402_308_943_824_5), (0.5, 0.770_734_818_950_884_4)] {
            let found = ms_ssim(&p, &t, whole(&t), Gain::Given(gain)).unwrap();
            assert!((found - expected).abs() < 1e-6, "gain {gain}: {found} {expected}");
        }
    }

    /// Compares with the definition on planes that are halved separately, with odd sides on the way.
    #[test]
    fn ms_ssim_is_product_over_scales() {
        let (p, t) = (noisy_card(181, 203), card(181, 203));
        let half = |plane: &Plane<f32>| {
            Plane::from_fn(plane.height_px() / 2, plane.width_px() / 2, |y, x| {
                let sum: f64 = [(0, 0), (0, 1), (1, 0), (1, 1)]
                    .map(|(dy, dx)| f64::from(plane.at(2 * y + dy, 2 * x + dx)))
                    .iter()
                    .sum();
                (sum / 4.0) as f32
            })
        };
        let mut expected = 1.0;
        let mut scale = (p.clone(), t.clone());
        for weight in &WEIGHTS[..4] {
            expected *= similarity(&ImagePair::whole(&scale.0, &scale.1)).contrast_structure.powf(*weight);
            scale = (half(&scale.0), half(&scale.1));
        }
        expected *= ssim(&scale.0, &scale.1, whole(&scale.1), Gain::Given(1.0)).unwrap().powf(WEIGHTS[4]);
        let found = ms_ssim(&p, &t, whole(&t), Gain::Given(1.0)).unwrap();
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }

    #[test]
    fn ms_ssim_matches_closed_forms() {
        let t = card(176, 190);
        assert!((ms_ssim(&t, &t, whole(&t), Gain::Given(1.0)).unwrap() - 1.0).abs() < 1e-12);
        // Uniform greys have no structure that could differ, so only the brightness at the coarsest scale counts.
        let (a, b) = (0.25, 0.75);
        let found = ms_ssim(&t.map(|_| a as f32), &t.map(|_| b as f32), whole(&t), Gain::Given(1.0)).unwrap();
        let brightness: f64 = (2.0 * a * b + 1e-4) / (a * a + b * b + 1e-4);
        assert!((found - brightness.powf(0.1333)).abs() < 1e-12, "{found}");
        // Images that are opposite at some scale have MS-SSIM 0.
        let noise = |sign: f32| Plane::from_fn(176, 190, |y, x| 0.5 + sign * 0.25 * (1.0 - 2.0 * ((y + x) % 2) as f32));
        assert_eq!(ms_ssim(&noise(1.0), &noise(-1.0), whole(&t), Gain::Given(1.0)).unwrap(), 0.0);
    }

    #[test]
    fn too_small_region_is_refused_with_its_size() {
        let t = card(175, 300);
        let error = ms_ssim(&t, &t, whole(&t), Gain::Fitted).unwrap_err().to_string();
        assert!(error.contains("is 175") && error.contains("at least 176"), "{error}");
        let pair = ImagePair::whole(&t, &t);
        assert!(matches!(ssim_at_all_scales(&pair), (Some(_), None)));
    }
}
