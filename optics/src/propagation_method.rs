//! The methods of propagation by their names, and why one of them may be refused.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A way to compute the field at a distance. [`propagation`](crate::propagation) says which is right where.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PropagationMethod {
    /// The angular spectrum with all of its band, evanescent waves included.
    AngularSpectrum,
    /// The angular spectrum without the frequencies whose light would land beyond the padded frame: right at every
    /// distance, and where nothing lands beyond the frame the same as [`PropagationMethod::AngularSpectrum`].
    #[default]
    BandLimited,
    /// The band-limited angular spectrum on a window beside the axis, with one-sided limits.
    Shifted,
    /// The Rayleigh–Sommerfeld integral by its impulse response, sampled in space: right from the critical distance on.
    RayleighSommerfeld,
    /// The angular spectrum on a finer, narrower set of frequencies, for distances beyond the critical one.
    BandExtended,
    /// The angular spectrum onto a window of any pitch, size and place.
    Scaled,
    /// The paraxial integral onto a window of any pitch, size and place: right for windows that all pixels reach.
    ScaledFresnel,
    /// The paraxial transfer function.
    FresnelTransferFunction,
    /// The paraxial impulse response, sampled in space.
    FresnelImpulseResponse,
    /// The far field.
    Fraunhofer,
}

impl PropagationMethod {
    /// Every method, simple ones first.
    pub const ALL: [Self; 10] = [
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

    /// Its name in lower case, as in "the band-limited angular spectrum".
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
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

    /// Whether it takes the wave fronts for paraboloids, and sines of angles for their tangents.
    #[must_use]
    pub fn is_paraxial(self) -> bool {
        match self {
            Self::FresnelTransferFunction | Self::FresnelImpulseResponse | Self::ScaledFresnel | Self::Fraunhofer => {
                true
            }
            Self::AngularSpectrum
            | Self::BandLimited
            | Self::Shifted
            | Self::RayleighSommerfeld
            | Self::BandExtended
            | Self::Scaled => false,
        }
    }
}

impl fmt::Display for PropagationMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The methods that are convolutions with a transfer function on the padded grid. An [`Engine`](crate::Engine) runs them,
/// and holograms are optimized through them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ConvolutionMethod {
    /// See [`PropagationMethod::AngularSpectrum`].
    AngularSpectrum,
    /// See [`PropagationMethod::BandLimited`].
    #[default]
    BandLimited,
    /// See [`PropagationMethod::Shifted`].
    Shifted,
    /// See [`PropagationMethod::RayleighSommerfeld`].
    RayleighSommerfeld,
    /// See [`PropagationMethod::FresnelTransferFunction`].
    FresnelTransferFunction,
    /// See [`PropagationMethod::FresnelImpulseResponse`].
    FresnelImpulseResponse,
}

impl ConvolutionMethod {
    /// Every convolution, simple ones first.
    pub const ALL: [Self; 6] = [
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

/// Why a method can't be right for what it was asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
pub enum RefusalCode {
    /// The method is no convolution on the padded grid, and an engine was asked to run it.
    NoConvolution,
    /// The method has a window of its own, and another one was asked for.
    OtherWindow,
    /// No light lands in the window.
    WindowUnreachable,
    /// Too little of the band lands in the window to hold a picture.
    BandLost,
    /// The padded frame samples the transfer function too coarsely, so that light comes back on the other side.
    Aliased,
    /// The pixels sample the impulse response, or the integral's phase, too coarsely.
    Undersampled,
    /// The window would take more frequencies than are computed.
    TooManyFrequencies,
    /// The display is too large for the far field.
    NotFar,
    /// The light is too steep for a paraxial method.
    NotParaxial,
}
