//! Speckle contrast.
//!
//! ```text
//! C = σ(r) / ⟨r⟩,   r = p / t over the samples where the target is flat
//! ```
//!
//! p is the light, t the target. Speckle is the graininess of areas that should be evenly lit. Fully developed speckle
//! has C = 1, an evenly lit area C = 0. J. W. Goodman: Speckle Phenomena in Optics (2007), sect. 3.2.
//!
//! A pixel is flat if two conditions hold. In the 5×5 pixels around it, as far as they lie in the region of interest,
//! the target varies by at most 10 % of its largest value there. And the target at the pixel is at least a tenth of the
//! brightest in the region. The ratio r removes the remaining slope. C needs no gain: brightness and exposure do not
//! change it.

use super::pair::{Gain, ImagePair};
use crate::error::Result;
use crate::interrupt;
use crate::numerics::{Plane, RegionOfInterest};
use rayon::prelude::*;

/// Fewest flat pixels for a contrast. The relative uncertainty from n independent samples is about 1/√2n, here 7 %.
pub const FLAT_PIXELS_MIN: usize = 100;
/// Number of pixels to each side of a pixel that must be alike.
const NEIGHBOURS: usize = 2;
/// Largest difference between the target's values around a flat pixel, as a part of the largest of them.
const TOLERANCE: f32 = 0.1;
/// Least value of a flat pixel, as a part of the region's brightest pixel. Darker pixels are background, whose speckle
/// is invisible.
const DARKEST: f32 = 0.1;

/// Speckle contrast: standard deviation over mean of the light relative to the target where the target is flat. `None`
/// when fewer than [`FLAT_PIXELS_MIN`] of the region's pixels are flat, or when no light falls on them.
///
/// # Errors
///
/// [`Error::SizeMismatch`](crate::Error::SizeMismatch) when the reconstruction is not of the target's size or a whole
/// multiple of it; [`Error::OutOfRange`](crate::Error::OutOfRange) when the region leaves the target.
pub fn speckle_contrast(
    reconstruction: &Plane<f32>,
    target: &Plane<f32>,
    roi: RegionOfInterest,
) -> Result<Option<f64>> {
    let pair = ImagePair::new(reconstruction, target, roi, Gain::Given(1.0))?;
    let flat = flat_pixels(target, roi);
    let pixels = flat.iter().filter(|flat| **flat).count();
    if pixels < FLAT_PIXELS_MIN {
        return Ok(None);
    }
    let samples = pixels * (pair.height() / roi.height_px()).pow(2);
    let sum = |term: &(dyn Fn(f64) -> f64 + Sync)| sum_over_flat(&pair, &flat, roi, term);
    let mean = sum(&|ratio| ratio) / samples as f64;
    let variance = sum(&|ratio| (ratio - mean).powi(2)) / samples as f64;
    Ok((mean > 0.0).then(|| variance.sqrt() / mean))
}

fn sum_over_flat(
    pair: &ImagePair<'_>,
    flat: &[bool],
    roi: RegionOfInterest,
    term: &(dyn Fn(f64) -> f64 + Sync),
) -> f64 {
    let samples_per_px = pair.height() / roi.height_px();
    let rows = (0..pair.height()).into_par_iter().map(|y| {
        interrupt::check();
        let (light, target) = pair.row(y);
        let flat = &flat[y / samples_per_px * roi.width_px()..][..roi.width_px()];
        let pixels = light.chunks_exact(samples_per_px).zip(target).zip(flat).filter(|(_, flat)| **flat);
        let ratios = pixels.flat_map(|((p, &t), _)| p.iter().map(move |&p| f64::from(p) / f64::from(t)));
        ratios.map(term).sum::<f64>()
    });
    rows.collect::<Vec<_>>().iter().sum()
}

/// For each pixel of the region, row after row: whether it is flat.
fn flat_pixels(target: &Plane<f32>, roi: RegionOfInterest) -> Vec<bool> {
    let row = |y: usize| &target.row(roi.y_px() + y)[roi.x_px()..][..roi.width_px()];
    let brightest = (0..roi.height_px()).flat_map(row).fold(0.0, |most: f32, &t| most.max(t));
    let around = |i: usize, side: usize| i.saturating_sub(NEIGHBOURS)..(i + NEIGHBOURS + 1).min(side);
    let mut flat = vec![false; roi.pixels()];
    flat.par_chunks_mut(roi.width_px()).enumerate().for_each_init(
        || vec![[0.0_f32; 2]; roi.width_px()],
        |extremes, (y, flat)| {
            interrupt::check();
            extremes.fill([f32::INFINITY, 0.0]);
            for neighbour in around(y, roi.height_px()).map(row) {
                for ([least, most], &t) in extremes.iter_mut().zip(neighbour) {
                    (*least, *most) = (least.min(t), most.max(t));
                }
            }
            for (x, (flat, &t)) in flat.iter_mut().zip(row(y)).enumerate() {
                let near = &extremes[around(x, roi.width_px())];
                let [least, most] =
                    near.iter().fold([f32::INFINITY, 0.0_f32], |all, one| [all[0].min(one[0]), all[1].max(one[1])]);
                *flat = t > 0.0 && t >= DARKEST * brightest && most - least <= TOLERANCE * most;
            }
        },
    );
    flat
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::Grid;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn grid(height_px: usize, width_px: usize) -> Grid {
        Grid::try_new(height_px, width_px, 8e-6).unwrap()
    }

    /// A target with a dark part, a step up, and a gentle slope.
    fn target() -> Plane<f32> {
        Plane::from_fn(40, 60, |_, x| if x < 20 { 0.01 } else { 0.4 + 0.005 * x as f32 })
    }

    #[test]
    fn fully_developed_speckle_has_contrast_one() {
        // The intensity of a sum of many waves is exponentially distributed; n = 160 000 samples give C to within 1/√n.
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let light = Plane::from_fn(400, 400, |_, _| -(1.0 - random.random::<f64>()).ln() as f32);
        let even = Plane::filled(400, 400, 0.3);
        let found = speckle_contrast(&light, &even, RegionOfInterest::full(&grid(400, 400))).unwrap().unwrap();
        assert!((found - 1.0).abs() < 0.01, "{found}");
        // The mean of four independent intensities has C = 1/√4.
        let pixels = Plane::from_fn(200, 200, |y, x| {
            [(0, 0), (0, 1), (1, 0), (1, 1)].iter().map(|(dy, dx)| light.at(2 * y + dy, 2 * x + dx)).sum::<f32>() / 4.0
        });
        let even = Plane::filled(200, 200, 0.3);
        let roi = RegionOfInterest::full(&grid(200, 200));
        let found = speckle_contrast(&pixels, &even, roi).unwrap().unwrap();
        assert!((found - 0.5).abs() < 0.01, "{found}");
        // Compared sample by sample, the light has the full contrast.
        let found = speckle_contrast(&light, &even, roi).unwrap().unwrap();
        assert!((found - 1.0).abs() < 0.01, "{found}");
    }

    #[test]
    fn brightness_slopes_and_dark_areas_do_not_count_as_speckle() {
        let (t, roi) = (target(), RegionOfInterest::full(&grid(40, 60)));
        // The light is far off in the dark part and at the step, where no pixel is flat.
        let light = Plane::from_fn(40, 60, |y, x| if x < 22 { (x + y) as f32 } else { 7.0 * t.at(y, x) });
        assert!(speckle_contrast(&light, &t, roi).unwrap().unwrap() < 1e-6);
    }

    #[test]
    fn chequered_error_gives_its_amplitude_as_contrast() {
        let (t, roi) = (target(), RegionOfInterest::full(&grid(40, 60)));
        let light = Plane::from_fn(40, 60, |y, x| t.at(y, x) * if (y + x) % 2 == 0 { 1.25 } else { 0.75 });
        assert!((speckle_contrast(&light, &t, roi).unwrap().unwrap() - 0.25).abs() < 1e-6);
    }

    /// Compares with the definition of flat pixels, evaluated pixel by pixel.
    #[test]
    fn flat_pixels_match_definition() {
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let t = Plane::from_fn(33, 47, |y, x| {
            let step = [0.02_f32, 0.4, 0.9][(y / 9 + x / 11) % 3];
            step * (1.0 + 0.06 * random.random::<f32>())
        });
        let roi = RegionOfInterest::try_new(&grid(33, 47), 3, 2, 41, 30).unwrap();
        let inside = |y: i64, x: i64| (2..32).contains(&y) && (3..44).contains(&x);
        let at = |y: i64, x: i64| t.at(y as usize, x as usize);
        let brightest = (2..32).flat_map(|y| (3..44).map(move |x| (y, x))).map(|(y, x)| at(y, x)).fold(0.0, f32::max);
        let expected: Vec<bool> = (2..32)
            .flat_map(|y| (3..44).map(move |x| (y, x)))
            .map(|(y, x)| {
                let near: Vec<f32> = (y - 2..=y + 2)
                    .flat_map(|y| (x - 2..=x + 2).map(move |x| (y, x)))
                    .filter(|&(y, x)| inside(y, x))
                    .map(|(y, x)| at(y, x))
                    .collect();
                let (least, most) =
                    (near.iter().copied().fold(9.0, f32::min), near.iter().copied().fold(0.0, f32::max));
                at(y, x) >= 0.1 * brightest && most - least <= 0.1 * most
            })
            .collect();
        assert!(expected.iter().any(|flat| *flat) && expected.iter().any(|flat| !*flat));
        assert_eq!(flat_pixels(&t, roi), expected);
    }

    #[test]
    fn too_few_flat_pixels_or_no_light_give_no_contrast() {
        let roi = RegionOfInterest::full(&grid(40, 60));
        let stripes = Plane::from_fn(40, 60, |_, x| (x % 2) as f32);
        assert_eq!(speckle_contrast(&stripes, &stripes, roi).unwrap(), None);
        let black = Plane::filled(40, 60, 0.0);
        assert_eq!(speckle_contrast(&black, &target(), roi).unwrap(), None);
        assert_eq!(speckle_contrast(&target(), &black, roi).unwrap(), None);
        assert!(speckle_contrast(&stripes, &Plane::filled(41, 60, 0.5), roi).is_err());
    }
}
