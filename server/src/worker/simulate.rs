//! Photographing a hologram on a simulated display.

use super::setting::Setting;
use super::{JobContext, TaskError, TaskOutput};
use crate::job::{CaptureResult, JobResult, Progress, SimulateCapture};
use crate::pictures;
use lightpath_optics::simulated_display::{Imperfections, SimulatedDisplay};

pub(super) fn run(context: &JobContext, spec: &SimulateCapture) -> Result<TaskOutput, TaskError> {
    let setting = Setting::read(context, &spec.display, spec.wavelength, spec.distance)?;
    let Some(bench) = setting.display.simulated_bench else {
        let message = format!("displays/{} has no simulated bench", spec.display);
        return Err(TaskError::permanent("NOT_SIMULATED", message));
    };
    let displayed = setting.displayed_phase(&context.read_artifact(&spec.phase)?)?;
    report(context, 0)?;
    let imperfections = Imperfections {
        seed: bench.seed,
        strength: bench.strength,
        camera_noise: bench.camera_noise,
        misalignment_px: bench.misalignment_px,
    };
    let display = SimulatedDisplay::draw(setting.setup, setting.carrier, imperfections)?;
    report(context, 1)?;
    let photo = display.capture(&displayed, spec.seed)?;
    // Back to the same 256 values: a capture is a file of what the camera counted.
    let photo = pictures::grey_png_linear(&photo.map(|level| f32::from(level) / 255.0))?;
    let photo = context.put_artifact(photo)?;
    report(context, 2)?;
    Ok(TaskOutput {
        result: JobResult::Capture(CaptureResult { photo, propagation: Some(setting.validity) }),
        learned: None,
    })
}

fn report(context: &JobContext, step: u32) -> Result<(), TaskError> {
    context.report(Progress { stage: "photograph".to_owned(), step, steps_total: 2, loss: 0.0, eta_s: None })
}
