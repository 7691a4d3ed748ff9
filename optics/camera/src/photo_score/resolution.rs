//! Resolution of a photograph: the finest details that it shares with its target.
//!
//! ```text
//! c(f) = Re Σ_ring P* T / √( Σ_ring |P|² Σ_ring |T|² )
//! ```
//!
//! P and T are the spectra of photograph and target in the region, without their means and under a Hann window. Each
//! ring holds the frequencies between f and f + 0.01 cycles per pixel of the target. The resolution is the frequency
//! where c first falls below 0.5. There the photograph has as much light that is not the target's as that is. The
//! measure is the Fourier ring correlation (W. Saxton and W. Baumeister, J. Microscopy 127, 127 (1982)), with the
//! target in the place of a second picture. It does not depend on gain and offset. Blur alone, without noise, does not
//! lower it. Frequencies below 0.02 do not count: uneven light, not resolution, decides there.

use lightpath_optics::interrupt;
use lightpath_optics::reference::{Direction, fft2};
use lightpath_optics::{Plane, RegionOfInterest};
use num_complex::Complex64;
use std::f64::consts::PI;

/// Least correlation of a ring whose details count as shown.
pub const RING_CORRELATION_MIN: f64 = 0.5;
/// Number of rings up to the Nyquist frequency, 0.5 cycles per pixel.
const RINGS: usize = 50;
/// First ring that counts.
const FIRST_RING: usize = 2;
const NYQUIST: f64 = 0.5;

/// The finest details that photograph and target share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolution {
    /// Frequency up to which all rings correlate by at least [`RING_CORRELATION_MIN`] \[cycles per target pixel\], 0 to
    /// 0.5.
    pub cycles_per_px: f64,
}

/// Resolution of the light in the region. Both planes must cover the region.
#[must_use]
pub fn resolution(light: &Plane<f32>, target: &Plane<f32>, region: RegionOfInterest) -> Resolution {
    let rings = ring_correlations(light, target, region);
    // The middle of a ring.
    let at = |ring: f64| (ring + 0.5) * NYQUIST / RINGS as f64;
    let cycles_per_px = match (FIRST_RING..RINGS).find(|&i| rings[i] < RING_CORRELATION_MIN) {
        None => NYQUIST,
        Some(FIRST_RING) => 0.0,
        Some(i) => {
            let (before, after) = (rings[i - 1], rings[i]);
            at((i - 1) as f64 + (before - RING_CORRELATION_MIN) / (before - after))
        }
    };
    Resolution { cycles_per_px }
}

/// The correlation in each ring. Rings without light in either picture have that of the ring before; the first has 0.
fn ring_correlations(light: &Plane<f32>, target: &Plane<f32>, region: RegionOfInterest) -> Vec<f64> {
    // One transform for both real pictures.
    let [light, target] = [light, target].map(|plane| windowed(plane, region));
    let both = Plane::from_fn(region.height_px(), region.width_px(), |y, x| {
        Complex64::new(f64::from(light.at(y, x)), f64::from(target.at(y, x)))
    });
    let both = fft2(&both, Direction::Forward);
    let (h, w) = (both.height_px(), both.width_px());
    let frequency =
        |i: usize, side: usize| (if 2 * i < side { i as f64 } else { i as f64 - side as f64 }) / side as f64;
    let mut sums = vec![[0.0; 3]; RINGS];
    for y in 0..h {
        interrupt::check();
        for x in 0..w {
            let ring = (frequency(y, h).hypot(frequency(x, w)) / NYQUIST * RINGS as f64) as usize;
            let Some(sum) = sums.get_mut(ring) else { continue };
            let (here, there) = (both.at(y, x), both.at((h - y) % h, (w - x) % w).conj());
            let (p, t) = ((here + there) / 2.0, (here - there) / Complex64::new(0.0, 2.0));
            let parts = [(p.conj() * t).re, p.norm_sqr(), t.norm_sqr()];
            sum.iter_mut().zip(parts).for_each(|(sum, part)| *sum += part);
        }
    }
    let mut last = 0.0;
    let correlation = |[product, p, t]: [f64; 3]| {
        if p > 0.0 && t > 0.0 {
            last = product / (p * t).sqrt();
        }
        last
    };
    sums.into_iter().map(correlation).collect()
}

/// The region without its mean, under a Hann window.
fn windowed(plane: &Plane<f32>, region: RegionOfInterest) -> Plane<f32> {
    let (h, w) = (region.height_px(), region.width_px());
    let at = |y: usize, x: usize| plane.at(region.y_px() + y, region.x_px() + x);
    let sum: f64 = (0..h).flat_map(|y| (0..w).map(move |x| f64::from(at(y, x)))).sum();
    let mean = (sum / region.pixels() as f64) as f32;
    let hann = |i: usize, side: usize| (PI * (i as f64 + 0.5) / side as f64).sin().powi(2) as f32;
    let along_x: Vec<f32> = (0..w).map(|x| hann(x, w)).collect();
    Plane::from_fn(h, w, |y, x| hann(y, h) * along_x[x] * (at(y, x) - mean))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_optics::Grid;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const SIDE: usize = 256;

    /// Noise with the same energy at every frequency.
    fn noise(seed: u64) -> Plane<f32> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        Plane::from_fn(SIDE, SIDE, |_, _| random.random::<f32>() - 0.5)
    }

    fn found(light: &Plane<f32>, target: &Plane<f32>) -> f64 {
        let grid = Grid::try_new(SIDE, SIDE, 8e-6).unwrap();
        resolution(light, target, RegionOfInterest::full(&grid)).cycles_per_px
    }

    #[test]
    fn equal_pictures_have_full_and_unrelated_ones_no_resolution() {
        let target = noise(1);
        assert_eq!(found(&target.map(|v| 3.0 * v + 7.0), &target), NYQUIST);
        assert_eq!(found(&noise(2), &target), 0.0);
        assert_eq!(found(&Plane::filled(SIDE, SIDE, 1.0), &target), 0.0);
    }

    #[test]
    fn details_end_where_noise_replaces_them() {
        // The photograph has the target's frequencies up to a limit, and others above it.
        let (target, other) = (noise(1), noise(2));
        for limit in [0.1, 0.3] {
            let frequency = |i: usize| (if 2 * i < SIDE { i as f64 } else { i as f64 - SIDE as f64 }) / SIDE as f64;
            let spectrum = |plane: &Plane<f32>| fft2(&plane.map(|v| Complex64::from(f64::from(v))), Direction::Forward);
            let (a, b) = (spectrum(&target), spectrum(&other));
            let mixed = Plane::from_fn(SIDE, SIDE, |y, x| {
                if frequency(y).hypot(frequency(x)) < limit { a.at(y, x) } else { b.at(y, x) }
            });
            let light = fft2(&mixed, Direction::Inverse).map(|v| v.re as f32);
            let found = found(&light, &target);
            assert!((found - limit).abs() < 0.015, "{limit}: {found}");
        }
    }
}
