//! Diffraction efficiency.
//!
//! ```text
//! η = Σ_ROI p / P,   P = ∫ |E U₀|² df
//! ```
//!
//! p is the light at the image's pixels, P all light that passes the optics
//! ([`Engine::light_passed`](crate::Engine::light_passed)): U₀ is the spectrum of the field on the modulator and E the
//! optics' transmission of each frequency, 1 for free space. A camera does not tell how much light the optics lose, so
//! a learned transmission has an unknown factor. It is in both sums, and η stays a part of the light. The rest falls
//! elsewhere in the image plane. Over the full frame, the same ratio is the part of the light that falls on the image.

use crate::numerics::{Plane, RegionOfInterest};
use rayon::prelude::*;
use std::ops::Range;

/// The light inside the region as a part of `light_passed`, all light that passes the optics; both in the same unit,
/// per pixel. 0 for a dark modulator. Parts of the region outside of `light` are ignored.
///
/// ```
/// use lightpath_optics::{Grid, Plane, RegionOfInterest, metrics::diffraction_efficiency};
/// let grid = Grid::try_new(100, 50, 8e-6)?;
/// let even = Plane::filled(100, 50, 0.5);
/// let roi = RegionOfInterest::middle(&grid);
/// assert!((diffraction_efficiency(&even, roi, 5000.0) - 0.5 * 0.8 * 0.8).abs() < 1e-12);
/// # Ok::<(), lightpath_optics::Error>(())
/// ```
#[must_use]
pub fn diffraction_efficiency(light: &Plane<f32>, roi: RegionOfInterest, light_passed: f64) -> f64 {
    if light_passed == 0.0 {
        return 0.0;
    }
    let inside = sum(light, |y| {
        let columns = roi.columns(y).unwrap_or(0..0);
        columns.start.min(light.width_px())..columns.end.min(light.width_px())
    });
    inside / light_passed
}

/// The whole of `light` as a part of `light_passed`, in the same unit: the part of the light that falls on the frame. 0
/// for a dark modulator.
#[must_use]
pub fn frame_efficiency(light: &Plane<f32>, light_passed: f64) -> f64 {
    if light_passed == 0.0 {
        return 0.0;
    }
    sum(light, |_| 0..light.width_px()) / light_passed
}

fn sum(light: &Plane<f32>, columns: impl Fn(usize) -> Range<usize> + Sync) -> f64 {
    let row = |y| light.row(y)[columns(y)].iter().map(|&p| f64::from(p)).sum::<f64>();
    (0..light.height_px()).into_par_iter().map(row).collect::<Vec<_>>().iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::Grid;

    #[test]
    fn only_light_inside_region_counts() {
        let grid = Grid::try_new(6, 8, 8e-6).unwrap();
        let light = Plane::from_fn(6, 8, |y, x| (y * 8 + x) as f32);
        let roi = RegionOfInterest::try_new(&grid, 2, 1, 3, 2).unwrap();
        let inside = 10.0 + 11.0 + 12.0 + 18.0 + 19.0 + 20.0;
        assert_eq!(diffraction_efficiency(&light, roi, 2.0 * inside), 0.5);
        assert_eq!(diffraction_efficiency(&light, RegionOfInterest::full(&grid), 47.0 * 48.0 / 2.0), 1.0);
        assert_eq!(frame_efficiency(&light, 47.0 * 48.0), 0.5);
        assert_eq!(frame_efficiency(&light, 0.0), 0.0);
        assert_eq!(diffraction_efficiency(&Plane::filled(6, 8, 0.0), roi, 0.0), 0.0);
    }
}
