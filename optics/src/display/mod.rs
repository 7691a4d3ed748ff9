//! What a display is: its pixels and the light on them, the orders that it shows, and its model: the parameters of its
//! light transport, which are learned from photographs. Each of its [parts] has a file.
//!
//! ```text
//! photograph ≈ gain · B( D( Σ_m w_m | H_m ∗ ( a d · ( e^{i r(ψ)} + z₀ ) ) |² ) ) + offset
//! ```
//!
//! H₀ is the kernel, a transfer function that may [vary over the SLM](crate::SpatialVariation) and have a [`Ghost`];
//! the H_m of further modes make the light [partially coherent](PartialCoherence). a is the source profile with the
//! SLM's uneven surface, d the [`Dust`], ψ the hologram's phase after [`Crosstalk`], r the SLM's phase response, which
//! may [vary](ResponseVariation), z₀ undiffracted light, D the [`Detector`], and B the [`LightBlur`].
//! Smooth parts are [Chebyshev series](crate::numerics::chebyshev): of fx and fy over the band [−1/2Δ, 1/2Δ] for the kernel, of x
//! and y over the SLM for the source.

pub mod carrier;
pub mod detector;
pub(crate) mod image_window;
mod order_filter;
mod orders;
pub mod parts;
pub mod phase_response;
pub mod setup;

pub use carrier::Carrier;
pub use detector::Detector;
pub use image_window::ImageWindow;
pub use order_filter::{FilterShape, OrderFilter};
pub use orders::Orders;
pub use parts::crosstalk::Crosstalk;
pub use parts::dust::Dust;
pub use parts::ghost::Ghost;
pub use parts::light_blur::LightBlur;
pub use parts::partial_coherence::{FurtherMode, PartialCoherence};
pub use parts::response_variation::ResponseVariation;
pub use parts::spatial_variation::SpatialVariation;
pub use setup::OpticalSetup;

use crate::error::{Error, Result};
use crate::numerics::smooth_field::{expect_finite, out_of_range};
use crate::numerics::{Plane, SmoothField};
use crate::propagation_method::ConvolutionMethod;
use num_complex::{Complex32, Complex64};
use parts::ghost::TransferErrors;
use parts::order_errors::OrderErrors;
use parts::spatial_variation::local_kernels;
use std::borrow::Cow;

/// Model of a display: the response of the SLM, the propagation of light from the SLM to the image, and the camera's
/// gain and offset.
#[derive(Clone, Debug, PartialEq)]
pub struct DisplayModel {
    /// Grid, wavelength, distance and propagation method.
    pub setup: OpticalSetup,
    /// Transfer function. If it varies over the SLM, this is its value on the axis.
    pub kernel: KernelShape,
    /// What the errors of a smooth kernel are beyond the band of the first order, on a display that shows all orders,
    /// relative to those of the nearest frequency of the band and to the kernel's tilts, which go on: a series of what a
    /// frequency exceeds the band by, in four half bands. Flat for other displays.
    pub beyond: SmoothField,
    /// Second image, by a factor of the transfer function. Only smooth kernels have one.
    pub ghost: Ghost,
    /// Variation of the transfer function over the SLM.
    pub variation: SpatialVariation,
    /// Further modes of the light. Only smooth kernels have them.
    pub coherence: PartialCoherence,
    /// Complex amplitude of the light that falls on the SLM.
    pub source: SmoothField,
    /// Dust and fringes in that light.
    pub dust: Dust,
    /// Harmonics [a_k, b_k] of the phase response r(φ) = φ + Σ_k (a_k sin kφ + b_k cos kφ), k = 1, 2, … \[rad\].
    pub response: Vec<[f64; 2]>,
    /// Variation of the phase response over the SLM.
    pub response_variation: ResponseVariation,
    /// Cross-talk between neighbouring pixels of the SLM.
    pub crosstalk: Crosstalk,
    /// Blur of the light in the image.
    pub light_blur: LightBlur,
    /// Undiffracted light z₀, as a complex amplitude relative to the modulated light.
    pub zero_order: Complex64,
    /// Value of the photograph per unit of light.
    pub gain: f64,
    /// Black level of the photograph.
    pub offset: f64,
}

/// Parameters of a transfer function.
#[derive(Clone, Debug, PartialEq)]
pub enum KernelShape {
    /// Free space, H = H_ideal.
    Ideal,
    /// Free space with smooth errors, H = H_ideal · exp(α + iψ) with smooth α and ψ.
    Smooth(SmoothField),
    /// Values of H at the inner bins of the padded spectrum; H is zero outside. The zero frequency is at `[height_px /
    /// 2][width_px / 2]`. Both sides must be even and at most as long as the padded sides.
    Bins(Plane<Complex32>),
}

impl DisplayModel {
    /// Largest number of harmonics of the phase response.
    pub const HARMONICS_MAX: usize = 8;

    /// Model of a display without errors.
    #[must_use]
    pub fn ideal(setup: OpticalSetup) -> Self {
        Self {
            setup,
            kernel: KernelShape::Ideal,
            beyond: SmoothField::flat(0),
            ghost: Ghost::NONE,
            variation: SpatialVariation::none(),
            coherence: PartialCoherence::none(),
            source: SmoothField::flat(0),
            dust: Dust::none(),
            response: Vec::new(),
            response_variation: ResponseVariation::none(),
            crosstalk: Crosstalk::NONE,
            light_blur: LightBlur::NONE,
            zero_order: Complex64::ZERO,
            gain: 1.0,
            offset: 0.0,
        }
    }

    /// Checks that all parameters are valid and consistent.
    ///
    /// # Errors
    ///
    /// [`Error`] for parameters that are not finite, numbers of coefficients that do not match their order, dust of
    /// another size than the display, too many harmonics, a variation over the SLM, a ghost or further modes of a
    /// kernel that is not smooth, or a kernel of bins that does not fit the padded spectrum.
    pub fn validate(&self) -> Result<()> {
        self.source.validate()?;
        self.dust.validate(self.setup.grid().height_px(), self.setup.grid().width_px())?;
        if let KernelShape::Smooth(kernel) = &self.kernel {
            kernel.validate()?;
        }
        if !self.variation.is_none() && !matches!(self.kernel, KernelShape::Smooth(_)) {
            let fields = self.variation.fields().len() as f64;
            return Err(out_of_range("fields of spatial variation", fields, "0 for a kernel that is not smooth"));
        }
        self.beyond.validate()?;
        if !self.beyond.is_flat() && self.order_errors().is_none() {
            let reason = "only a smooth kernel of a display that shows all orders has errors beyond the band";
            return Err(Error::Incompatible { name: "beyond", reason });
        }
        self.ghost.validate()?;
        if !self.ghost.is_none() && !matches!(self.kernel, KernelShape::Smooth(_)) {
            let reason = "only a smooth kernel has a ghost beside it";
            return Err(Error::Incompatible { name: "ghost", reason });
        }
        if !self.coherence.is_none() && !matches!(self.kernel, KernelShape::Smooth(_)) {
            let reason = "only a smooth kernel has further modes of light";
            return Err(Error::Incompatible { name: "coherence", reason });
        }
        self.coherence.validate()?;
        self.variation.validate()?;
        if self.response.len() > Self::HARMONICS_MAX {
            return Err(out_of_range("response harmonics", self.response.len() as f64, "at most 8"));
        }
        expect_finite("response", self.response.as_flattened())?;
        self.response_variation.validate()?;
        self.crosstalk.validate()?;
        self.light_blur.validate()?;
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
                return Err(out_of_range(name, side as f64, "even and at most twice the side of the display"));
            }
        }
        if self.setup.method() == ConvolutionMethod::AllOrders {
            let reason =
                "a display with all orders has a transfer function for each sub-sample, not a single one of bins";
            return Err(Error::Incompatible { name: "kernel", reason });
        }
        bins.map(|h| h.re + h.im).expect_finite("kernel")?;
        if bins.values().iter().all(|h| *h == Complex32::ZERO) {
            return Err(Error::Incompatible { name: "kernel", reason: "it is zero everywhere, so no light passes" });
        }
        Ok(())
    }

    /// Errors of a smooth kernel that differ from order to order, on a display that shows all orders; `None` for other
    /// kernels and displays.
    pub(crate) fn order_errors(&self) -> Option<OrderErrors> {
        match &self.kernel {
            KernelShape::Smooth(smooth) if self.setup.orders().are_all() => {
                Some(OrderErrors::new(smooth, &self.beyond))
            }
            _ => None,
        }
    }

    fn kernel_order(&self) -> usize {
        match &self.kernel {
            KernelShape::Smooth(kernel) => kernel.order,
            KernelShape::Ideal | KernelShape::Bins(_) => 0,
        }
    }

    /// Model of what multiplies the pixels' spectrum. On a display that shows all orders, these are errors that repeat
    /// in every order: all but those of the kernel itself.
    pub(crate) fn on_spectrum(&self) -> Cow<'_, Self> {
        match self.order_errors() {
            None => Cow::Borrowed(self),
            Some(_) => Cow::Owned(Self {
                // The order of the kernel, which its variation and the modes do not exceed.
                kernel: KernelShape::Smooth(SmoothField::flat(self.kernel_order())),
                ghost: self.ghost,
                variation: self.variation.clone(),
                coherence: self.coherence.clone(),
                ..Self::ideal(self.setup)
            }),
        }
    }

    /// Errors of a smooth kernel with its ghost; `None` for other kernels.
    pub(crate) fn transfer_errors(&self) -> Option<TransferErrors> {
        match &self.kernel {
            KernelShape::Smooth(smooth) => Some(TransferErrors { smooth: smooth.clone(), ghost: self.ghost }),
            KernelShape::Ideal | KernelShape::Bins(_) => None,
        }
    }

    /// The display with all light in one mode, between the others.
    #[must_use]
    pub fn in_one_mode(&self) -> Self {
        let mut model = self.clone();
        let mean = std::mem::take(&mut model.coherence).mean_errors();
        if let (KernelShape::Smooth(kernel), false) = (&mut model.kernel, self.coherence.is_none()) {
            let first = std::mem::replace(kernel, SmoothField::flat(kernel.order.max(mean.order)));
            [&first, &mean].iter().for_each(|part| kernel.add(1.0, part));
        }
        model
    }

    /// The display's first mode of light, then the transfer function of each further mode, without the SLM that it
    /// shares with the first.
    pub(crate) fn modes(&self) -> impl Iterator<Item = Cow<'_, Self>> {
        let alone = |mode: &FurtherMode| {
            let KernelShape::Smooth(first) = &self.kernel else {
                unreachable!("only a smooth kernel has further modes of light")
            };
            let mut both = SmoothField::flat(first.order.max(mode.errors.order));
            [first, &mode.errors].iter().for_each(|part| both.add(1.0, part));
            let (ghost, variation) = (self.ghost, self.variation.clone());
            Cow::Owned(Self { kernel: KernelShape::Smooth(both), ghost, variation, ..Self::ideal(self.setup) })
        };
        std::iter::once(Cow::Borrowed(self)).chain(self.coherence.modes().iter().map(alone))
    }

    /// Models of the transfer function at a grid of points on the SLM, which approximate one that varies over the SLM;
    /// `None` if it does not vary.
    pub(crate) fn local_kernels(&self) -> Option<Vec<Self>> {
        let KernelShape::Smooth(kernel) = &self.kernel else { return None };
        let local = |(x, y)| {
            let kernel = KernelShape::Smooth(self.variation.local_kernel(kernel, x, y));
            Self { kernel, ghost: self.ghost, ..Self::ideal(self.setup) }
        };
        (!self.variation.is_none())
            .then(|| local_kernels::nodes(local_kernels::per_side(&self.variation)).map(local).collect())
    }
}
