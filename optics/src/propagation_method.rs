//! The names of the propagation methods, and the reasons for refusing a method.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A method to compute the field at a distance. [`propagation`](crate::propagation) says where each method is valid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PropagationMethod {
    /// Convolution with the impulse response of the pixels' band: the angular spectrum of a display that shows the
    /// first order of its pixels. No light wraps around, at any distance.
    BandResponse,
    /// Convolution with the response of square pixels: all diffraction orders of a display without a filter. No light
    /// wraps around, at any distance.
    AllOrders,
    /// The angular spectrum with its whole band, evanescent waves included.
    AngularSpectrum,
    /// The angular spectrum without the frequencies whose light would land beyond the padded frame. It is valid at
    /// every distance. Where no light lands beyond the frame it equals [`PropagationMethod::AngularSpectrum`].
    #[default]
    BandLimited,
    /// Band-limited angular spectrum on a window away from the axis, with one-sided limits.
    Shifted,
    /// The Rayleigh–Sommerfeld integral by its impulse response, sampled in space. It is valid at and beyond the
    /// critical distance.
    RayleighSommerfeld,
    /// The angular spectrum on finer frequencies in a narrower band, for distances beyond the critical distance.
    BandExtended,
    /// The angular spectrum onto a window of any pitch, size and position.
    Scaled,
    /// The Fresnel (paraxial) integral onto a window of any pitch, size and position. It is valid for windows that all
    /// pixels reach.
    ScaledFresnel,
    /// The Fresnel (paraxial) transfer function.
    FresnelTransferFunction,
    /// The Fresnel (paraxial) impulse response, sampled in space.
    FresnelImpulseResponse,
    /// The far field (Fraunhofer diffraction).
    Fraunhofer,
}

impl PropagationMethod {
    /// All methods, the simplest first.
    pub const ALL: [Self; 12] = [
        Self::BandResponse,
        Self::AllOrders,
        Self::AngularSpectrum,
        Self::BandLimited,
        Self::BandExtended,
        Self::RayleighSommerfeld,
        Self::FresnelTransferFunction,
        Self::FresnelImpulseResponse,
        Self::Shifted,
        Self::Scaled,
        Self::ScaledFresnel,
        Self::Fraunhofer,
    ];

    /// The name of the method in lower case, for sentences such as "the band-limited angular spectrum".
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::BandResponse => "band response",
            Self::AllOrders => "response of square pixels",
            Self::AngularSpectrum => "angular spectrum",
            Self::BandLimited => "band-limited angular spectrum",
            Self::Shifted => "shifted angular spectrum",
            Self::BandExtended => "band-extended angular spectrum",
            Self::Scaled => "scaled angular spectrum",
            Self::RayleighSommerfeld => "Rayleigh–Sommerfeld impulse response",
            Self::ScaledFresnel => "scaled Fresnel integral",
            Self::FresnelTransferFunction => "Fresnel transfer function",
            Self::FresnelImpulseResponse => "Fresnel impulse response",
            Self::Fraunhofer => "Fraunhofer diffraction",
        }
    }
}

impl fmt::Display for PropagationMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The methods that are convolutions with a transfer function on the padded grid. An [`Engine`](crate::Engine) runs
/// them and optimizes holograms through them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ConvolutionMethod {
    /// Band response, see [`PropagationMethod::BandResponse`].
    BandResponse,
    /// Response of square pixels, see [`PropagationMethod::AllOrders`].
    AllOrders,
    /// Angular spectrum with its full band, see [`PropagationMethod::AngularSpectrum`].
    AngularSpectrum,
    /// Band-limited angular spectrum, see [`PropagationMethod::BandLimited`].
    #[default]
    BandLimited,
    /// Band-limited angular spectrum on a window away from the axis, see [`PropagationMethod::Shifted`].
    Shifted,
    /// Rayleigh–Sommerfeld impulse response, see [`PropagationMethod::RayleighSommerfeld`].
    RayleighSommerfeld,
    /// Paraxial transfer function, see [`PropagationMethod::FresnelTransferFunction`].
    FresnelTransferFunction,
    /// Paraxial impulse response, see [`PropagationMethod::FresnelImpulseResponse`].
    FresnelImpulseResponse,
}

impl ConvolutionMethod {
    /// Every convolution method, simple ones first.
    pub const ALL: [Self; 8] = [
        Self::BandResponse,
        Self::AllOrders,
        Self::AngularSpectrum,
        Self::BandLimited,
        Self::RayleighSommerfeld,
        Self::FresnelTransferFunction,
        Self::FresnelImpulseResponse,
        Self::Shifted,
    ];
}

impl From<ConvolutionMethod> for PropagationMethod {
    fn from(method: ConvolutionMethod) -> Self {
        match method {
            ConvolutionMethod::BandResponse => Self::BandResponse,
            ConvolutionMethod::AllOrders => Self::AllOrders,
            ConvolutionMethod::AngularSpectrum => Self::AngularSpectrum,
            ConvolutionMethod::BandLimited => Self::BandLimited,
            ConvolutionMethod::Shifted => Self::Shifted,
            ConvolutionMethod::RayleighSommerfeld => Self::RayleighSommerfeld,
            ConvolutionMethod::FresnelTransferFunction => Self::FresnelTransferFunction,
            ConvolutionMethod::FresnelImpulseResponse => Self::FresnelImpulseResponse,
        }
    }
}

impl fmt::Display for ConvolutionMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        PropagationMethod::from(*self).fmt(f)
    }
}

/// Why a method was refused for a setup and a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
pub enum RefusalCode {
    /// An engine was asked to run a method that is not a convolution on the padded grid.
    NoConvolution,
    /// The method prescribes its window, and another window was asked for.
    OtherWindow,
    /// No light lands in the window.
    WindowUnreachable,
    /// Too little of the band lands in the window to form a picture.
    BandLost,
    /// The padded frame samples the transfer function too coarsely. Light that leaves on one side would come back on
    /// the other.
    Aliased,
    /// The pixels sample the impulse response or the phase of the integral too coarsely.
    Undersampled,
    /// The method computes other diffraction orders than the display shows.
    OtherOrders,
    /// The image is nearer than the size of a pixel allows.
    TooNear,
    /// The method would take more frequencies than the limit allows.
    TooManyFrequencies,
    /// The distance is too small, or the display too large, for the far field.
    NotFar,
    /// The angles of the light are too steep for a paraxial method.
    NotParaxial,
}
