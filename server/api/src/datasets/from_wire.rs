//! Checks of pairs that clients add.

use crate::enumerations::WireField as _;
use crate::names;
use lightpath_domain::dataset::{ADDED_PAIRS_MAX, Exposure, Pair};
use lightpath_proto::v1;
use lightpath_service::{Field, Result, check_all, collect_all};
use std::collections::HashMap;

/// Checks the pairs of one call and converts them. No two may share an id, a hologram or a photograph.
pub(crate) fn pairs(messages: &[v1::Pair], field: &Field) -> Result<Vec<Pair>> {
    if !(1..=ADDED_PAIRS_MAX).contains(&messages.len()) {
        return Err(field.but(format!("has {} pairs", messages.len()), format!("must have 1 to {ADDED_PAIRS_MAX}")));
    }
    let pairs = collect_all(messages.iter().enumerate().map(|(i, message)| pair(message, &field.index(i))))?;
    let mut first = HashMap::new();
    let mut distinct = |i, name: &'static str, value: &str| {
        let before = *first.entry((name, value.to_owned())).or_insert(i);
        if before == i {
            return Ok(());
        }
        let problem = format!("is that of {}", field.index(before));
        Err(field.index(i).at(name).invalid(problem, "give each hologram and each photograph once"))
    };
    let checks = pairs.iter().enumerate().flat_map(|(i, pair)| {
        [("id", &pair.id), ("pattern", &pair.pattern), ("photo", &pair.photo)]
            .map(|(name, value)| distinct(i, name, value))
    });
    collect_all(checks)?;
    Ok(pairs)
}

/// Checks a pair from a client and converts it.
fn pair(pair: &v1::Pair, field: &Field) -> Result<Pair> {
    check_all! {
        id = names::pair_id(&field.at("id"), &pair.id);
        pattern = field.at("pattern").digest(&pair.pattern);
        photo = field.at("photo").digest(&pair.photo);
        split = field.at("split").enum_value(pair.split);
        black_level = field.at("black_level").number(pair.black_level, 0.0..=0.9);
        exposure_s = if_known(&field.at("exposure_s"), pair.exposure_s, 3600.0);
        camera_gain = if_known(&field.at("camera_gain"), pair.camera_gain, 1e6);
    }
    let exposure = Exposure { black_level, exposure_s, camera_gain };
    Ok(Pair { id, pattern, photo, split, exposure, checks: None })
}

/// Checks a property of the camera; 0: it is unknown.
fn if_known(field: &Field, value: Option<f64>, most: f64) -> Result<f64> {
    let checked = field.if_set(value, "an unknown one", |value| field.positive(value, most))?;
    Ok(checked.unwrap_or(0.0))
}
