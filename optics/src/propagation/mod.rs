//! How light gets from the display to the image: the methods, and which one is right where.
//!
//! Scalar diffraction from a plane of pixels to a parallel one. All methods give the same field where they are right, without the
//! piston e^{ikz}; towards negative distances they give the field that would become the one they are given. Each stands in a file of its
//! own with its equation and source.
//!
//! | method | what it computes | right where |
//! |---|---|---|
//! | [angular spectrum](PropagationMethod::AngularSpectrum) | H = e^{i2πz√(1/λ² − f²)} on the padded grid | z ≤ z_c |
//! | [band-limited](PropagationMethod::BandLimited) | the same for light that lands in the padded frame | all z, ringing beyond z_c |
//! | [Rayleigh–Sommerfeld](PropagationMethod::RayleighSommerfeld) | convolution with the sampled impulse response | z ≥ z_c |
//! | [shifted](PropagationMethod::Shifted) | band-limited, one-sided, to a window beside the axis | as band-limited |
//! | [Fresnel transfer function](PropagationMethod::FresnelTransferFunction) | H = e^{−iπλz f²} | z ≤ z_c, paraxial |
//! | [Fresnel impulse response](PropagationMethod::FresnelImpulseResponse) | convolution with e^{iπ(x² + y²)/λz}/(iλz), sampled | z ≥ z_c, paraxial |
//! | [band-extended](PropagationMethod::BandExtended) | angular spectrum at frequencies squeezed to \|f\| ≤ ½√(N/λz) | all z, some ringing beyond z_c |
//! | [scaled](PropagationMethod::Scaled) | angular spectrum onto a window of any pitch, size and place | all z |
//! | [scaled Fresnel](PropagationMethod::ScaledFresnel) | the Fresnel integral onto such a window | windows that all pixels reach, paraxial |
//! | [Fraunhofer](PropagationMethod::Fraunhofer) | one Fourier transform and a quadratic phase | z ≫ D²/λ |
//!
//! λ wavelength \[m\], z distance \[m\], f spatial frequency \[1/m\], N padded pixels along an axis, Δ pixel pitch \[m\], D the display's
//! diagonal \[m\], and z_c = N·Δ²/λ the critical distance of each axis. The first six are [convolutions](ConvolutionMethod) on the grid padded twofold: an
//! [`Engine`](crate::Engine) runs them, and holograms are optimized through them, when the setup is told to by
//! [`OpticalSetup::with_method`](crate::OpticalSetup::with_method). [`Propagator`](crate::Propagator) runs all of them, and their adjoints. [`plan`] and [`plan_onto`] choose one, say why, and
//! report how good it is there; what can't be right is refused, with the numbers. The direct sum that all are tested against is
//! [`reference::rayleigh_sommerfeld`](crate::reference::rayleigh_sommerfeld).

mod band_extended;
mod chirp_z;
mod fraunhofer;
mod frequency_window;
mod fresnel_impulse_response;
mod fresnel_transfer_function;
mod impulse_response;
mod limits;
pub mod planner;
mod quantity;
mod report;
mod rows;
mod scaled;
mod scaled_fresnel;
mod shifted;
mod transfer;

pub use crate::image_window::ImageWindow;
pub use crate::propagation_method::{ConvolutionMethod, PropagationMethod, RefusalCode};
pub use fraunhofer::fraunhofer_window;
pub use fresnel_impulse_response::fresnel_impulse_response;
pub use fresnel_transfer_function::fresnel_transfer_function;
pub use impulse_response::impulse_response;
pub use planner::{assess, assess_regardless, plan, plan_onto};
pub use report::{PropagationWarning, ValidityReport, WarningCode};
pub use transfer::SampledTransfer;

use shifted::shifted_angular_spectrum;

/// What a [`Propagator`](crate::Propagator) is made of.
pub(crate) mod passes {
    pub(crate) use super::band_extended::band_extended_axes;
    pub(crate) use super::fraunhofer::Fraunhofer;
    pub(crate) use super::frequency_window::{FrequencyWindow, check_frequencies};
    pub(crate) use super::limits::check;
    pub(crate) use super::planner::{method_onto, own_window};
    pub(crate) use super::scaled::scaled_axes;
    pub(crate) use super::scaled_fresnel::ScaledFresnel;
}
