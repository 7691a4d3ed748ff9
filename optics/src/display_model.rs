//! A display as learning describes it.
//!
//! ```text
//! photograph ≈ gain · D( | H ∗ ( a · ( e^{i r(φ)} + z₀ ) ) |² ) + offset
//! ```
//!
//! H the kernel, a transfer function, which may [vary over the SLM](crate::SpatialVariation); a the source profile; r the
//! SLM's phase response; z₀ undiffracted light; D the [`Detector`](crate::Detector). Smooth parts are
//! [Chebyshev series](crate::chebyshev): of fx and fy over the band [−1/2Δ, 1/2Δ] for the kernel, of x and y over the SLM
//! for the source.

use crate::chebyshev::ChebyshevBasis;
use crate::spatial_variation::local_kernels;
use crate::{Error, OpticalSetup, Plane, Result, SpatialVariation};
use num_complex::{Complex32, Complex64};

/// How light travels from the SLM to the image, and what the SLM makes of a phase.
#[derive(Clone, Debug, PartialEq)]
pub struct DisplayModel {
    /// Grid, wavelength and distance.
    pub setup: OpticalSetup,
    /// The transfer function; on the axis where it changes over the SLM.
    pub kernel: KernelShape,
    /// How the transfer function changes over the SLM.
    pub variation: SpatialVariation,
    /// The light that falls on the SLM.
    pub source: SmoothField,
    /// [a_k, b_k] of r(φ) = φ + Σ_k (a_k sin kφ + b_k cos kφ), k = 1, 2, … \[rad\].
    pub response: Vec<[f64; 2]>,
    /// z₀, relative to the modulated light.
    pub zero_order: Complex64,
    /// Photograph per unit of light.
    pub gain: f64,
    /// The photograph's black level.
    pub offset: f64,
}

/// A transfer function, as parameters.
#[derive(Clone, Debug, PartialEq)]
pub enum KernelShape {
    /// H = H_ideal: free space.
    Ideal,
    /// H = H_ideal · exp(α + iψ) with smooth α and ψ.
    Smooth(SmoothField),
    /// H itself at the inner bins of the padded spectrum, zero outside: the plane is centred, zero frequency at
    /// `[height_px / 2][width_px / 2]`; both sides even and at most the padded ones.
    Bins(Plane<Complex32>),
}

/// exp(log_amplitude + i·phase), both Chebyshev series.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SmoothField {
    /// Highest total degree.
    pub order: usize,
    /// Coefficients of the logarithm of the amplitude, in the order of [`ChebyshevBasis::degrees`].
    pub log_amplitude: Vec<f64>,
    /// Coefficients of the phase \[rad\], in the same order.
    pub phase: Vec<f64>,
}

impl SmoothField {
    /// One everywhere.
    #[must_use]
    pub fn flat(order: usize) -> Self {
        let terms = ChebyshevBasis::new(order).terms();
        Self { order, log_amplitude: vec![0.0; terms], phase: vec![0.0; terms] }
    }

    /// Its polynomials.
    #[must_use]
    pub fn basis(&self) -> ChebyshevBasis {
        ChebyshevBasis::new(self.order)
    }

    /// The field's value, x and y in [−1, 1].
    #[must_use]
    pub fn value(&self, x: f64, y: f64) -> Complex64 {
        let basis = self.basis();
        Complex64::from_polar(basis.value(&self.log_amplitude, x, y).exp(), basis.value(&self.phase, x, y))
    }

    pub(crate) fn validate(&self) -> Result<()> {
        let terms = self.basis().terms();
        if self.order > ChebyshevBasis::ORDER_MAX {
            return Err(out_of_range("order", self.order as f64, "at most 12"));
        }
        for coefficients in [&self.log_amplitude, &self.phase] {
            if coefficients.len() != terms {
                let allowed = "as many as the order has terms";
                return Err(out_of_range("coefficients", coefficients.len() as f64, allowed));
            }
            expect_finite("coefficient", coefficients)?;
        }
        Ok(())
    }

    /// Multiplies the field by another one to the power of `factor`, of at most the same order.
    pub(crate) fn add(&mut self, factor: f64, other: &Self) {
        for (i, degrees) in self.basis().degrees().enumerate() {
            if let Some(k) = other.basis().degrees().position(|other| other == degrees) {
                self.log_amplitude[i] += factor * other.log_amplitude[k];
                self.phase[i] += factor * other.phase[k];
            }
        }
    }

    /// One everywhere, whatever the order.
    #[must_use]
    pub fn is_flat(&self) -> bool {
        self.log_amplitude.iter().chain(&self.phase).all(|&c| c == 0.0)
    }
}

impl DisplayModel {
    /// Most harmonics of the phase response.
    pub const HARMONICS_MAX: usize = 8;

    /// A display without flaws.
    #[must_use]
    pub fn ideal(setup: OpticalSetup) -> Self {
        Self {
            setup,
            kernel: KernelShape::Ideal,
            variation: SpatialVariation::none(),
            source: SmoothField::flat(0),
            response: Vec::new(),
            zero_order: Complex64::ZERO,
            gain: 1.0,
            offset: 0.0,
        }
    }

    /// # Errors
    ///
    /// [`Error`] for parameters that are not finite, do not match their order, or a kernel of bins that does not fit the
    /// padded spectrum.
    pub fn validate(&self) -> Result<()> {
        self.source.validate()?;
        if let KernelShape::Smooth(kernel) = &self.kernel {
            kernel.validate()?;
        }
        self.variation.validate(&self.kernel)?;
        if self.response.len() > Self::HARMONICS_MAX {
            return Err(out_of_range("response harmonics", self.response.len() as f64, "at most 8"));
        }
        expect_finite("response", self.response.as_flattened())?;
        expect_finite("model parameter", &[self.zero_order.re, self.zero_order.im, self.gain, self.offset])?;
        match &self.kernel {
            KernelShape::Ideal | KernelShape::Smooth(_) => Ok(()),
            KernelShape::Bins(bins) => self.validate_bins(bins),
        }
    }

    fn validate_bins(&self, bins: &Plane<Complex32>) -> Result<()> {
        for (name, side, padded) in [
            ("kernel height_px", bins.height_px(), self.setup.padded_height_px()),
            ("kernel width_px", bins.width_px(), self.setup.padded_width_px()),
        ] {
            if side == 0 || side > padded || side % 2 == 1 {
                return Err(out_of_range(name, side as f64, "even and at most twice the display's"));
            }
        }
        bins.map(|h| h.re + h.im).expect_finite("kernel")
    }

    /// Those of a grid of points on the SLM that stand for a kernel that changes over it; `None` where it is the same everywhere.
    pub(crate) fn local_kernels(&self) -> Option<Vec<Self>> {
        let KernelShape::Smooth(kernel) = &self.kernel else { return None };
        let local = |(x, y)| {
            let kernel = KernelShape::Smooth(self.variation.local_kernel(kernel, x, y));
            Self { kernel, variation: SpatialVariation::none(), ..self.clone() }
        };
        (!self.variation.is_none())
            .then(|| local_kernels::nodes(local_kernels::per_side(&self.variation)).map(local).collect())
    }

    /// H at fx, fy [1/m], on the axis. Where the setup's method is an impulse response it is a sum over the frame, anew each time.
    #[must_use]
    pub fn transfer(&self, fx: f64, fy: f64) -> Complex64 {
        self.beside_ideal(fx, fy, |fx, fy| self.setup.transfer(fx, fy))
    }

    /// [`Self::transfer`], with all that it needs tabulated: for many padded bins.
    pub fn sampled(&self) -> impl Fn(f64, f64) -> Complex64 + Sync + '_ {
        let ideal = self.setup.sampled();
        move |fx, fy| self.beside_ideal(fx, fy, |fx, fy| ideal.at(fx, fy))
    }

    fn beside_ideal(&self, fx: f64, fy: f64, ideal: impl Fn(f64, f64) -> Complex64) -> Complex64 {
        let pitch_m = self.setup.grid().pixel_pitch_m();
        match &self.kernel {
            KernelShape::Ideal => ideal(fx, fy),
            KernelShape::Smooth(errors) => ideal(fx, fy) * errors.value(2.0 * pitch_m * fx, 2.0 * pitch_m * fy),
            KernelShape::Bins(bins) => {
                let index = |f: f64, padded: usize, side: usize| {
                    let i = (f * pitch_m * padded as f64).round() + (side / 2) as f64;
                    (0.0..side as f64).contains(&i).then_some(i as usize)
                };
                let y = index(fy, self.setup.padded_height_px(), bins.height_px());
                let x = index(fx, self.setup.padded_width_px(), bins.width_px());
                let value = y.zip(x).map_or(Complex32::ZERO, |(y, x)| bins.at(y, x));
                Complex64::new(value.re.into(), value.im.into())
            }
        }
    }
}

pub(crate) fn out_of_range(name: &'static str, value: f64, allowed: &'static str) -> Error {
    Error::OutOfRange { name, value, allowed }
}

fn expect_finite(name: &'static str, values: &[f64]) -> Result<()> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(out_of_range(name, value, "a finite number")),
        None => Ok(()),
    }
}

/// Position of pixel `i` of `n` on [−1, 1], pixel centres.
pub(crate) fn position(i: usize, n: usize) -> f64 {
    (2 * i + 1) as f64 / n as f64 - 1.0
}
