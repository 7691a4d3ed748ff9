//! Photographs a hologram on a simulated display.

use crate::display_setup::{DisplaySetup, simulated_display};
use crate::{JobContext, TaskError, TaskOutput};
use lightpath_domain::job::{CaptureResult, FailureReason, JobEffect, JobResult, Progress, SimulateCapture};
use lightpath_media::pictures;

pub(super) fn run(context: &JobContext, spec: &SimulateCapture) -> Result<TaskOutput, TaskError> {
    let display = DisplaySetup::read(context, &spec.display, spec.wavelength, spec.distance)?;
    let displayed = display.displayed_phase(&context.read_artifact(&spec.pattern)?)?;
    report(context, 0)?;
    let Some(simulated) = simulated_display(&display)? else {
        let message = format!("displays/{} has no simulated bench; name a display that has one", spec.display);
        return Err(TaskError::permanent(FailureReason::NotSimulated, message));
    };
    report(context, 1)?;
    let photo = simulated.capture_at(&displayed, spec.seed, spec.elapsed_s / 3600.0)?;
    // The file has the same 256 values as the camera.
    let photo = pictures::grey_png_linear(&photo.map(|level| f32::from(level) / 255.0))?;
    let photo = context.put_artifact(photo)?;
    report(context, 2)?;
    let result = CaptureResult { photo, propagation: display.validity };
    Ok(TaskOutput { result: JobResult::SimulateCapture(result), effect: JobEffect::None })
}

fn report(context: &JobContext, step: u32) -> Result<(), TaskError> {
    context.report(Progress { stage: "photograph".to_owned(), step, steps_total: 2, loss: None, eta_s: None })
}
