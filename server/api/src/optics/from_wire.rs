//! Conversion of messages into the terms of the optics engine.

use crate::enumerations::WireField as _;
use lightpath_domain::display::Display;
use lightpath_domain::units::Distance;
use lightpath_optics::{ConvolutionMethod, PropagationMethod, RegionOfInterest};
use lightpath_proto::v1::{self, place};
use lightpath_service::propagation::optimizable;
use lightpath_service::{Field, Result, region_of};

/// The method that a job asks for; `None`: the planner's choice.
pub(crate) fn convolution_method(field: &Field, number: i32) -> Result<Option<ConvolutionMethod>> {
    let Some(method) = field.enum_value::<PropagationMethod>(number)? else { return Ok(None) };
    let refusal = || {
        let rule = "holograms are only optimized with the angular spectrum (band-limited or not), impulse responses and \
                    the Fresnel transfer function";
        field.but(format!("is the {method}"), rule)
    };
    optimizable(method).map(Some).ok_or_else(refusal)
}

/// The distance of a place, which is required.
pub(crate) fn distance(field: &Field, place: Option<&v1::Place>) -> Result<Distance> {
    match place.and_then(|place| place.kind.as_ref()) {
        Some(place::Kind::DistanceM(distance_m)) => field.at("distance_m").distance(*distance_m),
        None => Err(field.but("is not set", "is required, with its distance_m")),
    }
}

/// A rectangle inside the display. If it is not set, the middle 80 % of each axis.
pub(crate) fn region(field: &Field, region: Option<v1::Region>, display: &Display) -> Result<RegionOfInterest> {
    region_of(field, region.map(region_px), display)
}

/// First column and row, width and height \[px\].
pub(crate) fn region_px(region: v1::Region) -> [u32; 4] {
    let v1::Region { x_px, y_px, width_px, height_px } = region;
    [x_px, y_px, width_px, height_px]
}
