//! Comparison of light with a target or a photographed picture.
//!
//! ```text
//! intensity:  e = s·p + o − t,    L = Σ w e² / Σ w,   g = ∂L/∂u* = 2 w s e u / (n Σ w)
//! amplitude:  e = s·√p − √t,      L = Σ w e² / Σ w,   g = ∂L/∂u* = w s e u / (n √p Σ w),   0 where p = 0
//! ```
//!
//! p is the detector's light, t the picture, s the gain, o the offset, w the weight (1 in the region of interest, 0 at
//! masked pixels), and u the field at each of the n sub-samples. With the detector `Supersampled` every sub-sample has
//! its own p and e.
//!
//! The module `fused` needs one pass over the field for the sums and the gradient, but the gain must be known
//! beforehand. The module `lights` keeps the light between two passes, for results that need all of the light first:
//! the gain that fits best, the mean over frames, and terms over neighbouring pixels.

mod fused;
pub(crate) mod lights;

use crate::display::Detector;
use crate::numerics::{Plane, RegionOfInterest};
use serde::{Deserialize, Serialize};

/// Quantity in which light and picture are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Intensity of the light.
    #[default]
    Intensity,
    /// Amplitude, the square root of the intensity. Dark parts have more weight than with intensity.
    Amplitude,
}

/// Weighted sums over pixels, in f64, from which loss, gain and offset follow. p and t are the light and the picture in
/// the [quantity](Quantity) that is compared.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// Σ w
    pub w: f64,
    /// Σ w p
    pub p: f64,
    /// Σ w p²
    pub pp: f64,
    /// Σ w t
    pub t: f64,
    /// Σ w t p
    pub tp: f64,
    /// Σ w t²
    pub tt: f64,
    /// Σ w e²
    pub ee: f64,
    /// Σ w e
    pub e: f64,
    /// Σ w e p
    pub ep: f64,
}

impl Sums {
    /// Loss L at the gain and offset of the comparison.
    #[must_use]
    pub fn loss(&self) -> f64 {
        self.ee / self.w
    }

    /// Gain that fits best without an offset: Σ w t p / Σ w p². 0 if there is no light.
    #[must_use]
    pub fn best_gain(&self) -> f64 {
        if self.pp > 0.0 { self.tp / self.pp } else { 0.0 }
    }

    /// Loss L at [`Self::best_gain`] without an offset.
    #[must_use]
    pub fn best_loss(&self) -> f64 {
        ((self.tt - self.best_gain() * self.tp) / self.w).max(0.0)
    }

    /// Gain and offset that together fit best.
    #[must_use]
    pub fn best_gain_and_offset(&self) -> (f64, f64) {
        let spread = self.pp - self.p * self.p / self.w;
        if spread <= f64::EPSILON * self.pp {
            return (self.best_gain(), 0.0);
        }
        let gain = (self.tp - self.t * self.p / self.w) / spread;
        (gain, (self.t - gain * self.p) / self.w)
    }

    /// Correlation of the light and the picture, −1 to 1; 0 if one of them is constant.
    #[must_use]
    pub fn correlation(&self) -> f64 {
        let spread = |square: f64, sum: f64| (square - sum * sum / self.w).max(0.0);
        let (light, picture) = (spread(self.pp, self.p), spread(self.tt, self.t));
        if light <= f64::EPSILON * self.pp || picture <= f64::EPSILON * self.tt {
            return 0.0;
        }
        (self.tp - self.t * self.p / self.w) / (light * picture).sqrt()
    }

    /// Loss L at [`Self::best_gain_and_offset`].
    ///
    /// ```text
    /// Σ w (s p + o − t)² / Σ w
    /// ```
    #[must_use]
    pub fn fitted_loss(&self) -> f64 {
        let Self { w, p, pp, t, tp, tt, .. } = self;
        let (s, o) = self.best_gain_and_offset();
        ((s * s * pp + o * o * w + tt + 2.0 * (s * o * p - s * tp - o * t)) / w).max(0.0)
    }

    /// Adds the sums of `other`.
    pub fn add(&mut self, other: &Self) {
        self.w += other.w;
        self.p += other.p;
        self.pp += other.pp;
        self.t += other.t;
        self.tp += other.tp;
        self.tt += other.tt;
        self.ee += other.ee;
        self.e += other.e;
        self.ep += other.ep;
    }
}

/// Parameters of a comparison of light with a picture.
#[derive(Clone, Debug)]
pub(crate) struct Comparison<'a, T> {
    pub(crate) quantity: Quantity,
    /// t, or √t if amplitudes are compared.
    pub(crate) picture: &'a Plane<T>,
    /// Weight w of each pixel; `None`: 1 everywhere.
    pub(crate) weight: Option<&'a Plane<T>>,
    pub(crate) region: RegionOfInterest,
    pub(crate) detector: Detector,
    pub(crate) gain: f64,
    pub(crate) offset: f64,
    /// Divisor of the gradient: the Σ w by which the loss is divided.
    pub(crate) weight_sum: f64,
}

impl Sums {
    pub(crate) fn divide(&mut self, by: f64) {
        for sum in [
            &mut self.w,
            &mut self.p,
            &mut self.pp,
            &mut self.t,
            &mut self.tp,
            &mut self.tt,
            &mut self.ee,
            &mut self.e,
            &mut self.ep,
        ] {
            *sum /= by;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sums_of(light: [f64; 4], picture: [f64; 4]) -> Sums {
        let sum = |f: &dyn Fn(f64, f64) -> f64| light.iter().zip(&picture).map(|(p, t)| f(*p, *t)).sum::<f64>();
        Sums {
            w: 4.0,
            p: sum(&|p, _| p),
            pp: sum(&|p, _| p * p),
            t: sum(&|_, t| t),
            tp: sum(&|p, t| t * p),
            tt: sum(&|_, t| t * t),
            ..Sums::default()
        }
    }

    #[test]
    fn fitted_loss_is_loss_at_best_gain_and_offset() {
        let (light, photo) = ([0.2, 0.5, 0.9, 0.4], [0.3, 0.4, 0.8, 0.5]);
        let at = |s: f64, o: f64| light.iter().zip(&photo).map(|(p, t)| (s * p + o - t).powi(2)).sum::<f64>() / 4.0;
        let sums = sums_of(light, photo);
        let (s, o) = sums.best_gain_and_offset();
        assert!((sums.fitted_loss() - at(s, o)).abs() < 1e-12);
        for (ds, d_o) in [(0.01, 0.0), (-0.01, 0.0), (0.0, 0.01), (0.0, -0.01)] {
            assert!(at(s + ds, o + d_o) > sums.fitted_loss());
        }
    }

    #[test]
    fn correlation_is_independent_of_gain_and_offset() {
        let light = [0.2, 0.5, 0.9, 0.4];
        assert!((sums_of(light, light.map(|p| 0.3 * p + 0.1)).correlation() - 1.0).abs() < 1e-12);
        assert!((sums_of(light, light.map(|p| 1.0 - p)).correlation() + 1.0).abs() < 1e-12);
        assert_eq!(sums_of(light, [0.5; 4]).correlation(), 0.0);
        // Σ (p − p̄)(t − t̄) / √(Σ (p − p̄)² Σ (t − t̄)²) by hand: 0.18 / √(0.26 · 0.14).
        assert!((sums_of(light, [0.3, 0.4, 0.8, 0.5]).correlation() - 0.18 / (0.26_f64 * 0.14).sqrt()).abs() < 1e-9);
    }
}
