//! Finding the phase that shows a target.

use super::context::Eta;
use super::setting::{Setting, detector, finite};
use super::state_bytes::HologramState;
use super::{JobContext, TaskError, TaskOutput};
use crate::job::{HologramResult, JobResult, OptimizeHologram, Progress, Quality, SeenQuality};
use crate::metrics;
use crate::pictures;
use lightpath_optics::compiled;
use lightpath_optics::hologram::{self, initial_phase};
use lightpath_optics::metrics::fitted_intensity_scale;
use lightpath_optics::phase_response::wrap_f32;
use lightpath_optics::{Engine, HologramProblem, Plane, RegionOfInterest};
use std::time::Instant;

/// Reported for a reconstruction that equals its target \[dB\]: JSON knows no infinity, and f32 no 200 dB.
const PSNR_DB_MAX: f64 = 200.0;

pub(super) fn run(context: &JobContext, spec: &OptimizeHologram) -> Result<TaskOutput, TaskError> {
    let setting = Setting::read(context, &spec.display, spec.wavelength, spec.distance)?;
    let region = setting.region(spec.region_of_interest)?;
    let picture = context.read_artifact(&spec.target)?;
    let (height_px, width_px) = (setting.height_px(), setting.width_px());
    let target = pictures::target_intensity(&picture, spec.target_encoding, spec.target_fit, height_px, width_px)?;
    drop(picture);
    let model = setting.model(context, spec.kernel_version)?;
    let engine = compiled::engine(&model, detector(spec.detector), setting.carrier)?;

    let problem = compiled::hologram_problem(engine.clone(), target.clone(), region)?;
    let done = descend(context, spec, problem)?;
    let phase = Plane::try_from_vec(height_px, width_px, done.adam.phase)?.map(|phi| wrap_f32(f64::from(phi)));
    let result = Finished { setting: &setting, engine: &engine, target: &target, region, phase };
    let hologram = result.store(context, spec, done.loss, done.compute_s)?;
    Ok(TaskOutput { result: JobResult::Hologram(Box::new(hologram)), learned: None })
}

/// All iterations that are left.
fn descend(
    context: &JobContext,
    spec: &OptimizeHologram,
    problem: HologramProblem,
) -> Result<HologramState, TaskError> {
    let saved = context.take_saved_state().and_then(|bytes| HologramState::from_bytes(&bytes));
    let (mut adam, mut loss, mut compute_s) = match saved {
        Some(state) => (compiled::resume_adam(problem, spec.learning_rate, state.adam)?, state.loss, state.compute_s),
        None => {
            let (height_px, width_px) = (problem.engine().height_px(), problem.engine().width_px());
            let start = initial_phase(height_px, width_px, spec.initial_phase_range_rad, spec.seed)?;
            (compiled::start_adam(problem, spec.learning_rate, start)?, 0.0, 0.0)
        }
    };
    let eta = Eta::from(adam.state().iteration);
    while adam.state().iteration < spec.iterations {
        let started = Instant::now();
        loss = finite("the loss", compiled::step_adam(&mut adam).loss)?;
        let took = started.elapsed();
        metrics::hologram_iteration(took);
        compute_s += took.as_secs_f64();
        let (step, steps_total) = (adam.state().iteration, spec.iterations);
        let progress =
            Progress { stage: "optimize".to_owned(), step, steps_total, loss, eta_s: eta.left_s(step, steps_total) };
        context.step(progress, || HologramState::to_bytes(adam.state(), loss, compute_s))?;
    }
    Ok(HologramState { adam: adam.into_state(), loss, compute_s })
}

/// A hologram whose phase is found.
struct Finished<'a> {
    setting: &'a Setting,
    engine: &'a Engine,
    target: &'a Plane<f32>,
    region: RegionOfInterest,
    /// \[rad\], wrapped
    phase: Plane<f32>,
}

impl Finished<'_> {
    fn store(
        &self,
        context: &JobContext,
        spec: &OptimizeHologram,
        loss: f64,
        compute_s: f64,
    ) -> Result<HologramResult, TaskError> {
        let levels = self.setting.levels_of(&self.phase)?;
        let displayed = self.setting.without_carrier(self.setting.response.dequantize(&levels)?);
        let light = compiled::light(self.engine, &displayed)?;
        let intensity_scale = finite("the gain", fitted_intensity_scale(&light, self.target, self.region)?)?;
        let reconstruction = light.map(|light| (intensity_scale * f64::from(light)) as f32);
        Ok(HologramResult {
            phase: context.put_artifact(pictures::levels_png(&levels, self.setting.display.bit_depth)?)?,
            phase_npy: context.put_artifact(pictures::npy_f32(&self.phase)?)?,
            reconstruction: context.put_artifact(pictures::grey_png_srgb(&reconstruction)?)?,
            quality: self.quality(&self.phase)?,
            quantized_quality: self.quality(&displayed)?,
            intensity_scale,
            loss,
            iterations: spec.iterations,
            iteration_ms: 1e3 * compute_s / f64::from(spec.iterations.max(1)),
            region_of_interest: spec.region_of_interest,
        })
    }

    fn quality(&self, phase: &Plane<f32>) -> Result<Quality, TaskError> {
        let found = compiled::quality(self.engine, phase, self.target, self.region)?;
        Ok(Quality { point: seen(found.point)?, pixel: seen(found.pixel)?, supersampled: seen(found.supersampled)? })
    }
}

fn seen(found: hologram::SeenQuality) -> Result<SeenQuality, TaskError> {
    let number = |value| finite("the quality", value);
    let some = |value: Option<f64>| value.map(number).transpose();
    Ok(SeenQuality {
        psnr_db: number(found.psnr_db.min(PSNR_DB_MAX))?,
        ssim: some(found.ssim)?,
        ms_ssim: some(found.ms_ssim)?,
        diffraction_efficiency: Some(number(found.diffraction_efficiency)?),
        frame_efficiency: Some(number(found.frame_efficiency)?),
        speckle_contrast: some(found.speckle_contrast)?,
    })
}
