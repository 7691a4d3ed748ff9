//! The enumerations of the domain and those of the messages, value by value.

use crate::error::ApiError;
use crate::field::Field;
use lightpath_domain::dataset::{AlignmentMethod, Encoding, FindingKind, Split};
use lightpath_domain::job::{Fit, JobState};
use lightpath_media::kernel_formats::KernelFormat;
use lightpath_optics::photometry::Quantity;
use lightpath_optics::{Carrier, Detector, KernelModel, PropagationMethod};
use lightpath_proto::v1;

/// An enumeration that messages have too, as numbers of which 0 is unspecified.
pub(crate) trait OnWire: Sized {
    /// The value's number.
    fn to_wire(self) -> i32;

    /// The value of a number, `Some(None)` for unspecified; `None` for a number that is no value.
    fn from_wire(number: i32) -> Option<Option<Self>>;
}

impl Field {
    /// A value of an enumeration; `None` where it is unspecified.
    pub(crate) fn one_of<T: OnWire>(&self, number: i32) -> Result<Option<T>, ApiError> {
        T::from_wire(number).ok_or_else(|| self.invalid(format!("is {number}, which is no value of that enumeration")))
    }
}

/// Both ways for enumerations whose values have the same names.
macro_rules! same_values {
    ($($ours:ty = $wire:ty { $($value:ident)* })*) => {$(
        impl OnWire for $ours {
            fn to_wire(self) -> i32 {
                type Wire = $wire;
                match self {
                    $(Self::$value => Wire::$value.into(),)*
                }
            }

            fn from_wire(number: i32) -> Option<Option<Self>> {
                type Wire = $wire;
                Some(match Wire::try_from(number).ok()? {
                    Wire::Unspecified => None,
                    $(Wire::$value => Some(Self::$value),)*
                })
            }
        }
    )*};
}

same_values! {
    PropagationMethod = v1::PropagationMethod {
        AngularSpectrum BandLimited RayleighSommerfeld FresnelTransferFunction FresnelImpulseResponse
        Shifted BandExtended Scaled ScaledFresnel Fraunhofer
    }
    Detector = v1::Detector { Point Pixel Supersampled }
    KernelModel = v1::KernelModel { Paper Dense Smooth Display Varying }
    Carrier = v1::Carrier { HalfOrderX HalfOrderY }
    Quantity = v1::optimize_hologram::loss::Quantity { Intensity Amplitude }
    Fit = v1::optimize_hologram::Fit { Contain Cover Stretch Exact }
    Encoding = v1::Encoding { Linear Srgb }
    JobState = v1::job::State { Queued Running Succeeded Failed Cancelled }
    KernelFormat = v1::KernelFormat { Safetensors Compact Pt Npy Npz Complex64 F16 }
    AlignmentMethod = v1::alignment::Method { Points Dots Pairs }
    FindingKind = v1::finding::Kind {
        Black Saturated BlackClipped LowContrast Duplicate WrongHologram Misaligned Vignetting ExposureUnknown
    }
}

/// A pair that finalizing left out has no split; messages say so by a value of their own, which no request may have.
impl OnWire for Split {
    fn to_wire(self) -> i32 {
        match self {
            Self::Train => v1::Split::Train.into(),
            Self::Validation => v1::Split::Validation.into(),
            Self::Test => v1::Split::Test.into(),
        }
    }

    fn from_wire(number: i32) -> Option<Option<Self>> {
        match v1::Split::try_from(number).ok()? {
            v1::Split::Unspecified => Some(None),
            v1::Split::Train => Some(Some(Self::Train)),
            v1::Split::Validation => Some(Some(Self::Validation)),
            v1::Split::Test => Some(Some(Self::Test)),
            v1::Split::Excluded => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_come_back_and_unknown_numbers_are_named() {
        for method in PropagationMethod::ALL {
            assert_eq!(PropagationMethod::from_wire(method.to_wire()), Some(Some(method)));
        }
        let field = Field::new("detector");
        assert_eq!(field.one_of::<Detector>(0).unwrap(), None);
        let refusal = field.one_of::<Detector>(9).unwrap_err().to_string();
        assert_eq!(refusal, "detector is 9, which is no value of that enumeration");
        assert_eq!(Split::from_wire(v1::Split::Excluded.into()), None);
    }
}
