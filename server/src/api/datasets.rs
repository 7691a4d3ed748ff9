//! Datasets on the wire and in the domain.

use super::encodings::{encoding_to_wire, split, split_to_wire};
use super::error::ApiError;
use super::field::Field;
use super::names;
use super::time::timestamp;
use crate::dataset::{Dataset, Pair};
use lightpath_proto::v1;

/// The pair that a client adds.
pub(super) fn pair_from_wire(pair: &v1::Pair, field: &Field) -> Result<Pair, ApiError> {
    Ok(Pair {
        id: names::pair_id(&field.at("id"), &pair.id)?,
        phase: field.at("phase").digest(&pair.phase)?,
        photo: field.at("photo").digest(&pair.photo)?,
        split: split(&field.at("split"), pair.split)?,
    })
}

/// The dataset as clients see it.
pub(super) fn to_wire(dataset: Dataset) -> v1::Dataset {
    let state = if dataset.digest.is_some() { v1::dataset::State::Finalized } else { v1::dataset::State::Open };
    v1::Dataset {
        name: format!("datasets/{}", dataset.id),
        display: format!("displays/{}", dataset.display),
        wavelength_m: dataset.wavelength.m(),
        distance_m: dataset.distance.m(),
        photo_encoding: encoding_to_wire(dataset.photo_encoding),
        state: state.into(),
        pairs: dataset.pairs.into_iter().map(pair_to_wire).collect(),
        digest: dataset.digest.unwrap_or_default(),
        create_time: Some(timestamp(dataset.create_time_ms)),
        finalize_time: dataset.finalize_time_ms.map(timestamp),
        pair_count: dataset.pair_count,
    }
}

fn pair_to_wire(pair: Pair) -> v1::Pair {
    v1::Pair { id: pair.id, phase: pair.phase, photo: pair.photo, split: split_to_wire(pair.split) }
}
