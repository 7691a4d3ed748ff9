//! The optics engine's terms from messages.

use crate::error::ApiError;
use crate::field::Field;
use crate::optics::propagation_checks::is_optimizable;
use lightpath_domain::display::Display;
use lightpath_domain::job::{Detector, Region};
use lightpath_domain::planning;
use lightpath_domain::propagation::PropagationMethod;
use lightpath_optics::{Grid, RegionOfInterest};
use lightpath_proto::v1;

/// A method of propagation; `None` for the planner's choice.
pub(crate) fn propagation_method(field: &Field, value: i32) -> Result<Option<PropagationMethod>, ApiError> {
    field.known(value, |value| {
        Some(match v1::PropagationMethod::try_from(value).ok()? {
            v1::PropagationMethod::Unspecified => None,
            v1::PropagationMethod::AngularSpectrum => Some(PropagationMethod::AngularSpectrum),
            v1::PropagationMethod::BandLimited => Some(PropagationMethod::BandLimited),
            v1::PropagationMethod::RayleighSommerfeld => Some(PropagationMethod::RayleighSommerfeld),
            v1::PropagationMethod::FresnelTransferFunction => Some(PropagationMethod::FresnelTransferFunction),
            v1::PropagationMethod::FresnelImpulseResponse => Some(PropagationMethod::FresnelImpulseResponse),
            v1::PropagationMethod::Shifted => Some(PropagationMethod::Shifted),
            v1::PropagationMethod::BandExtended => Some(PropagationMethod::BandExtended),
            v1::PropagationMethod::Scaled => Some(PropagationMethod::Scaled),
            v1::PropagationMethod::ScaledFresnel => Some(PropagationMethod::ScaledFresnel),
            v1::PropagationMethod::Fraunhofer => Some(PropagationMethod::Fraunhofer),
        })
    })
}

/// The method that a job asks for; `None`: the planner's choice.
pub(crate) fn convolution_method(field: &Field, value: i32) -> Result<Option<PropagationMethod>, ApiError> {
    let method = propagation_method(field, value)?;
    match method.map(planning::to_optics) {
        Some(method) if !is_optimizable(method) => {
            let rest = "but holograms are optimized through the angular spectrum, band-limited or not, and through impulse \
                        responses and the Fresnel transfer function";
            Err(field.invalid(format!("is the {method}, {rest}")))
        }
        _ => Ok(method),
    }
}

pub(crate) fn detector(field: &Field, value: i32) -> Result<Detector, ApiError> {
    field.known(value, |value| match v1::Detector::try_from(value).ok()? {
        v1::Detector::Unspecified | v1::Detector::Pixel => Some(Detector::Pixel),
        v1::Detector::Point => Some(Detector::Point),
        v1::Detector::Supersampled => Some(Detector::Supersampled),
    })
}

/// A rectangle inside the display; unset, the middle 80 % of each axis.
pub(crate) fn region(
    field: &Field,
    region: Option<v1::RegionOfInterest>,
    display: &Display,
) -> Result<Region, ApiError> {
    let (width_px, height_px) = (display.width_px, display.height_px);
    let Some(region) = region else {
        let grid = Grid::try_new(height_px as usize, width_px as usize, display.pixel_pitch_m);
        let middle = RegionOfInterest::middle(&grid.map_err(|error| field.invalid(error))?);
        return Ok(Region {
            x_px: middle.x_px() as u32,
            y_px: middle.y_px() as u32,
            width_px: middle.width_px() as u32,
            height_px: middle.height_px() as u32,
        });
    };
    let v1::RegionOfInterest { x_px, y_px, width_px: columns, height_px: rows } = region;
    let inside =
        |start: u32, length: u32, side: u32| length > 0 && start.checked_add(length).is_some_and(|end| end <= side);
    if !inside(x_px, columns, width_px) || !inside(y_px, rows, height_px) {
        let given = format!("is {columns}×{rows} px at ({x_px}, {y_px})");
        let display = format!("displays/{}, {width_px}×{height_px} px", display.id);
        return Err(field.invalid(format!("{given}, but must be at least 1×1 px and inside {display}")));
    }
    Ok(Region { x_px, y_px, width_px: columns, height_px: rows })
}
