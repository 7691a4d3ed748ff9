//! Finding the phases that show pictures.

use super::context::Eta;
use super::display_setup::finite;
use super::hologram_setup::{Wanted, colours};
use super::state_bytes::{HologramState, from_bytes, to_bytes};
use super::{JobContext, TaskError, TaskOutput};
use lightpath_domain::job::{
    FailureReason, FrameResult, HologramResult, JobResult, Method, OptimizeHologram, PlaneResult, Progress, Quality,
    Quantity, SeenQuality, WavelengthResult,
};
use lightpath_media::pictures;
use lightpath_metrics as metrics;
use lightpath_optics::hologram::{self, OptimizationState, light_of_frames, quality_of_frames};
use lightpath_optics::phase_response::wrap_f32;
use lightpath_optics::{Optimization, Plane};
use std::sync::LazyLock;
use std::time::{Duration, Instant};

/// Reported for a reconstruction that equals its target \[dB\]: JSON knows no infinity, and f32 no 200 dB.
const PSNR_DB_MAX: f64 = 200.0;

pub(super) fn run(context: &JobContext, spec: &OptimizeHologram) -> Result<TaskOutput, TaskError> {
    let wavelengths = spec.wavelengths();
    let mut work = Work { context, spec, state: HologramState::default(), current: None, eta: None };
    if let Some((state, current)) = context.take_saved_state().and_then(|bytes| from_bytes(&bytes)) {
        (work.state, work.current) = (state, Some(current));
    }
    for index in work.state.finished.len()..wavelengths.len() {
        let wanted = Wanted::read(context, spec, index)?;
        let mut optimization = work.begin(&wanted, index)?;
        let loss = work.descend(&mut optimization, wavelengths.len(), &wanted)?;
        let finished = Finished { wanted: &wanted, optimization, loss };
        work.state.finished.push(finished.store(context, spec)?);
    }
    let hologram = work.result()?;
    Ok(TaskOutput { result: JobResult::Hologram(Box::new(hologram)), learned: Vec::new() })
}

/// The engine's clock.
fn since_first_look() -> Duration {
    static FIRST: LazyLock<Instant> = LazyLock::new(Instant::now);
    FIRST.elapsed()
}

/// A job under way.
struct Work<'a> {
    context: &'a JobContext,
    spec: &'a OptimizeHologram,
    state: HologramState,
    /// The optimization that an earlier attempt was at.
    current: Option<OptimizationState>,
    eta: Option<Eta>,
}

impl Work<'_> {
    /// Goes on where an earlier attempt was, or starts.
    fn begin(&mut self, wanted: &Wanted, index: usize) -> Result<Optimization, TaskError> {
        let (problem, options) = (wanted.problem(self.spec)?, wanted.options(self.spec)?);
        if let Some(state) = self.current.take() {
            return Ok(Optimization::resume(problem, options, state)?.timed_by(since_first_look));
        }
        let phases = wanted.first_phases(self.context, self.spec, index, &problem)?;
        Ok(Optimization::start(problem, options, phases)?.timed_by(since_first_look))
    }

    /// All iterations that are left of one wavelength's hologram. Returns the last loss.
    fn descend(
        &mut self,
        optimization: &mut Optimization,
        wavelengths: usize,
        wanted: &Wanted,
    ) -> Result<f64, TaskError> {
        let steps_each = if self.spec.method == Method::DoublePhase { 1 } else { self.spec.iterations };
        let (before, steps_total) = (self.state.finished.len() as u32 * steps_each, steps_each * wavelengths as u32);
        let stage = if wavelengths == 1 { "optimize".to_owned() } else { format!("optimize {}", wanted.wavelength) };
        let eta = *self.eta.get_or_insert_with(|| Eta::from(before + optimization.iteration()));
        loop {
            let (started, transformed) = (Instant::now(), optimization.transforming());
            let Some(done) = optimization.step() else { return Ok(self.state.loss) };
            let took = started.elapsed();
            self.state.loss = finite("the loss", done.evaluation.loss)?;
            metrics::hologram_iteration(took, optimization.transforming() - transformed);
            self.state.compute_s += took.as_secs_f64();
            self.state.steps += 1;
            let step = before + done.iteration;
            let (loss, eta_s) = (self.state.loss, eta.left_s(step, steps_total));
            let progress = Progress { stage: stage.clone(), step, steps_total, loss, eta_s };
            self.context.step(progress, || to_bytes(&(&self.state, optimization.state())))?;
        }
    }

    fn result(self) -> Result<HologramResult, TaskError> {
        let colour_reconstructions = self.colour_reconstructions()?;
        let HologramState { finished, compute_s, steps, .. } = self.state;
        let first = finished.first().and_then(|first| Some((first, first.frames.first()?, first.planes.first()?)));
        let Some((first, frame, plane)) = first else {
            return Err(TaskError::permanent(FailureReason::InvalidInput, "the job has no wavelength, frame or plane"));
        };
        Ok(HologramResult {
            phase: frame.phase.clone(),
            phase_npy: frame.phase_npy.clone(),
            reconstruction: plane.reconstruction.clone(),
            quality: plane.quality,
            quantized_quality: plane.quantized_quality,
            intensity_scale: first.intensity_scale,
            loss: first.loss,
            iterations: if self.spec.method == Method::DoublePhase { 1 } else { self.spec.iterations },
            iteration_ms: 1e3 * compute_s / f64::from(steps.max(1)),
            region_of_interest: self.spec.region_of_interest,
            colour_reconstructions,
            wavelengths: finished,
        })
    }

    /// For each plane, three wavelengths as one picture.
    fn colour_reconstructions(&self) -> Result<Vec<String>, TaskError> {
        let finished = &self.state.finished;
        let Some(places) = colours(&self.spec.wavelengths()) else { return Ok(Vec::new()) };
        let planes = finished.first().map_or(0, |first| first.planes.len());
        let of_plane = |plane: usize| -> Result<String, TaskError> {
            let [red, green, blue] =
                places.map(|place| self.context.read_artifact(&finished[place].planes[plane].reconstruction));
            let (red, green, blue) = (red?, green?, blue?);
            self.context.put_artifact(pictures::colour_png([&red, &green, &blue])?)
        };
        (0..planes).map(of_plane).collect()
    }
}

/// A hologram whose phases are found.
struct Finished<'a> {
    wanted: &'a Wanted,
    optimization: Optimization,
    loss: f64,
}

impl Finished<'_> {
    fn store(mut self, context: &JobContext, spec: &OptimizeHologram) -> Result<WavelengthResult, TaskError> {
        let display = &self.wanted.display;
        let (height_px, width_px) = (display.height_px(), display.width_px());
        let (mut frames, mut phases, mut displayed) = (Vec::new(), Vec::new(), Vec::new());
        for frame in self.optimization.phases().chunks_exact(height_px * width_px) {
            let wrapped = frame.iter().map(|&phi| wrap_f32(f64::from(phi))).collect();
            let phase = Plane::try_from_vec(height_px, width_px, wrapped)?;
            let levels = display.levels_of(&phase)?;
            frames.push(FrameResult {
                phase: context.put_artifact(pictures::levels_png(&levels, display.declared.bit_depth)?)?,
                phase_npy: context.put_artifact(pictures::npy_f32(&phase)?)?,
            });
            displayed.push(display.without_carrier(display.response.dequantize(&levels)?));
            phases.push(phase);
        }
        let all: Vec<f32> = displayed.iter().flat_map(|phase| phase.values()).copied().collect();
        let gain = self.optimization.measure(&all)?.best_gain;
        let largest_amplitude = self.optimization.largest_amplitude();
        // The buffers of the optimization are not needed for what follows.
        drop(self.optimization);
        let intensity_scale = finite(
            "the gain",
            match spec.loss.quantity {
                Quantity::Intensity => gain,
                Quantity::Amplitude => gain * gain,
            },
        )?;
        let mut planes = Vec::new();
        for shown in &self.wanted.planes {
            let light = light_of_frames(&shown.engine, &displayed)?;
            let reconstruction = light.map(|light| (intensity_scale * f64::from(light)) as f32);
            let quality = |phases: &[Plane<f32>]| -> Result<Quality, TaskError> {
                let found = quality_of_frames(&shown.engine, phases, &shown.target, self.wanted.region)?;
                Ok(Quality {
                    point: seen(found.point)?,
                    pixel: seen(found.pixel)?,
                    supersampled: seen(found.supersampled)?,
                })
            };
            planes.push(PlaneResult {
                distance: shown.plane.distance,
                reconstruction: context.put_artifact(pictures::grey_png_srgb(&reconstruction)?)?,
                quality: quality(&phases)?,
                quantized_quality: quality(&displayed)?,
                propagation: Some(shown.validity.clone()),
            });
        }
        let (wavelength, loss) = (self.wanted.wavelength, self.loss);
        Ok(WavelengthResult { wavelength, frames, planes, intensity_scale, loss, largest_amplitude })
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
