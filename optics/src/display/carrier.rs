//! Carrier grating, which steers the image away from the undiffracted light.
//!
//! ```text
//! φ'(y, x) = φ(y, x) + π · (x mod 2)   [or y mod 2],   sin θ = λ / (2Δ)
//! ```
//!
//! A phase of π on alternate columns is a grating of half a cycle per pixel. It moves the image by half the diffraction
//! order, to the angle θ. Light that the modulator does not modulate keeps its direction. λ is the wavelength \[m\], Δ
//! the pixel pitch \[m\].

use super::phase_response::wrap_f32;
use crate::numerics::Plane;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Binary grating that is added to a hologram after its optimization and steers the image by half the diffraction
/// order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Carrier {
    /// Adds π on every odd column.
    HalfOrderX,
    /// Adds π on every odd row.
    HalfOrderY,
}

impl Carrier {
    /// Factor by which the grating multiplies the field at (y, x): 1 or −1.
    #[must_use]
    pub fn sign(self, y: usize, x: usize) -> f64 {
        if self.is_odd(y, x) { -1.0 } else { 1.0 }
    }

    /// Whether the grating adds π at (y, x).
    #[inline(always)]
    pub(crate) fn is_odd(self, y: usize, x: usize) -> bool {
        let along = match self {
            Self::HalfOrderX => x,
            Self::HalfOrderY => y,
        };
        along % 2 == 1
    }

    /// Returns the hologram with the grating added, as phases \[rad\] in [0, 2π). Adding the grating twice restores the
    /// hologram.
    #[must_use]
    pub fn applied_to(self, phase: &Plane<f32>) -> Plane<f32> {
        Plane::from_fn(phase.height_px(), phase.width_px(), |y, x| {
            let steered = if self.sign(y, x) < 0.0 { PI } else { 0.0 };
            wrap_f32(f64::from(phase.at(y, x)) + steered)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    #[test]
    fn carrier_adds_pi_on_alternate_columns_or_rows() {
        let flat = Plane::filled(2, 3, 1.0f32);
        let up = (1.0 + PI) as f32;
        assert_eq!(Carrier::HalfOrderX.applied_to(&flat).values(), [1.0, up, 1.0, 1.0, up, 1.0]);
        assert_eq!(Carrier::HalfOrderY.applied_to(&flat).values(), [1.0, 1.0, 1.0, up, up, up]);
        let wrapped = Carrier::HalfOrderX.applied_to(&Plane::filled(1, 2, 4.0));
        assert!((f64::from(wrapped.at(0, 1)) - (4.0 + PI - TAU)).abs() < 1e-6);
    }

    proptest! {
        #[test]
        fn carrier_phase_matches_sign_and_cancels_when_repeated(phase in 0.0f32..6.25, y in 0usize..4, x in 0usize..4) {
            for carrier in [Carrier::HalfOrderX, Carrier::HalfOrderY] {
                let plane = Plane::filled(4, 4, phase);
                let steered = carrier.applied_to(&plane);
                let expected = carrier.sign(y, x) * f64::from(phase).cos();
                prop_assert!((f64::from(steered.at(y, x)).cos() - expected).abs() < 1e-6);
                let back = f64::from(carrier.applied_to(&steered).at(y, x));
                prop_assert!((back.cos() - f64::from(phase).cos()).abs() < 1e-6);
            }
        }
    }
}
