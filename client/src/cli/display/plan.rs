//! `lightpath display plan`

use crate::cli::arguments::{distance, pixel_pitch, propagation, resolution, wavelength};
use crate::cli::failure::Failure;
use crate::cli::propagation_text;
use crate::cli::session::Session;
use clap::Args;
use lightpath::{names, v1};

/// Say how light's way to a distance would be computed, why, and how good that is.
///
/// Nothing is computed and no job is made. What can't be right is refused, with the numbers; jobs refuse it too.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath display plan lab-2 --distance 150mm
  lightpath display plan lab-2 --distance 500mm --method band-limited
  lightpath display plan lab-2 --distance 9cm --window 96x96 --window-pitch 2um")]
pub(crate) struct Plan {
    /// Id of the display
    id: String,

    /// From the SLM to the image plane, for example 150mm; negative for an image behind the SLM
    #[arg(long, value_name = "LENGTH", value_parser = distance, allow_hyphen_values = true)]
    distance: f64,

    /// Wavelength in vacuum, for example 515nm; may be left out where the display has only one
    #[arg(long, value_name = "LENGTH", value_parser = wavelength, allow_hyphen_values = true)]
    wavelength: Option<f64>,

    /// Judge this method instead of the planner's choice
    #[arg(long, default_value = "auto", conflicts_with = "window", value_parser = propagation())]
    method: v1::PropagationMethod,

    /// Columns x rows of another window of the image than the SLM's own pixels
    #[arg(long, value_name = "WxH", value_parser = resolution, requires = "window_pitch", help_heading = "Window")]
    window: Option<(u32, u32)>,

    /// Distance between the window's pixels, for example 2um
    #[arg(long, value_name = "LENGTH", value_parser = pixel_pitch, requires = "window", help_heading = "Window")]
    window_pitch: Option<f64>,

    /// The window's middle, to the right of the point opposite to the SLM's middle
    #[arg(
        long,
        value_name = "LENGTH",
        value_parser = distance,
        allow_hyphen_values = true,
        requires = "window",
        help_heading = "Window"
    )]
    centre_x: Option<f64>,

    /// The same, downwards
    #[arg(
        long,
        value_name = "LENGTH",
        value_parser = distance,
        allow_hyphen_values = true,
        requires = "window",
        help_heading = "Window"
    )]
    centre_y: Option<f64>,
}

impl Plan {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let window = self.window.map(|(width_px, height_px)| v1::ImageWindow {
            width_px,
            height_px,
            pitch_x_m: self.window_pitch.unwrap_or_default(),
            pitch_y_m: 0.0,
            centre_x_m: self.centre_x.unwrap_or_default(),
            centre_y_m: self.centre_y.unwrap_or_default(),
        });
        let request = v1::PlanPropagationRequest {
            display: names::display(&self.id),
            wavelength_m: self.wavelength.unwrap_or(0.0),
            distance_m: self.distance,
            method: self.method.into(),
            window,
        };
        session.print(&session.client.plan_propagation(request).await?, propagation_text::plan)
    }
}
