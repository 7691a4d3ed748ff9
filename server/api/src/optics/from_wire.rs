//! Conversion of messages into the terms of the optics engine.

use crate::error::ApiError;
use crate::field::Field;
use crate::optics::propagation_checks::optimizable;
use lightpath_domain::display::Display;
use lightpath_optics::{ConvolutionMethod, Grid, PropagationMethod, RegionOfInterest};
use lightpath_proto::v1;

/// The method that a job asks for; `None`: the planner's choice.
pub(crate) fn convolution_method(field: &Field, number: i32) -> Result<Option<ConvolutionMethod>, ApiError> {
    let Some(method) = field.enum_value::<PropagationMethod>(number)? else { return Ok(None) };
    let refusal = || {
        let rest = "but holograms are only optimized with the angular spectrum (band-limited or not), impulse responses \
                    and the Fresnel transfer function";
        field.invalid(format!("is the {method}, {rest}"))
    };
    optimizable(method).map(Some).ok_or_else(refusal)
}

/// A rectangle inside the display. If it is not set, the middle 80 % of each axis.
pub(crate) fn region(
    field: &Field,
    region: Option<v1::RegionOfInterest>,
    display: &Display,
) -> Result<RegionOfInterest, ApiError> {
    let grid = Grid::try_new(display.height_px as usize, display.width_px as usize, display.pixel_pitch_m);
    let grid = grid.map_err(|error| field.invalid(error))?;
    region_inside(field, region, &grid, &format!("displays/{}", display.id))
}

/// A rectangle inside a grid, which `name` calls in messages. If it is not set, the middle 80 % of each axis.
pub(crate) fn region_inside(
    field: &Field,
    region: Option<v1::RegionOfInterest>,
    grid: &Grid,
    name: &str,
) -> Result<RegionOfInterest, ApiError> {
    let Some(region) = region else { return Ok(RegionOfInterest::middle(grid)) };
    let v1::RegionOfInterest { x_px, y_px, width_px, height_px } = region;
    let [x, y, width, height] = [x_px, y_px, width_px, height_px].map(|px| px as usize);
    RegionOfInterest::try_new(grid, x, y, width, height).map_err(|_| {
        let given = format!("is {width_px}×{height_px} px at ({x_px}, {y_px})");
        let (columns, rows) = (grid.width_px(), grid.height_px());
        field.invalid(format!("{given}, but must be at least 1×1 px and inside {name}, {columns}×{rows} px"))
    })
}
