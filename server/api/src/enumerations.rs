//! Conversion of enumerations from and to messages.

use lightpath_domain::dataset::{AlignmentMethod, Encoding, FindingKind, Split};
use lightpath_domain::job::{Area, Fit, JobState, Judging};
use lightpath_domain::rollout::RolloutState;
use lightpath_media::kernel_formats::KernelFormat;
use lightpath_optics::engine::photometry::Quantity;
use lightpath_optics::{Carrier, Detector, FilterShape, KernelModel, PropagationMethod};
use lightpath_proto::v1;
use lightpath_service::{Field, Result, ServiceError, WaitReason};
use lightpath_store::ProcessKind;

/// An enumeration that messages contain as a number. The number 0 stands for an unspecified value.
pub(crate) trait OnWire: Sized {
    /// Number of the value in messages.
    fn to_wire(self) -> i32;

    /// The value with this number; `Some(None)`: unspecified; `None`: the enumeration has no such number.
    fn from_wire(number: i32) -> Option<Option<Self>>;
}

/// Checks of fields with the number of a value.
pub(crate) trait WireField {
    /// The value of an enumeration; `None` if it is unspecified.
    fn enum_value<T: OnWire>(&self, number: i32) -> Result<Option<T>>;

    /// The value of an enumeration that only messages have.
    fn wire_value<T: TryFrom<i32>>(&self, number: i32) -> Result<T>;
}

impl WireField for Field {
    fn enum_value<T: OnWire>(&self, number: i32) -> Result<Option<T>> {
        T::from_wire(number).ok_or_else(|| unknown_value(self, number))
    }

    fn wire_value<T: TryFrom<i32>>(&self, number: i32) -> Result<T> {
        T::try_from(number).map_err(|_| unknown_value(self, number))
    }
}

fn unknown_value(field: &Field, number: i32) -> ServiceError {
    field.but(format!("is {number}"), "must be a value of the enumeration")
}

/// Implements [`OnWire`] for enumerations whose values have the same names in messages.
macro_rules! convert_by_name {
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

convert_by_name! {
    PropagationMethod = v1::PropagationMethod {
        BandResponse AllOrders AngularSpectrum BandLimited RayleighSommerfeld FresnelTransferFunction FresnelImpulseResponse
        Shifted BandExtended Scaled ScaledFresnel Fraunhofer
    }
    Detector = v1::Detector { Point Pixel Supersampled }
    KernelModel = v1::KernelModel { Paper Dense Smooth Display Varying }
    Carrier = v1::Carrier { HalfOrderX HalfOrderY }
    FilterShape = v1::order_filter::Shape { Rectangle Ellipse }
    Quantity = v1::optimize_hologram::loss::Quantity { Intensity Amplitude }
    Area = v1::optimize_hologram::Area { Region Display }
    Judging = v1::optimize_hologram::Judging { None Quick Full }
    Fit = v1::optimize_hologram::Fit { Contain Cover Stretch Exact }
    Encoding = v1::Encoding { Linear Srgb }
    RolloutState = v1::rollout::State { Running Completed Halted }
    WaitReason = v1::waiting::Reason { Turn Paused Jobs StartTime NoProcess }
    JobState = v1::job::State { Queued Running Succeeded Failed Cancelled }
    ProcessKind = v1::queue::process::Kind { Server Worker Both }
    KernelFormat = v1::KernelFormat { Safetensors Compact Pt Npy Npz Complex64 F16 Bundle }
    AlignmentMethod = v1::alignment::Method { Points Dots Pairs }
    FindingKind = v1::finding::Kind {
        Black Saturated BlackClipped LowContrast Duplicate WrongHologram Misaligned Stretched Vignetting ExposureUnknown
        FewPairs Clipped FewerBits
    }
}

/// Messages have another value, `Excluded`, for pairs that finalizing left out. Requests must not contain it.
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
    fn values_survive_conversion_and_unknown_numbers_are_refused() {
        for method in PropagationMethod::ALL {
            assert_eq!(PropagationMethod::from_wire(method.to_wire()), Some(Some(method)));
        }
        let field = Field::new("detector");
        assert_eq!(field.enum_value::<Detector>(0).unwrap(), None);
        let refusal = field.enum_value::<Detector>(9).unwrap_err().to_string();
        assert_eq!(refusal, "detector is 9, but must be a value of the enumeration");
        assert_eq!(Split::from_wire(v1::Split::Excluded.into()), None);
    }
}
