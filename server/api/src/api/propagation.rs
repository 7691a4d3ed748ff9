//! Propagation on the wire and in the domain, and plans of it.

use super::Api;
use super::error::ApiError;
use super::field::Field;
use lightpath_domain::display::Display;
use lightpath_domain::planning;
use lightpath_domain::propagation::{ImageWindow, PropagationMethod, PropagationWarning, ValidityReport};
use lightpath_domain::units::{Distance, Wavelength};
use lightpath_optics::propagation::{self, ConvolutionMethod, PropagationMethod as Method, assess, plan_onto};
use lightpath_optics::{Error, OpticalSetup};
use lightpath_proto::v1;

impl Api {
    /// What a plan asks for, checked, and the planner's answer.
    pub(super) async fn plan(
        &self,
        request: v1::PlanPropagationRequest,
    ) -> Result<v1::PlanPropagationResponse, ApiError> {
        let display = self.display_named(&Field::new("display"), &request.display).await?;
        let wavelength = Field::new("wavelength_m").wavelength_of(request.wavelength_m, &display)?;
        let field = Field::new("distance_m");
        let distance = field.distance(request.distance_m)?;
        let setup = planning::setup(&display, wavelength, distance).map_err(|error| field.invalid(error))?;
        let method = method(&Field::new("method"), request.method)?;
        let report = match (request.window, method) {
            (Some(_), Some(_)) => {
                return Err(
                    Field::new("method").invalid("is given beside a window, but the planner chooses for windows")
                );
            }
            (Some(window), None) => {
                let window = window_from_wire(window, &Field::new("window"))?;
                let found = plan_onto(&setup, &window).map_err(|error| refusal(&Field::new("window"), &error))?;
                planning::report(&found)
            }
            (None, Some(method)) => {
                let found = assess(&setup, planning::to_optics(method));
                planning::report(&found.map_err(|error| refusal(&Field::new("method"), &error))?)
            }
            (None, None) => {
                planning::planned(setup, None).map_err(|error| distance_refusal(&field, distance, &error))?.1
            }
        };
        let alternatives = Method::ALL.into_iter().map(|method| alternative(&setup, method)).collect();
        Ok(v1::PlanPropagationResponse { report: Some(report_to_wire(report)), alternatives })
    }
}

/// Refuses a distance at which no image of the display can be right.
pub(super) fn check_distance(
    field: &Field,
    display: &Display,
    wavelength: Wavelength,
    distance: Distance,
) -> Result<(), ApiError> {
    let planned = planning::setup(display, wavelength, distance).and_then(|setup| planning::planned(setup, None));
    planned.map(|_| ()).map_err(|error| distance_refusal(field, distance, &error))
}

/// Refuses a method that can't be right.
pub(super) fn check_method(
    field: &Field,
    display: &Display,
    wavelength: Wavelength,
    distance: Distance,
    method: PropagationMethod,
) -> Result<(), ApiError> {
    let setup = planning::setup(display, wavelength, distance);
    let planned = setup.and_then(|setup| planning::planned(setup, Some(method)));
    planned.map(|_| ()).map_err(|error| refusal(field, &error))
}

/// The method that a job asks for; `None`: the planner's choice.
pub(super) fn convolution(field: &Field, value: i32) -> Result<Option<PropagationMethod>, ApiError> {
    let method = method(field, value)?;
    match method.map(planning::to_optics) {
        Some(method) if !is_optimizable(method) => {
            let rest = "but holograms are optimized through the angular spectrum, band-limited or not, and through impulse \
                        responses and the Fresnel transfer function";
            Err(field.invalid(format!("is the {method}, {rest}")))
        }
        _ => Ok(method),
    }
}

fn refusal(field: &Field, error: &Error) -> ApiError {
    field.invalid(format!("can't be met: {error}"))
}

/// Refuses a distance at which nothing can be right.
pub(super) fn distance_refusal(field: &Field, distance: Distance, error: &Error) -> ApiError {
    field.invalid(format!("is {}: {error}", distance.m()))
}

fn alternative(setup: &OpticalSetup, method: Method) -> v1::PropagationAlternative {
    let (possible, text) = match assess(setup, method) {
        Ok(report) => {
            let texts: Vec<String> = report.warnings.into_iter().map(|warning| warning.text).collect();
            (true, texts.join("; "))
        }
        Err(Error::Unsuitable { reason, .. }) => (false, reason),
        Err(other) => (false, other.to_string()),
    };
    let optimizable = possible && is_optimizable(method);
    let method = method_to_wire(planning::from_optics(method)).into();
    v1::PropagationAlternative { method, possible, optimizable, text }
}

/// A window beside the axis is none of a job's fields, which leaves the shifted angular spectrum nothing to do.
fn is_optimizable(method: Method) -> bool {
    ConvolutionMethod::try_from(method).is_ok_and(|method| method != ConvolutionMethod::Shifted)
}

fn window_from_wire(window: v1::ImageWindow, field: &Field) -> Result<propagation::ImageWindow, ApiError> {
    let v1::ImageWindow { width_px, height_px, pitch_x_m, pitch_y_m, centre_x_m, centre_y_m } = window;
    if pitch_y_m != 0.0 && pitch_y_m != pitch_x_m {
        return Err(field.at("pitch_y_m").invalid(format!("is {pitch_y_m}, but must be pitch_x_m, {pitch_x_m}, or 0")));
    }
    let size = propagation::ImageWindow::try_new(height_px as usize, width_px as usize, pitch_x_m);
    let placed = size.and_then(|window| window.centred_at(centre_x_m, centre_y_m));
    placed.map_err(|error| field.invalid(format!("is not possible: {error}")))
}

/// `None` for the planner's choice.
fn method(field: &Field, value: i32) -> Result<Option<PropagationMethod>, ApiError> {
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

/// The method as clients see it.
pub(super) fn method_to_wire(method: PropagationMethod) -> v1::PropagationMethod {
    match method {
        PropagationMethod::AngularSpectrum => v1::PropagationMethod::AngularSpectrum,
        PropagationMethod::BandLimited => v1::PropagationMethod::BandLimited,
        PropagationMethod::RayleighSommerfeld => v1::PropagationMethod::RayleighSommerfeld,
        PropagationMethod::FresnelTransferFunction => v1::PropagationMethod::FresnelTransferFunction,
        PropagationMethod::FresnelImpulseResponse => v1::PropagationMethod::FresnelImpulseResponse,
        PropagationMethod::Shifted => v1::PropagationMethod::Shifted,
        PropagationMethod::BandExtended => v1::PropagationMethod::BandExtended,
        PropagationMethod::Scaled => v1::PropagationMethod::Scaled,
        PropagationMethod::ScaledFresnel => v1::PropagationMethod::ScaledFresnel,
        PropagationMethod::Fraunhofer => v1::PropagationMethod::Fraunhofer,
    }
}

/// The report as clients see it.
pub(super) fn report_to_wire(report: ValidityReport) -> v1::ValidityReport {
    let ImageWindow { width_px, height_px, pitch_x_m, pitch_y_m, centre_x_m, centre_y_m } = report.window;
    let warning = |PropagationWarning { code, text }| v1::PropagationWarning { code, text };
    v1::ValidityReport {
        method: method_to_wire(report.method).into(),
        explanation: report.explanation,
        window: Some(v1::ImageWindow { width_px, height_px, pitch_x_m, pitch_y_m, centre_x_m, centre_y_m }),
        critical_distance_x_m: report.critical_distance_x_m,
        critical_distance_y_m: report.critical_distance_y_m,
        band_kept_x: report.band_kept_x,
        band_kept_y: report.band_kept_y,
        band_kept_area: report.band_kept_area,
        fresnel_number: report.fresnel_number,
        diffraction_angle_rad: report.diffraction_angle_rad,
        spread_m: report.spread_m,
        full_cone_x_m: report.full_cone_x_m,
        full_cone_y_m: report.full_cone_y_m,
        neglected_phase_rad: report.neglected_phase_rad,
        warnings: report.warnings.into_iter().map(warning).collect(),
    }
}
