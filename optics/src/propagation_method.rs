//! Names of the propagation methods, and reasons to refuse a method.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Method that computes the field at a distance. The module [`propagation`](crate::propagation) describes where each
/// method is accurate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PropagationMethod {
    /// Angular spectrum with its full band, including evanescent waves.
    AngularSpectrum,
    /// Angular spectrum without the frequencies whose light would land beyond the padded frame. It is accurate at every
    /// distance. If no light lands beyond the frame, it equals [`PropagationMethod::AngularSpectrum`].
    #[default]
    BandLimited,
    /// Band-limited angular spectrum on a window away from the axis, with one-sided limits.
    Shifted,
    /// Rayleigh–Sommerfeld integral with its impulse response sampled in space. It is accurate from the critical
    /// distance on.
    RayleighSommerfeld,
    /// Angular spectrum on a finer, narrower set of frequencies, for distances beyond the critical distance.
    BandExtended,
    /// Angular spectrum onto a window of any pitch, size and position.
    Scaled,
    /// Paraxial integral onto a window of any pitch, size and position. It is accurate for windows that the light of
    /// all pixels reaches.
    ScaledFresnel,
    /// Paraxial transfer function.
    FresnelTransferFunction,
    /// Paraxial impulse response, sampled in space.
    FresnelImpulseResponse,
    /// Fraunhofer diffraction, for the far field.
    Fraunhofer,
}

impl PropagationMethod {
    /// All methods, the simplest first.
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

    /// Name of the method for use in a sentence, such as "band-limited angular spectrum".
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

    /// Whether the method is paraxial: it approximates wave fronts by paraboloids, and sines of angles by tangents.
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

/// Propagation method that is a convolution with a transfer function on the padded grid. An [`Engine`](crate::Engine)
/// and the optimization of holograms use these methods.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ConvolutionMethod {
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
    /// All convolution methods, the simplest first.
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

/// Reason why a method cannot compute the requested propagation correctly.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
pub enum RefusalCode {
    /// The method is not a convolution on the padded grid, so an engine cannot run it.
    NoConvolution,
    /// The method has a fixed window, and another window was requested.
    OtherWindow,
    /// No light lands in the window.
    WindowUnreachable,
    /// Too little of the band lands in the window for a picture.
    BandLost,
    /// The padded frame samples the transfer function too coarsely, so that light reappears on the opposite side.
    Aliased,
    /// The pixels sample the impulse response or the phase of the integral too coarsely.
    Undersampled,
    /// The window needs more frequencies than the limit.
    TooManyFrequencies,
    /// The display is too large for the far field.
    NotFar,
    /// The angles of the light are too large for a paraxial method.
    NotParaxial,
}
