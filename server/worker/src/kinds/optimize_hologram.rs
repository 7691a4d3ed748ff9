//! Computes holograms: phases that show the target pictures.

use crate::context::Eta;
use crate::display_setup::finite;
use crate::hologram_judgement::{Judge, Judged};
use crate::hologram_notes::{notes, sign_of_given, unit_of_given};
use crate::hologram_setup::{HologramSetup, colours};
use crate::state_bytes::{HologramState, from_bytes, to_bytes};
use crate::{JobContext, TaskError, TaskOutput};
use lightpath_domain::job::{
    HologramResult, JobEffect, JobResult, OptimizeHologram, PlaneResult, Progress, Subframe, WavelengthResult,
};
use lightpath_gpu::CardOrProcessor;
use lightpath_media::pictures;
use lightpath_metrics as metrics;
use lightpath_optics::display::phase_response::wrap_f32;
use lightpath_optics::engine::photometry::Quantity;
use lightpath_optics::hologram::{HologramMethod, OptimizationState, Wanted, light_of_frames};
use lightpath_optics::{Optimization, Plane};
use std::sync::LazyLock;
use std::time::{Duration, Instant};

/// Longest side of the picture that a running job shows \[px\]: enough to see what becomes of it, in a few kilobytes.
const LIVE_SIDE_PX_MAX: usize = 320;

/// Time between two reports of progress on a card, whose steps may take less than a millisecond each. It takes them without
/// the host.
const REPORT_INTERVAL: Duration = Duration::from_millis(100);
/// Most steps between two reports.
const STEPS_MAX: u32 = 1000;

pub(super) fn run(context: &JobContext, spec: &OptimizeHologram) -> Result<TaskOutput, TaskError> {
    let wavelengths = spec.wavelengths.len();
    let mut running = RunningJob { context, spec, state: HologramState::default(), current: None, eta: None };
    let saved: Option<(HologramState, OptimizationState)> =
        context.take_saved_state().and_then(|bytes| from_bytes(&bytes));
    if let Some((state, current)) = saved.filter(|(state, _)| running.has_card_of(state)) {
        (running.state, running.current) = (state, Some(current));
    }
    for index in running.state.finished.len()..wavelengths {
        let setup = HologramSetup::read(context, spec, index)?;
        let card = running.card(&setup);
        let mut optimization = running.begin(&setup, index, card.as_ref())?;
        let loss = running.iterate(&mut optimization, wavelengths, &setup)?;
        running.note_what_computed(card.as_ref());
        let finished = Finished { setup: &setup, optimization, loss };
        running.state.finished.push(finished.store(context, spec)?);
    }
    let hologram = running.result()?;
    Ok(TaskOutput { result: JobResult::OptimizeHologram(Box::new(hologram)), effect: JobEffect::None })
}

/// Clock for the optics engine: time since the first call.
fn since_first_call() -> Duration {
    static FIRST: LazyLock<Instant> = LazyLock::new(Instant::now);
    FIRST.elapsed()
}

/// A running hologram job.
struct RunningJob<'a> {
    context: &'a JobContext,
    spec: &'a OptimizeHologram,
    state: HologramState,
    /// State of the optimization during which an earlier attempt was interrupted.
    current: Option<OptimizationState>,
    eta: Option<Eta>,
}

impl RunningJob<'_> {
    /// Whether this process computes on what a saved state was computed on.
    fn has_card_of(&self, state: &HologramState) -> bool {
        let Some(Some(card)) = &state.card else { return true };
        self.context.device().card().is_some_and(|here| here.to_string() == *card)
    }

    /// The card that computes the job; `None`: the processor. It is chosen once, at the job's first hologram.
    fn card(&mut self, setup: &HologramSetup) -> Option<CardOrProcessor> {
        let (device, engines) = (self.context.device(), self.context.engines());
        let (height_px, width_px) = (setup.display.height_px(), setup.display.width_px());
        if let Some(chosen) = &self.state.card {
            return chosen.as_ref().and_then(|_| device.any_size(engines));
        }
        let card = device.backend(engines, height_px, width_px);
        self.state.card = Some(device.card().filter(|_| card.is_some()).map(ToString::to_string));
        card
    }

    /// Notes what computed a hologram, if that was to be a card.
    fn note_what_computed(&mut self, card: Option<&CardOrProcessor>) {
        let by = match (card, &self.state.card) {
            (Some(card), _) => card.0.computed().to_string(),
            (None, Some(Some(_))) => "processor: the graphics card had failed before".to_owned(),
            (None, _) => return,
        };
        match &mut self.state.computed_by {
            // The holograms of several wavelengths usually have one computer.
            Some(known) if known.contains(&by) => {}
            Some(known) => *known = format!("{known}; {by}"),
            none => *none = Some(by),
        }
    }

    /// Resumes the optimization of an earlier attempt, or starts a new one.
    fn begin(
        &mut self,
        setup: &HologramSetup,
        index: usize,
        card: Option<&CardOrProcessor>,
    ) -> Result<Optimization, TaskError> {
        let (problem, options) = (setup.problem(self.spec, card)?, setup.options(self.spec)?);
        if let Some(state) = self.current.take() {
            return Ok(Optimization::resume(problem, options, state)?.timed_by(since_first_call));
        }
        let phases = setup.first_phases(self.context, self.spec, index, &problem)?;
        Ok(Optimization::start(problem, options, phases)?.timed_by(since_first_call))
    }

    /// Runs the remaining iterations for the hologram of one wavelength. Returns the loss of the last iteration.
    fn iterate(
        &mut self,
        optimization: &mut Optimization,
        wavelengths: usize,
        setup: &HologramSetup,
    ) -> Result<f64, TaskError> {
        let steps_each = steps(self.spec);
        if steps_each == 0 {
            // Given phases are judged as they are.
            let given = optimization.phases().to_vec();
            self.state.loss = optimization.measure(&given)?.best_loss;
        }
        let (before, steps_total) = (self.state.finished.len() as u32 * steps_each, steps_each * wavelengths as u32);
        let stage = if wavelengths == 1 { "optimize".to_owned() } else { format!("optimize {}", setup.wavelength) };
        let eta = *self.eta.get_or_insert_with(|| Eta::from(before + optimization.iteration()));
        let (on_card, mut most, mut taken) = (self.state.card.iter().any(Option::is_some), 1, Vec::new());
        loop {
            let (started, transformed) = (Instant::now(), optimization.evaluation_time());
            taken.clear();
            optimization.steps(most, |step| taken.push(step));
            let Some(&done) = taken.last() else { return Ok(self.state.loss) };
            let took = started.elapsed();
            let (count, evaluated) = (taken.len() as u32, optimization.evaluation_time() - transformed);
            for step in &taken {
                self.state.loss = finite("the loss", step.evaluation.loss)?;
                metrics::hologram_iteration(took / count, evaluated / count);
            }
            self.state.compute_s += took.as_secs_f64();
            self.state.steps += count;
            if on_card {
                most = steps_within(REPORT_INTERVAL, took / count);
            }
            let step = before + done.iteration;
            let (loss, eta_s) = (Some(self.state.loss), eta.left_s(step, steps_total));
            let progress = Progress { stage: stage.clone(), step, steps_total, loss, eta_s };
            let gain = intensity_scale(self.spec.loss.quantity, done.evaluation.best_gain);
            self.context.show(|| picture_so_far(optimization, gain));
            self.context.step(progress, || to_bytes(&(&self.state, optimization.state())))?;
        }
    }

    fn result(self) -> Result<HologramResult, TaskError> {
        let colour_reconstructions = self.colour_reconstructions()?;
        let HologramState { finished, compute_s, steps: done, computed_by, .. } = self.state;
        let iteration_time_s = compute_s / f64::from(done.max(1));
        let (detector, iterations) = (self.spec.detector, steps(self.spec));
        Ok(HologramResult {
            wavelengths: finished,
            colour_reconstructions,
            detector,
            iterations,
            iteration_time_s,
            judged: self.spec.judge,
            computed_by,
        })
    }

    /// Colour pictures: for each plane one picture that combines the three wavelengths.
    fn colour_reconstructions(&self) -> Result<Vec<String>, TaskError> {
        let finished = &self.state.finished;
        let Some(indices) = colours(&self.spec.wavelengths) else { return Ok(Vec::new()) };
        let planes = finished.first().map_or(0, |first| first.planes.len());
        let of_plane = |plane: usize| -> Result<String, TaskError> {
            let [red, green, blue] =
                indices.map(|index| self.context.read_artifact(&finished[index].planes[plane].reconstruction));
            let (red, green, blue) = (red?, green?, blue?);
            self.context.put_artifact(pictures::colour_png([&red, &green, &blue])?)
        };
        (0..planes).map(of_plane).collect()
    }
}

/// The finished hologram of one wavelength.
struct Finished<'a> {
    setup: &'a HologramSetup,
    optimization: Optimization,
    loss: f64,
}

impl Finished<'_> {
    /// Stores the pictures of the hologram and judges it.
    fn store(mut self, context: &JobContext, spec: &OptimizeHologram) -> Result<WavelengthResult, TaskError> {
        let display = &self.setup.display;
        let (height_px, width_px) = (display.height_px(), display.width_px());
        let is_given = steps(spec) == 0;
        let mut notes = notes(spec, self.setup);
        notes.extend(unit_of_given(self.optimization.phases()).filter(|_| is_given));
        let (mut subframes, mut phases, mut displayed) = (Vec::new(), Vec::new(), Vec::new());
        for phase in self.optimization.phases().chunks_exact(height_px * width_px) {
            let wrapped = phase.iter().map(|&phi| wrap_f32(f64::from(phi))).collect();
            let phase = Plane::try_from_vec(height_px, width_px, wrapped)?;
            let levels = display.levels_of(&phase)?;
            subframes.push(Subframe {
                pattern: context.put_artifact(pictures::levels_png(&levels, display.declared.bit_depth)?)?,
                phase: context.put_artifact(pictures::npy_f32(&phase)?)?,
            });
            displayed.push(display.without_carrier(display.response.dequantize(&levels)?));
            phases.push(phase);
        }
        let displayed_phases: Vec<f32> = displayed.iter().flat_map(|phase| phase.values()).copied().collect();
        let gain = self.optimization.measure(&displayed_phases)?.best_gain;
        let largest_amplitude = self.optimization.largest_amplitude();
        // Frees the buffers of the optimization before the quality is measured.
        drop(self.optimization);
        let intensity_scale = finite("the gain", intensity_scale(spec.loss.quantity, gain))?;
        let steps_total = self.setup.planes.len() as u32;
        let judging =
            |step| context.report(Progress { stage: "judge".to_owned(), step, steps_total, loss: None, eta_s: None });
        let mut planes = Vec::new();
        for (p, plane) in self.setup.planes.iter().enumerate() {
            judging(p as u32)?;
            let belonging = self.setup.belonging(p);
            let wanted = Wanted { target: &plane.target, region: self.setup.region, belonging: belonging.as_ref() };
            let light = light_of_frames(&plane.engine, &displayed)?;
            let reconstruction = light.map(|light| (intensity_scale * f64::from(light)) as f32);
            let reconstruction = context.put_artifact(pictures::grey_png_srgb(&reconstruction)?)?;
            if is_given && p == 0 {
                notes.extend(sign_of_given(plane, self.setup.region, &displayed, &light)?);
            }
            drop(light);
            let judge = Judge { context, spec, setup: self.setup, plane };
            let Judged { quality, quantized_quality, judged_by, in_photograph, other_orders_psnr_db, second_opinion } =
                judge.judged(&phases, &displayed, wanted)?;
            planes.push(PlaneResult {
                distance: plane.plane.distance,
                reconstruction,
                quality,
                quantized_quality,
                judged_by,
                in_photograph,
                propagation: plane.validity.clone(),
                other_orders_psnr_db,
                second_opinion,
            });
        }
        judging(steps_total)?;
        let (wavelength, loss) = (self.setup.wavelength, self.loss);
        Ok(WavelengthResult { wavelength, subframes, planes, intensity_scale, loss, largest_amplitude, notes })
    }
}

/// The factor from the light of a hologram to that of its target, for a gain of the compared quantity.
fn intensity_scale(quantity: Quantity, gain: f64) -> f64 {
    match quantity {
        Quantity::Intensity => gain,
        Quantity::Amplitude => gain * gain,
    }
}

/// A small PNG of the light of the present phases, in the brightness of the target.
fn picture_so_far(optimization: &mut Optimization, intensity_scale: f64) -> Option<Vec<u8>> {
    let light = optimization.light_preview(LIVE_SIDE_PX_MAX);
    pictures::grey_png_srgb(&light.map(|light| (intensity_scale * f64::from(light)) as f32)).ok()
}

/// Number of steps that take about as long as an interval, at the time of one.
fn steps_within(interval: Duration, step: Duration) -> u32 {
    (interval.as_secs_f64() / step.as_secs_f64().max(1e-6)).clamp(1.0, f64::from(STEPS_MAX)) as u32
}

/// Number of iterations of each hologram.
fn steps(spec: &OptimizeHologram) -> u32 {
    if spec.method == HologramMethod::DoublePhase { 1 } else { spec.iterations }
}
