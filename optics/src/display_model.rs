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

use crate::smooth_field::{SmoothField, expect_finite, out_of_range};
use crate::spatial_variation::local_kernels;
use crate::{OpticalSetup, Plane, Result, SpatialVariation};
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
    /// [`Error`](crate::Error) for parameters that are not finite, do not match their order, or a kernel of bins that does not fit the
    /// padded spectrum.
    pub fn validate(&self) -> Result<()> {
        self.source.validate()?;
        if let KernelShape::Smooth(kernel) = &self.kernel {
            kernel.validate()?;
        }
        if !self.variation.is_none() && !matches!(self.kernel, KernelShape::Smooth(_)) {
            let fields = self.variation.fields().len() as f64;
            return Err(out_of_range("fields of spatial variation", fields, "0 beside a kernel that is not smooth"));
        }
        self.variation.validate()?;
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
