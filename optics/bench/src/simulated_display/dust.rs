//! Dust and fringes in the illumination: a fixed complex structure of 2 to 50 px.
//!
//! ```text
//! factor(y, x) = 1 + c · n(y, x) / rms(n),   n = Σ_k blur_σk(m_k) / rms(blur_σk(m_k))
//! ```
//!
//! m are complex normal random numbers at each pixel and c is the contrast of the amplitude. The widths σ of the
//! structures are 1, 4 and 16 px, so that their sizes go from 2 to 50 px: grains and scratches, and the interference
//! rings of dust that lies before the modulator (J. W. Goodman, *Speckle Phenomena in Optics*, 2007).

use super::blur::blurred;
use super::draws::{Draws, Stream};
use lightpath_optics::{Grid, Plane};
use num_complex::Complex64;

/// Standard deviations of the blurs \[px\].
const SIZES_PX: [f64; 3] = [1.0, 4.0, 16.0];

/// Draws the factor of the light on each pixel of the modulator. `None` without contrast.
pub(super) fn draw(grid: &Grid, seed: u64, contrast: f64) -> Option<Plane<Complex64>> {
    if contrast == 0.0 {
        return None;
    }
    let (height_px, width_px) = (grid.height_px(), grid.width_px());
    let mut draws = Draws::new(seed, Stream::Dust);
    let mut sum = Plane::filled(height_px, width_px, Complex64::ZERO);
    for size_px in SIZES_PX {
        let mut structure = || blurred(&Plane::from_fn(height_px, width_px, |_, _| draws.normal()), size_px);
        let (re, im) = (structure(), structure());
        let structure = Plane::from_fn(height_px, width_px, |y, x| Complex64::new(re.at(y, x), im.at(y, x)));
        let scale = 1.0 / rms(&structure);
        sum.values_mut().iter_mut().zip(structure.values()).for_each(|(sum, value)| *sum += value * scale);
    }
    let scale = contrast / rms(&sum);
    Some(sum.map(|n| 1.0 + n * scale))
}

fn rms(values: &Plane<Complex64>) -> f64 {
    (values.values().iter().map(|c| c.norm_sqr()).sum::<f64>() / values.values().len() as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dust_has_given_contrast_and_structure_of_some_pixels() {
        let grid = Grid::try_new(180, 320, 8e-6).unwrap();
        let dust = draw(&grid, 5, 0.1).unwrap().map(|factor| factor - 1.0);
        assert!((rms(&dust) - 0.1).abs() < 1e-12);
        // Pixels side by side are alike, pixels 100 px apart are not.
        let likeness = |step: usize| {
            let pairs = (0..180).flat_map(|y| (0..320 - step).map(move |x| (y, x)));
            let products = pairs.map(|(y, x)| (dust.at(y, x) * dust.at(y, x + step).conj()).re).sum::<f64>();
            products / (180 * (320 - step)) as f64 / 0.01
        };
        assert!(likeness(1) > 0.8 && likeness(4).abs() < 0.8 && likeness(100).abs() < 0.2);
        assert_eq!(draw(&grid, 5, 0.0), None);
    }
}
