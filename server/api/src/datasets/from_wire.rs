//! Datasets and pairs from messages.

use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use lightpath_domain::dataset::{Encoding, Exposure, Pair, Split};
use lightpath_proto::v1;

/// The pair that a client adds.
pub(crate) fn pair(pair: &v1::Pair, field: &Field) -> Result<Pair, ApiError> {
    Ok(Pair {
        id: names::pair_id(&field.at("id"), &pair.id)?,
        phase: field.at("phase").digest(&pair.phase)?,
        photo: field.at("photo").digest(&pair.photo)?,
        split: split(&field.at("split"), pair.split)?,
        exposure: Exposure {
            black_level: field.at("black_level").number(pair.black_level, 0.0..=0.9)?,
            exposure_s: field.at("exposure_s").number(pair.exposure_s, 0.0..=3600.0)?,
            camera_gain: field.at("camera_gain").number(pair.camera_gain, 0.0..=1e6)?,
        },
        checks: None,
    })
}

pub(crate) fn encoding(field: &Field, value: i32, default: Encoding) -> Result<Encoding, ApiError> {
    field.known(value, |value| match v1::Encoding::try_from(value).ok()? {
        v1::Encoding::Unspecified => Some(default),
        v1::Encoding::Linear => Some(Encoding::Linear),
        v1::Encoding::Srgb => Some(Encoding::Srgb),
    })
}

pub(crate) fn split(field: &Field, value: i32) -> Result<Option<Split>, ApiError> {
    field.known(value, |value| match v1::Split::try_from(value).ok()? {
        v1::Split::Unspecified => Some(None),
        v1::Split::Train => Some(Some(Split::Train)),
        v1::Split::Validation => Some(Some(Split::Validation)),
        v1::Split::Test => Some(Some(Split::Test)),
        // What finalizing finds, nobody asks for.
        v1::Split::Excluded => None,
    })
}
