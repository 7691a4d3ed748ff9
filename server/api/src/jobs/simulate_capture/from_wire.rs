//! Checks of requests to simulate photographs.

use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use crate::optics::propagation_checks::check_distance;
use lightpath_domain::display::Display;
use lightpath_domain::job::SimulateCapture;
use lightpath_domain::reason::PreconditionReason;
use lightpath_media::pictures;
use lightpath_proto::v1;

/// Limit on the time since the bench was set up \[s\]: ten years.
const ELAPSED_S_MAX: f64 = 10.0 * 365.25 * 86_400.0;

impl Api {
    /// Checks a request, looks up the named resources, fills in defaults, and converts the request.
    pub(crate) async fn simulate_capture_spec(
        &self,
        call: &Call,
        message: v1::SimulateCapture,
        field: &Field,
    ) -> Result<SimulateCapture, ApiError> {
        let at = |name| field.at(name);
        let display = self.display_named(call, &at("display"), &message.display).await?;
        if display.simulated_bench.is_none() {
            let fix = "but only displays that were created with a simulated_bench can be simulated";
            let message = format!("{}: displays/{} has no simulated bench, {fix}", at("display"), display.id);
            return Err(ApiError::Precondition { reason: PreconditionReason::NotSimulated, message });
        }
        let spec = SimulateCapture {
            wavelength: at("wavelength_m").wavelength_of(message.wavelength_m, &display)?,
            distance: at("distance_m").distance(message.distance_m)?,
            phase: at("phase").digest(&message.phase)?,
            seed: message.seed,
            elapsed_s: at("elapsed_s").number(message.elapsed_s, 0.0..=ELAPSED_S_MAX)?,
            display: display.id.clone(),
        };
        check_distance(&at("distance_m"), &display, spec.wavelength, spec.distance)?;
        self.check_levels(call, &at("phase"), &spec.phase, &display).await?;
        Ok(spec)
    }

    /// Refuses a hologram whose levels or size are not those of the display.
    async fn check_levels(&self, call: &Call, field: &Field, digest: &str, display: &Display) -> Result<(), ApiError> {
        let (height_px, width_px) = (display.height_px as usize, display.width_px as usize);
        let bit_depth = display.bit_depth;
        let decode = move |bytes: &[u8]| pictures::levels(bytes, bit_depth, height_px, width_px).map(drop);
        self.decoded(call, field, (digest, (height_px * width_px) as u64), decode).await.map(drop)
    }
}
