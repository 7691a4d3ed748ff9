//! Errors of the optics of a display that shows all orders of its pixels.
//!
//! ```text
//! E(ν) = S(x, y) · B(u, v) · e^{i(τ_x s + τ_y t)}
//! x = 2ν_x limited to [−1, 1],   s = 2ν_x − x,   u = s/4 limited to [−1, 1],   y, t and v likewise
//! ```
//!
//! ν is the frequency of the light \[cycles per pixel\], which does not repeat from order to order. S are the smooth
//! errors in the band of the first order. Beyond the band they keep the value of the nearest frequency of it, because a
//! series would grow without bound there. The tilts τ_x and τ_y of the phase of S, its terms T_1(x) and T_1(y), go on,
//! because what moves the image moves all of its orders. B is a short series of what the frequency exceeds the band by,
//! constant in the band and more than two orders beyond it.

use crate::numerics::SmoothField;
use crate::numerics::smooth_field::SeriesAlongY;
use num_complex::Complex64;

/// What a frequency exceeds the band by at u = 1, in half bands.
const REACH: f64 = 4.0;

/// Errors at the frequencies of all orders.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct OrderErrors {
    smooth: SmoothField,
    beyond: SmoothField,
    /// τ_x and τ_y.
    tilts: [f64; 2],
}

impl OrderErrors {
    /// Errors in the band, and beyond it.
    pub(crate) fn new(smooth: &SmoothField, beyond: &SmoothField) -> Self {
        let term = |degrees| smooth.basis().degrees().position(|of_term| of_term == degrees);
        let tilts = [(1, 0), (0, 1)].map(|degrees| term(degrees).map_or(0.0, |term| smooth.phase[term]));
        Self { smooth: smooth.clone(), beyond: beyond.clone(), tilts }
    }

    /// The errors at all frequencies along y with one along x [cycles per pixel].
    pub(crate) fn along_y(&self, nu_x: f64) -> OrderErrorsAlongY {
        let [x, s, u] = place(nu_x);
        let smooth = SeriesAlongY::new(&self.smooth, x);
        let ends = [-1.0, 1.0].map(|y| smooth.at(y));
        let tilts_rad = [self.tilts[0] * s, self.tilts[1]];
        OrderErrorsAlongY { smooth, ends, beyond: SeriesAlongY::new(&self.beyond, u), tilts_rad }
    }
}

/// Errors of all orders along y.
pub(crate) struct OrderErrorsAlongY {
    smooth: SeriesAlongY,
    /// S at both ends of the band.
    ends: [Complex64; 2],
    beyond: SeriesAlongY,
    /// τ_x s and τ_y.
    tilts_rad: [f64; 2],
}

impl OrderErrorsAlongY {
    /// E at a frequency along y [cycles per pixel].
    pub(crate) fn at(&self, nu_y: f64) -> Complex64 {
        let [y, t, v] = place(nu_y);
        let smooth = match y {
            -1.0 => self.ends[0],
            1.0 => self.ends[1],
            _ => self.smooth.at(y),
        };
        let [along_x, along_y] = self.tilts_rad;
        smooth * self.beyond.at(v) * Complex64::cis(along_x + along_y * t)
    }
}

/// For a frequency along an axis [cycles per pixel] x, s and u: the nearest frequency of the band, what exceeds it, both
/// in half bands, and the place beyond the band.
pub(crate) fn place(nu: f64) -> [f64; 3] {
    let x = (2.0 * nu).clamp(-1.0, 1.0);
    let s = 2.0 * nu - x;
    [x, s, (s / REACH).clamp(-1.0, 1.0)]
}
