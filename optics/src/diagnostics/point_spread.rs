//! Point spread function of an aberrated transfer function, and its modulation transfer function.
//!
//! ```text
//! PSF(x, y) = | F⁻¹ { P } |²,   P(fx, fy) = H / H_ideal on |fx|, |fy| < 1/2Δ
//! MTF(f) = | F { PSF }(f) | / F { PSF }(0)
//! ```
//!
//! Without aberrations P = 1: a sinc² spot with an FWHM of 0.886 Δ, and MTF = 1 − |f|Δ along the axes. Light that is
//! coherent over the image adds fields, not intensities; the MTF then gives the contrast averaged over phases.

use crate::numerics::Plane;
use crate::numerics::fourier::{Direction, fft2};
use num_complex::Complex64;

/// Number of samples of the band along an axis.
const BAND: usize = 256;
/// Number of samples of the spot per pixel of the display.
pub const OVERSAMPLING: usize = 4;
const SIDE: usize = BAND * OVERSAMPLING;
/// Half the side of the window around the spot that is returned \[px of the display\].
pub const WINDOW_PX: usize = 16;

/// The spot that a point becomes, and its measures.
#[derive(Clone, Debug, PartialEq)]
pub struct PointSpread {
    /// Intensity within ±`WINDOW_PX` pixels around the peak, 1 at the peak, with `OVERSAMPLING` samples per pixel.
    pub spot: Plane<f32>,
    /// Strehl ratio: the peak relative to that of an ideal spot of the same energy.
    pub strehl: f64,
    /// Full widths at half maximum through the peak, along x and y \[px\].
    pub fwhm_px: [f64; 2],
    /// Radius of the circle around the centre of light that holds half of the light \[px\].
    pub radius_50_px: f64,
    /// Radius of the circle around the centre of light that holds four fifths of the light \[px\].
    pub radius_80_px: f64,
    /// Displacement of the peak \[px\], x and y.
    pub shift_px: [f64; 2],
    /// Contrast at frequencies 0, 1/256, 2/256 … 1 \[cycles/px\], along x and along y.
    pub mtf: [Vec<f64>; 2],
    /// Lowest frequency along x and y at which half of the contrast is left \[cycles/px\].
    pub mtf_50: [f64; 2],
    /// Lowest frequency along x and y at which a tenth of the contrast is left \[cycles/px\].
    pub mtf_10: [f64; 2],
}

/// Computes the spot of a pupil function, which is given on \[−1, 1\]² in units of the Nyquist frequency.
#[must_use]
pub fn point_spread(pupil: impl Fn(f64, f64) -> Complex64) -> PointSpread {
    let signed = |i: usize| if i < SIDE / 2 { i as isize } else { i as isize - SIDE as isize };
    let half = (BAND / 2) as isize;
    let mut energy = 0.0;
    // Samples lie half a bin off the centre, so that the band is symmetric. Only the phase of the spot changes by that.
    let frequency_of = |k: isize| (k as f64 + 0.5) / half as f64;
    let spectrum = Plane::from_fn(SIDE, SIDE, |y, x| {
        let (v, u) = (signed(y), signed(x));
        if !(-half..half).contains(&u) || !(-half..half).contains(&v) {
            return Complex64::ZERO;
        }
        let value = pupil(frequency_of(u), frequency_of(v));
        energy += value.norm_sqr();
        value
    });
    let field = fft2(&spectrum, Direction::Inverse);
    let intensity = field.map(|value| value.norm_sqr());
    let peak = (0..SIDE * SIDE).max_by(|&a, &b| intensity.values()[a].total_cmp(&intensity.values()[b])).unwrap_or(0);
    let (peak_y, peak_x) = (peak / SIDE, peak % SIDE);
    let top = intensity.values()[peak];
    // Peak of an ideal pupil with this energy: |√(energy/n) · n / SIDE²|², n = BAND² bins.
    let ideal_top = energy * (BAND * BAND) as f64 / (SIDE as f64).powi(4);
    let at = |y: isize, x: isize| {
        let wrap = |i: usize, step: isize| (i as isize + step).rem_euclid(SIDE as isize) as usize;
        intensity.at(wrap(peak_y, y), wrap(peak_x, x))
    };
    let reach = (WINDOW_PX * OVERSAMPLING) as isize;
    let spot = Plane::from_fn(2 * reach as usize + 1, 2 * reach as usize + 1, |y, x| {
        (at(y as isize - reach, x as isize - reach) / top.max(f64::MIN_POSITIVE)) as f32
    });
    let px = |samples: f64| samples / OVERSAMPLING as f64;
    let transfer = fft2(&intensity.map(Complex64::from), Direction::Forward);
    let zero = transfer.at(0, 0).norm().max(f64::MIN_POSITIVE);
    // A bin is 1/SIDE of the sampling frequency of the spot, which is OVERSAMPLING samples per pixel.
    let mtf = [
        (0..=BAND).map(|i| transfer.at(0, i).norm() / zero).collect::<Vec<f64>>(),
        (0..=BAND).map(|i| transfer.at(i, 0).norm() / zero).collect(),
    ];
    let below = |level: f64| [0, 1].map(|axis| first_below(&mtf[axis], level) / BAND as f64);
    let radii = encircled(&intensity, [0.5, 0.8]);
    PointSpread {
        spot,
        strehl: if ideal_top > 0.0 { top / ideal_top } else { 0.0 },
        fwhm_px: [px(width(|i| at(0, i))), px(width(|i| at(i, 0)))],
        radius_50_px: px(radii[0]),
        radius_80_px: px(radii[1]),
        shift_px: [px(signed(peak_x) as f64), px(signed(peak_y) as f64)],
        mtf_50: below(0.5),
        mtf_10: below(0.1),
        mtf,
    }
}

/// Position where a curve first falls below a level, interpolated between its samples.
fn first_below(curve: &[f64], level: f64) -> f64 {
    match curve.iter().position(|value| *value < level) {
        None => (curve.len() - 1) as f64,
        Some(0) => 0.0,
        Some(i) => i as f64 - (level - curve[i]) / (curve[i - 1] - curve[i]),
    }
}

/// Full width at half maximum through the peak, interpolated between samples.
fn width(at: impl Fn(isize) -> f64) -> f64 {
    let half = at(0) / 2.0;
    let side = |sign: isize| {
        let mut i = 0;
        while i < (SIDE / 2) as isize && at(sign * (i + 1)) >= half {
            i += 1;
        }
        let (inside, outside) = (at(sign * i), at(sign * (i + 1)));
        i as f64 + if inside > outside { (inside - half) / (inside - outside) } else { 0.0 }
    };
    side(1) + side(-1)
}

/// Radii of the circles around the centre of light that hold the given parts of the light \[samples\].
fn encircled(intensity: &Plane<f64>, parts: [f64; 2]) -> [f64; 2] {
    // The centre is a mean on a circle, because the spot may extend across the edge.
    let (mut along_x, mut along_y, mut total) = (Complex64::ZERO, Complex64::ZERO, 0.0);
    let turn = |i: usize| Complex64::cis(std::f64::consts::TAU * i as f64 / SIDE as f64);
    for y in 0..SIDE {
        for (x, &value) in intensity.row(y).iter().enumerate() {
            along_x += value * turn(x);
            along_y += value * turn(y);
            total += value;
        }
    }
    let centre = |sum: Complex64| sum.arg() / std::f64::consts::TAU * SIDE as f64;
    let (cx, cy) = (centre(along_x), centre(along_y));
    let near = |i: usize, c: f64| (i as f64 - c + SIDE as f64 / 2.0).rem_euclid(SIDE as f64) - SIDE as f64 / 2.0;
    let mut by_radius = vec![0.0; SIDE];
    for y in 0..SIDE {
        for (x, &value) in intensity.row(y).iter().enumerate() {
            let radius = near(x, cx).hypot(near(y, cy));
            by_radius[(radius as usize).min(SIDE - 1)] += value;
        }
    }
    parts.map(|part| {
        let mut sum = 0.0;
        for (radius, light) in by_radius.iter().enumerate() {
            if sum + light >= part * total && *light > 0.0 {
                return radius as f64 + (part * total - sum) / light;
            }
            sum += light;
        }
        SIDE as f64
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spot_without_aberrations_matches_theory() {
        let ideal = point_spread(|_, _| Complex64::ONE);
        assert!((ideal.strehl - 1.0).abs() < 1e-9, "{}", ideal.strehl);
        assert_eq!(ideal.shift_px, [0.0, 0.0]);
        for axis in 0..2 {
            // sinc² has half its height at ±0.443 px; linear interpolation between samples adds a small error.
            assert!((ideal.fwhm_px[axis] - 0.886).abs() < 0.03, "{}", ideal.fwhm_px[axis]);
            for (i, value) in ideal.mtf[axis].iter().enumerate() {
                assert!((value - (1.0 - i as f64 / BAND as f64)).abs() < 1e-9, "{i}: {value}");
            }
            assert!((ideal.mtf_50[axis] - 0.5).abs() < 1e-9 && (ideal.mtf_10[axis] - 0.9).abs() < 1e-9);
        }
    }

    #[test]
    fn tilt_shifts_spot_and_defocus_widens_it() {
        // A phase of 2π · 3 px over half a cycle per pixel.
        let tilted = point_spread(|x, _| Complex64::cis(-std::f64::consts::TAU * 3.0 * x / 2.0));
        assert_eq!(tilted.shift_px, [3.0, 0.0]);
        assert!((tilted.strehl - 1.0).abs() < 1e-6);
        let blurred = point_spread(|x, y| Complex64::cis(2.0 * (x * x + y * y)));
        assert!(blurred.strehl < 0.6 && blurred.radius_80_px > 1.2 && blurred.mtf_50[0] < 0.45, "{blurred:?}");
    }
}
