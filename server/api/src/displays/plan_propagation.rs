//! Planning the propagation of light from a display to an image.

use crate::api::Api;
use crate::enumerations::{OnWire as _, WireField as _};
use crate::optics::from_wire::distance;
use crate::optics::to_wire;
use lightpath_domain::planning;
use lightpath_optics::propagation::{self, assess, plan_onto};
use lightpath_optics::{Error, OpticalSetup, PropagationMethod};
use lightpath_proto::v1;
use lightpath_service::propagation::{distance_refusal, method_refusal, optimizable};
use lightpath_service::{Call, Field, Result};

impl Api {
    /// Plans the propagation from a display to a distance or a window, and lists the other methods with their validity.
    pub(crate) async fn plan_propagation(
        &self,
        call: &Call,
        request: v1::PlanPropagationRequest,
    ) -> Result<v1::PlanPropagationResponse> {
        let display = self.display_named(call, &Field::new("display"), &request.display).await?;
        let wavelength = Field::new("wavelength_m").wavelength_of(request.wavelength_m, &display)?;
        let field = Field::new("place");
        let distance = distance(&field, request.place.as_ref())?;
        let field = field.at("distance_m");
        let setup = planning::setup(&display, wavelength, distance)
            .map_err(|error| field.invalid(error, "give another distance"))?;
        let method = Field::new("method").enum_value::<PropagationMethod>(request.method)?;
        let report = match (request.window, method) {
            (Some(_), Some(_)) => {
                return Err(Field::new("method")
                    .but("is given together with a window", "the planner chooses the method for a window"));
            }
            (Some(window), None) => {
                let window = image_window(window, &Field::new("window"))?;
                plan_onto(&setup, &window).map_err(|error| method_refusal(&Field::new("window"), &error))?
            }
            (None, Some(method)) => {
                assess(&setup, method).map_err(|error| method_refusal(&Field::new("method"), &error))?
            }
            (None, None) => {
                planning::planned(setup, None).map_err(|error| distance_refusal(&field, distance, &error))?.1
            }
        };
        let alternatives = PropagationMethod::ALL.into_iter().map(|method| alternative(&setup, method)).collect();
        Ok(v1::PlanPropagationResponse { report: Some(to_wire::validity_report(report)), alternatives })
    }
}

fn alternative(setup: &OpticalSetup, method: PropagationMethod) -> v1::PropagationAlternative {
    let (possible, text) = match assess(setup, method) {
        Ok(report) => {
            let texts: Vec<String> = report.warnings.into_iter().map(|warning| warning.text).collect();
            (true, texts.join("; "))
        }
        Err(Error::Unsuitable { reason, .. }) => (false, reason),
        Err(other) => (false, other.to_string()),
    };
    let optimizable = possible && optimizable(method).is_some();
    v1::PropagationAlternative { method: method.to_wire(), possible, optimizable, text }
}

fn image_window(window: v1::ImageWindow, field: &Field) -> Result<propagation::ImageWindow> {
    let v1::ImageWindow { width_px, height_px, pitch_x_m, pitch_y_m, centre_x_m, centre_y_m } = window;
    if let Some(pitch_y_m) = pitch_y_m.filter(|&pitch_y_m| pitch_y_m != pitch_x_m) {
        let rule = format!("must be pitch_x_m, {pitch_x_m}; leave it out for this pitch");
        return Err(field.at("pitch_y_m").but(format!("is {pitch_y_m}"), rule));
    }
    let size = propagation::ImageWindow::try_new(height_px as usize, width_px as usize, pitch_x_m);
    let placed = size.and_then(|window| window.centred_at(centre_x_m, centre_y_m));
    placed.map_err(|error| field.invalid(format!("is not possible: {error}"), "give another window"))
}
