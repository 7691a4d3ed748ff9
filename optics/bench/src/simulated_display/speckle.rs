//! A fixed speckle pattern: light that dust and coatings scatter into the image.
//!
//! ```text
//! factor = 1 + c (e − 1),   e exponentially distributed with mean 1, c the contrast
//! ```

use super::draws::{Draws, Stream};
use lightpath_optics::{Grid, Plane};

/// Draws the factor of each camera pixel's light, with mean 1 and the contrast as standard deviation. `None` without
/// contrast.
pub(super) fn draw(grid: &Grid, seed: u64, contrast: f64) -> Option<Plane<f64>> {
    if contrast <= 0.0 {
        return None;
    }
    let mut draws = Draws::new(seed, Stream::Speckle);
    let mut factor = || 1.0 + contrast * (-(1.0 - draws.between(0.0, 1.0)).ln() - 1.0);
    Some(Plane::from_fn(grid.height_px(), grid.width_px(), |_, _| factor()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speckle_has_given_contrast() {
        let grid = Grid::try_new(200, 300, 8e-6).unwrap();
        let factors = draw(&grid, 3, 0.2).unwrap();
        let mean = factors.values().iter().sum::<f64>() / 60_000.0;
        let variance = factors.values().iter().map(|factor| (factor - mean).powi(2)).sum::<f64>() / 60_000.0;
        // Tolerances are three standard errors: 0.2/√60000 for the mean, twice that for the deviation.
        assert!((mean - 1.0).abs() < 0.003 && (variance.sqrt() - 0.2).abs() < 0.005, "{mean}, {}", variance.sqrt());
        assert_eq!(draw(&grid, 3, 0.0), None);
    }
}
