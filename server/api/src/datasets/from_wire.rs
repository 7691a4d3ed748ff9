//! Checks of pairs that clients add.

use crate::enumerations::WireField as _;
use crate::names;
use lightpath_domain::dataset::{Exposure, Pair};
use lightpath_proto::v1;
use lightpath_service::{Field, Result, check_all};

/// Checks a pair from a client and converts it.
pub(crate) fn pair(pair: &v1::Pair, field: &Field) -> Result<Pair> {
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
