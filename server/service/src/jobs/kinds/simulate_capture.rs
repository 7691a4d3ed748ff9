//! Simulation jobs: photographs of a simulated display.

use super::Kind;
use crate::call::Call;
use crate::error::{Result, ServiceError};
use crate::field::Field;
use crate::jobs::Jobs;
use crate::propagation::check_distance;
use lightpath_domain::display::Display;
use lightpath_domain::job::SimulateCapture;
use lightpath_domain::job::estimate::Need;
use lightpath_domain::job::kinds::simulate_capture;
use lightpath_domain::kernel::KernelKey;
use lightpath_domain::reason::PreconditionReason;
use lightpath_media::pictures;
use lightpath_optics::Detector;

impl Kind for SimulateCapture {
    const ADVICE: &'static str = "use a smaller display";

    async fn need(&self, jobs: &Jobs, _: u64) -> Result<Need> {
        let (display, _) = jobs.store.display(&self.display).await?;
        let key = KernelKey { display: self.display.clone(), wavelength: self.wavelength, distance: self.distance };
        let engine = jobs.ideal_engine(&display, &key, Detector::Pixel, None, false)?;
        let bench = display.simulated_bench.unwrap_or_default();
        // A phase, the same with the carrier, and the levels have ten bytes a pixel.
        Ok(simulate_capture::need(engine, &bench, 10 * engine.pixels()))
    }
}

impl Jobs {
    /// Refuses a display without a simulated bench.
    pub fn require_simulated(&self, field: &Field, display: &Display) -> Result<()> {
        if display.simulated_bench.is_some() {
            return Ok(());
        }
        let fix = "and only a display that was created with one can be simulated";
        let message = format!("{field}: displays/{} has no simulated bench, {fix}", display.id);
        Err(ServiceError::Precondition { reason: PreconditionReason::NotSimulated, message })
    }

    /// Refuses a distance at which no method gives a correct image, and a hologram whose levels or size are not those of
    /// the display.
    pub async fn require_capturable(
        &self,
        call: &Call,
        field: &Field,
        spec: &SimulateCapture,
        display: &Display,
    ) -> Result<()> {
        check_distance(&field.at("place").at("distance_m"), display, spec.wavelength, spec.distance)?;
        let (height_px, width_px) = (display.height_px as usize, display.width_px as usize);
        let bit_depth = display.bit_depth;
        let decode = move |bytes: &[u8]| pictures::hologram(bytes, bit_depth, height_px, width_px).map(drop);
        let hologram = (spec.pattern.as_str(), (height_px * width_px) as u64);
        self.files.decoded(call, &field.at("phase"), hologram, decode).await.map(drop)
    }
}
