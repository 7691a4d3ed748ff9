//! The border between learning and what computes for it: the loss of a pair, and its gradient by a display's series.
//!
//! ```text
//! L = Σ w ( s p + o − photo )² / Σ w                                  s, o: gain and offset with the least L
//! ∂L/∂α_T = 2 Re Σ_f H u g* T,   ∂L/∂ψ_T = −2 Im Σ_f H u g* T            transfer function H = H_ideal exp( Σ (α_T + iψ_T) T )
//! ∂L/∂n = 2 Re Σ_x b* ∂c/∂n                                           number n of the modulator
//! ```
//!
//! u is the spectrum of the field c behind the modulator, g that of the gradient ∂L/∂U* of the field in the image, b the
//! gradient that arrives at the modulator. A body hands over sums in f64 and knows nothing of θ: the
//! [layout](super::layout::Layout) projects them onto θ.

use super::layout::Layout;
use super::pair::Example;
use crate::display::DisplayModel;
use crate::engine::photometry::Sums;

/// What computes losses of pairs and their gradients. The processor's body is [`Fit`](super::fit::Fit).
pub(crate) trait FieldAdjoint<T> {
    /// Takes a display at a plane. `layout` says which series are learned, also of parts that the display has not yet.
    fn set(&mut self, plane: usize, layout: &Layout, model: &DisplayModel);

    /// Photometric sums of the light for a pair, at gain 1 and offset 0.
    fn measure(&mut self, example: &Example<T>) -> Sums;

    /// Photometric sums of a pair at its best gain and offset, and the gradient of their loss. The derivatives by gain
    /// and offset are zero there, so the gradient is the one at fixed gain and offset.
    fn adjoint(&mut self, example: &Example<T>) -> (Sums, Adjoint);
}

/// ∂L/∂α and ∂L/∂ψ of each coefficient of a series α + iψ.
pub(crate) type SeriesGradient = (Vec<f64>, Vec<f64>);

/// Gradient of a pair's loss by the numbers of the display's series.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Adjoint {
    /// By the transfer functions of each mode of light.
    pub(crate) modes: Vec<ModeAdjoint>,
    /// By errors that differ from order to order, on a display that shows all orders.
    pub(crate) orders: Option<OrdersAdjoint>,
    /// By the numbers of the ghost.
    pub(crate) ghost: Option<[f64; 5]>,
    /// By the q of the blur of the light along x and along y.
    pub(crate) blur: Option<[f64; 2]>,
    /// By the modulator and the light on it.
    pub(crate) modulator: Option<ModulatorAdjoint>,
}

/// Gradient by the transfer functions of a mode of light.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ModeAdjoint {
    /// By the logarithm of the mode's amplitude: Σ_f Re H u g* over all kernels.
    pub(crate) light: f64,
    /// By the errors of each local kernel, at index j · n + i of n · n; a single one for a kernel that does not vary.
    pub(crate) kernels: Vec<SeriesGradient>,
}

/// Gradient by errors that differ from order to order.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct OrdersAdjoint {
    /// By the errors in the band.
    pub(crate) band: SeriesGradient,
    /// By the errors beyond the band.
    pub(crate) beyond: SeriesGradient,
    /// What the tilts along x and y do beyond the band.
    pub(crate) tilts_beyond: [f64; 2],
}

/// Gradient by the modulator and the light on it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ModulatorAdjoint {
    /// By the source.
    pub(crate) source: SeriesGradient,
    /// By the harmonics [a_k, b_k] of the phase response.
    pub(crate) response: Vec<[f64; 2]>,
    /// By real and imaginary part of the undiffracted light.
    pub(crate) zero_order: [f64; 2],
    /// By the q of the cross-talk along x and along y.
    pub(crate) crosstalk: [f64; 2],
    /// By the coefficients of the response's variation over the SLM.
    pub(crate) variation: Vec<f64>,
}
