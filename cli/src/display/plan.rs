//! The command `lightpath display plan`.

use crate::arguments::{distance, pixel_pitch, propagation, resolution, wavelength};
use crate::failure::Failure;
use crate::propagation_text;
use crate::session::Session;
use clap::Args;
use lightpath::{names, v1};

/// Show which method would propagate light to a distance, why, and the limits of its validity.
///
/// The command submits no job. The server refuses a propagation that cannot be correct and gives the numbers; it would
/// refuse a job with it, too.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath display plan lab-2 --distance 150mm
  lightpath display plan lab-2 --distance 500mm --method band-limited
  lightpath display plan lab-2 --distance 9cm --window 96x96 --window-pitch 2um")]
pub(crate) struct Plan {
    /// Use the display with this id
    id: String,

    /// Set the distance from the SLM to the image plane, at most 10m, for example 150mm; negative for an image behind
    /// the SLM
    #[arg(long, value_name = "LENGTH", value_parser = distance, allow_hyphen_values = true)]
    distance: f64,

    /// Set the wavelength in vacuum, for example 515nm [default: the display's only wavelength]
    #[arg(long, value_name = "LENGTH", value_parser = wavelength, allow_hyphen_values = true)]
    wavelength: Option<f64>,

    /// Check this method instead of the planner's choice
    #[arg(long, default_value = "auto", conflicts_with = "window", value_parser = propagation())]
    method: v1::PropagationMethod,

    #[command(flatten)]
    window: Window,
}

/// Where the light is computed.
#[derive(Debug, Args)]
#[command(next_help_heading = "Window")]
struct Window {
    /// Compute a window of this size in the image: columns x rows in pixels [default: the SLM's own pixels]
    #[arg(long, value_name = "WxH", value_parser = resolution, requires = "window_pitch")]
    window: Option<(u32, u32)>,

    /// Set the distance between the window's pixels, for example 2um; needs --window
    #[arg(long, value_name = "LENGTH", value_parser = pixel_pitch, requires = "window")]
    window_pitch: Option<f64>,

    /// Shift the window's centre by this length to the right of the SLM's centre, for example 2mm [default: 0]
    #[arg(long, value_name = "LENGTH", value_parser = distance, allow_hyphen_values = true, requires = "window")]
    centre_x: Option<f64>,

    /// Shift the window's centre by this length below the SLM's centre, for example 2mm [default: 0]
    #[arg(long, value_name = "LENGTH", value_parser = distance, allow_hyphen_values = true, requires = "window")]
    centre_y: Option<f64>,
}

impl Plan {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let Window { window, window_pitch, centre_x, centre_y } = self.window;
        let window = window.map(|(width_px, height_px)| v1::ImageWindow {
            width_px,
            height_px,
            pitch_x_m: window_pitch.unwrap_or_default(),
            pitch_y_m: None,
            centre_x_m: centre_x.unwrap_or_default(),
            centre_y_m: centre_y.unwrap_or_default(),
        });
        let request = v1::PlanPropagationRequest {
            display: names::display(&self.id),
            wavelength_m: self.wavelength,
            place: Some(v1::Place::at_m(self.distance)),
            method: self.method.into(),
            window,
        };
        session.print(&session.client.plan_propagation(request).await?, propagation_text::plan)
    }
}
