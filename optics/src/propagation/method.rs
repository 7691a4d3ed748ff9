//! The names of the methods.

use std::fmt;

/// A way to compute the field at a distance. [`propagation`](super) says which is right where.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Method {
    /// The angular spectrum with all of its band, evanescent waves included.
    AngularSpectrum,
    /// The angular spectrum without the frequencies whose light would land beyond the padded frame: right at every
    /// distance, and where nothing lands beyond the frame the same as [`Method::AngularSpectrum`].
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

impl Method {
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

    /// Whether it is a convolution with a transfer function on the padded grid, so that an [`Engine`](crate::Engine) can
    /// run it and holograms can be optimized through it.
    #[must_use]
    pub fn is_convolution(self) -> bool {
        match self {
            Self::AngularSpectrum
            | Self::BandLimited
            | Self::Shifted
            | Self::RayleighSommerfeld
            | Self::FresnelTransferFunction
            | Self::FresnelImpulseResponse => true,
            Self::BandExtended | Self::Scaled | Self::ScaledFresnel | Self::Fraunhofer => false,
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

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
