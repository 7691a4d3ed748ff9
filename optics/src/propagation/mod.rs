//! Propagation of light from the display to the image: the methods, and the planner that chooses among them.
//!
//! The methods compute scalar diffraction from a plane of pixels to a parallel plane, without the piston e^{ikz}.
//! Methods that are valid for a setup give the same field. For a negative distance they give the field that would
//! propagate into the given one. Each method has a file of its own with its equation and source.
//!
//! | method | what it computes | valid for |
//! |---|---|---|
//! | [band response](PropagationMethod::BandResponse) | angular spectrum of the pixels' band, as a linear convolution | all z |
//! | [all orders](PropagationMethod::AllOrders) | convolution with the response of square pixels | displays without a filter |
//! | [angular spectrum](PropagationMethod::AngularSpectrum) | H = e^{i2πz√(1/λ² − f²)} on the padded grid | z ≤ z_c |
//! | [band-limited](PropagationMethod::BandLimited) | angular spectrum of the light that lands in the padded frame | all z, ringing beyond z_c |
//! | [Rayleigh–Sommerfeld](PropagationMethod::RayleighSommerfeld) | convolution with the sampled impulse response | z ≥ z_c |
//! | [shifted](PropagationMethod::Shifted) | band-limited, one-sided, to a window beside the axis | as band-limited |
//! | [Fresnel transfer function](PropagationMethod::FresnelTransferFunction) | H = e^{−iπλz f²} | z ≤ z_c, paraxial |
//! | [Fresnel impulse response](PropagationMethod::FresnelImpulseResponse) | convolution with e^{iπ(x² + y²)/λz}/(iλz), sampled | z ≥ z_c, paraxial |
//! | [band-extended](PropagationMethod::BandExtended) | angular spectrum at frequencies squeezed to \|f\| ≤ ½√(N/λz) | all z, some ringing beyond z_c |
//! | [scaled](PropagationMethod::Scaled) | angular spectrum onto a window of any pitch, size and position | all z |
//! | [scaled Fresnel](PropagationMethod::ScaledFresnel) | Fresnel integral onto a window of any pitch, size and position | windows that all pixels reach, paraxial |
//! | [Fraunhofer](PropagationMethod::Fraunhofer) | one Fourier transform and a quadratic phase | z ≫ D²/λ |
//!
//! λ wavelength \[m\], z distance \[m\], f spatial frequency \[1/m\], N padded pixels along an axis, Δ pixel pitch
//! \[m\], D the display's diagonal \[m\], and z_c = N·Δ²/λ the critical distance of each axis.
//!
//! The first eight methods are [convolutions](ConvolutionMethod) on the grid padded twofold. An
//! [`Engine`](crate::Engine) runs them and optimizes holograms through them;
//! [`OpticalSetup::with_method`](crate::OpticalSetup::with_method) chooses the method.
//! [`Propagator`](crate::Propagator) runs all twelve methods and their adjoints. [`plan`] and [`plan_onto`] choose a
//! method, explain the choice, and report its quality. They refuse a setup for which no method is valid, and give the
//! numbers. Tests compare all methods with the direct sum
//! [`reference::rayleigh_sommerfeld`](crate::reference::rayleigh_sommerfeld).

mod band_extended;
mod band_response;
mod band_samples;
mod chirp_z;
mod display_transfer;
mod even;
mod fraunhofer;
mod frequency_window;
mod fresnel_impulse_response;
mod fresnel_transfer_function;
mod impulse_response;
mod limits;
mod pixel_line;
mod pixel_response;
pub mod planner;
mod quantity;
mod report;
mod row_spectra;
mod rows;
mod scaled;
mod scaled_fresnel;
mod shifted;
mod transfer;
pub mod transfer_function;

pub use crate::display::ImageWindow;
pub use crate::propagation_method::{ConvolutionMethod, PropagationMethod, RefusalCode};
pub use fraunhofer::fraunhofer_window;
pub use fresnel_impulse_response::fresnel_impulse_response;
pub use fresnel_transfer_function::fresnel_transfer_function;
pub use impulse_response::impulse_response;
pub use planner::{assess, assess_regardless, plan, plan_onto};
pub use report::{PropagationWarning, ValidityReport, WarningCode};
pub use transfer::SampledTransfer;

/// The planned transforms that a [`Propagator`](crate::Propagator) runs.
pub(crate) mod passes {
    pub(crate) use super::band_extended::band_extended_axes;
    pub(crate) use super::band_response::{frequencies, peak_values};
    pub(crate) use super::band_samples::{BandSamples, band_samples, is_even};
    pub(crate) use super::fraunhofer::Fraunhofer;
    pub(crate) use super::frequency_window::{FrequencyWindow, check_frequencies};
    pub(crate) use super::limits::check;
    pub(crate) use super::planner::{method_onto, own_window};
    pub(crate) use super::row_spectra::{RowSpectra, has_sample_transfers, narrowed, widened};
    pub(crate) use super::scaled::scaled_axes;
    pub(crate) use super::scaled_fresnel::ScaledFresnel;
}
