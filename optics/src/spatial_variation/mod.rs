//! A kernel that changes over the SLM.
//!
//! ```text
//! H(f; x, y) = H(f) · exp( Σ_m P_m(x, y) ( α_m(f) + iψ_m(f) ) ),   P = x, y, x², xy, y²
//! u(r) = Σ over the SLM's pixels r′ of h(r − r′; r′) c(r′),   h( · ; r′) = F⁻¹ H( · ; r′)
//! ```
//!
//! x and y in [−1, 1] over the SLM, α_m and ψ_m Chebyshev series of f as the kernel's own. A relay that images the SLM has
//! aberrations that depend on where in its field a pixel lies, the third-order ones as these powers: coma as the first, field
//! curvature and astigmatism as the second (W. T. Welford, *Aberrations of Optical Systems*, 1986); so every pixel sends its
//! light through a transfer function of its own. What does not depend on f is the source profile's.
//!
//! [`local_kernels`] has how it is computed.

pub mod local_kernels;

use crate::Result;
use crate::smooth_field::{SmoothField, out_of_range};
use num_complex::Complex64;

/// How a kernel changes over the SLM: factors of x, y, x², xy and y², or none where it is the same everywhere.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SpatialVariation {
    fields: Vec<SmoothField>,
}

impl SpatialVariation {
    /// Powers of the place on the SLM.
    pub const POWERS: usize = 5;
    /// What they are called.
    pub const POWER_NAMES: [&str; Self::POWERS] = ["x", "y", "x²", "xy", "y²"];

    /// The same kernel everywhere.
    #[must_use]
    pub fn none() -> Self {
        Self::default()
    }

    /// Of one field for each power, all of one order.
    #[must_use]
    pub fn new(fields: [SmoothField; Self::POWERS]) -> Self {
        Self { fields: fields.into() }
    }

    /// Whether the kernel is the same everywhere.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.fields.is_empty()
    }

    /// One for each power, or none.
    #[must_use]
    pub fn fields(&self) -> &[SmoothField] {
        &self.fields
    }

    /// Highest total degree in f.
    #[must_use]
    pub fn order(&self) -> usize {
        self.fields.first().map_or(0, |field| field.order)
    }

    /// x, y, x², xy and y².
    #[must_use]
    pub fn powers(x: f64, y: f64) -> [f64; Self::POWERS] {
        [x, y, x * x, x * y, y * y]
    }

    /// The kernel at (x, y) of a display with `kernel` on the axis.
    #[must_use]
    pub fn local_kernel(&self, kernel: &SmoothField, x: f64, y: f64) -> SmoothField {
        let mut local = SmoothField::flat(kernel.order.max(self.order()));
        local.add(1.0, kernel);
        for (power, field) in Self::powers(x, y).into_iter().zip(&self.fields) {
            local.add(power, field);
        }
        local
    }

    /// ln( H(f; x, y) / H(f) ), all of x, y, and f in units of the band's edges in [−1, 1].
    #[must_use]
    pub fn exponent(&self, x: f64, y: f64, fx: f64, fy: f64) -> Complex64 {
        let value = |(power, field): (f64, &SmoothField)| {
            let basis = field.basis();
            power * Complex64::new(basis.value(&field.log_amplitude, fx, fy), basis.value(&field.phase, fx, fy))
        };
        Self::powers(x, y).into_iter().zip(&self.fields).map(value).sum()
    }

    /// # Errors
    ///
    /// [`Error`](crate::Error) for another number of fields than the powers have, or of different orders, and for coefficients
    /// that are not finite.
    pub(crate) fn validate(&self) -> Result<()> {
        if self.is_none() {
            return Ok(());
        }
        if self.fields.len() != Self::POWERS || self.fields.iter().any(|field| field.order != self.order()) {
            let allowed = "0, or 5 of one order";
            return Err(out_of_range("fields of spatial variation", self.fields.len() as f64, allowed));
        }
        self.fields.iter().try_for_each(SmoothField::validate)
    }
}
