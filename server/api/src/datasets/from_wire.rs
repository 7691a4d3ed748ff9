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
        exposure_s = field.at("exposure_s").number(pair.exposure_s, 0.0..=3600.0);
        camera_gain = field.at("camera_gain").number(pair.camera_gain, 0.0..=1e6);
    }
    let exposure = Exposure { black_level, exposure_s, camera_gain };
    Ok(Pair { id, pattern, photo, split, exposure, checks: None })
}
