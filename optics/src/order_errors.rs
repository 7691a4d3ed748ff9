//! Errors of the optics of a display that shows all orders of its pixels.
//!
//! ```text
//! E(ν) = S(x, y) · B(u, v) · e^{4i(τ_x u + τ_y v)},   x = 2ν_x limited to [−1, 1],   u = (2ν_x − x)/4,   y and v likewise
//! ```
//!
//! ν is the frequency of the light \[cycles per pixel\], which does not repeat from order to order. S are the smooth
//! errors in the band of the first order. Beyond the band they keep the value of the nearest frequency of it, because a
//! series would grow without bound there. The tilts τ_x and τ_y of the phase of S, its terms T_1(x) and T_1(y), go on,
//! because what moves the image moves all of its orders. B is a short series of what the frequency exceeds the band by,
//! and constant in the band.

use crate::SmoothField;
use crate::engine::SeriesAlongY;
use num_complex::Complex64;

/// What a frequency exceeds the band by at u = 1, in half bands.
pub(crate) const REACH: f64 = 4.0;

/// Errors at the frequencies of all orders.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct OrderErrors {
    smooth: SmoothField,
    /// B with the tilts.
    beyond: SmoothField,
}

impl OrderErrors {
    /// Errors in the band, and beyond it.
    pub(crate) fn new(smooth: &SmoothField, beyond: &SmoothField) -> Self {
        let mut with_tilts = SmoothField::flat(beyond.order.max(1));
        with_tilts.add(1.0, beyond);
        for degrees in [(1, 0), (0, 1)] {
            let term = |field: &SmoothField| field.basis().degrees().position(|of_term| of_term == degrees);
            if let (Some(to), Some(from)) = (term(&with_tilts), term(smooth)) {
                with_tilts.phase[to] += REACH * smooth.phase[from];
            }
        }
        Self { smooth: smooth.clone(), beyond: with_tilts }
    }

    /// The errors at all frequencies along y with one along x [cycles per pixel].
    pub(crate) fn along_y(&self, nu_x: f64) -> OrderErrorsAlongY {
        let (x, u) = place(nu_x);
        let smooth = SeriesAlongY::new(&self.smooth, x);
        let ends = [-1.0, 1.0].map(|y| smooth.at(y));
        OrderErrorsAlongY { smooth, ends, beyond: SeriesAlongY::new(&self.beyond, u) }
    }
}

/// Errors of all orders along y.
pub(crate) struct OrderErrorsAlongY {
    smooth: SeriesAlongY,
    /// S at both ends of the band.
    ends: [Complex64; 2],
    beyond: SeriesAlongY,
}

impl OrderErrorsAlongY {
    /// E at a frequency along y [cycles per pixel].
    pub(crate) fn at(&self, nu_y: f64) -> Complex64 {
        let (y, v) = place(nu_y);
        let smooth = match y {
            -1.0 => self.ends[0],
            1.0 => self.ends[1],
            _ => self.smooth.at(y),
        };
        smooth * self.beyond.at(v)
    }
}

/// The nearest frequency of the band, in units of half the sampling frequency, and what exceeds it.
pub(crate) fn place(nu: f64) -> (f64, f64) {
    let x = (2.0 * nu).clamp(-1.0, 1.0);
    (x, (2.0 * nu - x) / REACH)
}
