//! Computes holograms: phases that show the target pictures.

use crate::context::Eta;
use crate::display_setup::{DisplaySetup, finite};
use crate::hologram_notes::{notes, sign_of_given, unit_of_given};
use crate::hologram_setup::{HologramSetup, PlaneSetup, colours};
use crate::state_bytes::{HologramState, from_bytes, to_bytes};
use crate::{JobContext, TaskError, TaskOutput};
use lightpath_domain::expected_psnr::ExpectedPsnr;
use lightpath_domain::job::{
    HologramResult, JobEffect, JobResult, JudgedBy, OptimizeHologram, PlaneResult, Progress, Subframe, WavelengthResult,
};
use lightpath_media::pictures;
use lightpath_metrics as metrics;
use lightpath_optics::display::phase_response::wrap_f32;
use lightpath_optics::engine::photometry::Quantity;
use lightpath_optics::hologram::{
    DetectorQuality, HologramMethod, OptimizationState, Quality, ShownLight, Wanted, light_of_frames, pixel_psnr_db,
};
use lightpath_optics::second_opinion::{Effort, SecondOpinion};
use lightpath_optics::{DisplayModel, Optimization, Plane};
use std::sync::LazyLock;
use std::time::{Duration, Instant};

/// Longest side of the picture that a running job shows \[px\]: enough to see what becomes of it, in a few kilobytes.
const LIVE_SIDE_PX_MAX: usize = 320;

pub(super) fn run(context: &JobContext, spec: &OptimizeHologram) -> Result<TaskOutput, TaskError> {
    let wavelengths = spec.wavelengths.len();
    let mut running = RunningJob { context, spec, state: HologramState::default(), current: None, eta: None };
    if let Some((state, current)) = context.take_saved_state().and_then(|bytes| from_bytes(&bytes)) {
        (running.state, running.current) = (state, Some(current));
    }
    for index in running.state.finished.len()..wavelengths {
        let setup = HologramSetup::read(context, spec, index)?;
        let mut optimization = running.begin(&setup, index)?;
        let loss = running.iterate(&mut optimization, wavelengths, &setup)?;
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
    /// Resumes the optimization of an earlier attempt, or starts a new one.
    fn begin(&mut self, setup: &HologramSetup, index: usize) -> Result<Optimization, TaskError> {
        let (problem, options) = (setup.problem(self.spec)?, setup.options(self.spec)?);
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
        loop {
            let (started, transformed) = (Instant::now(), optimization.evaluation_time());
            let Some(done) = optimization.step() else { return Ok(self.state.loss) };
            let took = started.elapsed();
            self.state.loss = finite("the loss", done.evaluation.loss)?;
            metrics::hologram_iteration(took, optimization.evaluation_time() - transformed);
            self.state.compute_s += took.as_secs_f64();
            self.state.steps += 1;
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
        let HologramState { finished, compute_s, steps: done, .. } = self.state;
        let iteration_time_s = compute_s / f64::from(done.max(1));
        let (detector, iterations) = (self.spec.detector, steps(self.spec));
        Ok(HologramResult { wavelengths: finished, colour_reconstructions, detector, iterations, iteration_time_s })
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

/// Steps in which a plane is judged: by the kernel of the hologram, by the independent model, by the best model of the
/// display, and for the other kind of optics.
const JUDGEMENTS: u32 = 4;

/// The finished hologram of one wavelength.
struct Finished<'a> {
    setup: &'a HologramSetup,
    optimization: Optimization,
    loss: f64,
}

impl Finished<'_> {
    /// Stores the pictures of the hologram and measures its quality.
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
        let judgements_total = JUDGEMENTS * self.setup.planes.len() as u32;
        let judge = |step| {
            let stage = "judge".to_owned();
            context.report(Progress { stage, step, steps_total: judgements_total, loss: None, eta_s: None })
        };
        let mut planes = Vec::new();
        for (p, plane) in self.setup.planes.iter().enumerate() {
            let done = JUDGEMENTS * p as u32;
            judge(done)?;
            let belonging = self.setup.belonging(p);
            let wanted = Wanted { target: &plane.target, region: self.setup.region, belonging: belonging.as_ref() };
            let light = light_of_frames(&plane.engine, &displayed)?;
            let reconstruction = light.map(|light| (intensity_scale * f64::from(light)) as f32);
            let reconstruction = context.put_artifact(pictures::grey_png_srgb(&reconstruction)?)?;
            if is_given && p == 0 {
                notes.extend(sign_of_given(plane, self.setup.region, &displayed, &light)?);
            }
            drop(light);
            let quality = |shown: &ShownLight| -> Result<Quality, TaskError> { all_finite(shown.quality(wanted)?) };
            let mut shown = ShownLight::of_sets(&plane.engine, &[&phases, &displayed])?;
            let (quality, quantized_quality) = (quality(&shown[0])?, quality(&shown[1])?);
            let quantized = shown.remove(1);
            drop(shown);
            judge(done + 1)?;
            let opinion = SecondOpinion::of(
                (&plane.model, display.carrier),
                &displayed,
                &quantized,
                spec.detector,
                wanted,
                Effort::CHEAP,
            )?;
            let pixel_gain = quantized.pixel_gain(wanted)?;
            drop(quantized);
            judge(done + 2)?;
            let (judged_by, in_photograph) = match judged_by((context, spec), self.setup, plane, &displayed, wanted)? {
                Some((judged, expected)) => (Some(judged), expected),
                None => (None, expected(plane, &plane.model, &quantized_quality, pixel_gain)),
            };
            judge(done + 3)?;
            planes.push(PlaneResult {
                distance: plane.plane.distance,
                reconstruction,
                quality,
                quantized_quality,
                judged_by,
                in_photograph,
                propagation: plane.validity.clone(),
                other_orders_psnr_db: other_orders_psnr_db((context, self.setup), plane, &displayed, wanted)?,
                second_opinion: opinion.map(finite_opinion).transpose()?,
            });
        }
        judge(judgements_total)?;
        let (wavelength, loss) = (self.setup.wavelength, self.loss);
        Ok(WavelengthResult { wavelength, subframes, planes, intensity_scale, loss, largest_amplitude, notes })
    }
}

/// Quality of the displayed phases by the best model of the display, and what a photograph is expected to show; `None`: the
/// kernel of the hologram is the best model.
fn judged_by(
    (context, spec): (&JobContext, &OptimizeHologram),
    setup: &HologramSetup,
    plane: &PlaneSetup,
    displayed: &[Plane<f32>],
    wanted: Wanted<'_>,
) -> Result<Option<(JudgedBy, Option<ExpectedPsnr>)>, TaskError> {
    let Some(version) = plane.judging_version else { return Ok(None) };
    let (wavelength, distance) = (setup.wavelength, plane.plane.distance);
    let display = DisplaySetup::read_with(context, &spec.display, wavelength, distance, spec.propagation)?;
    let model = display.model(context, Some(version))?;
    let engine = context.engines().engine(&model, spec.detector, display.carrier)?;
    let shown = ShownLight::of_sets(&engine, &[displayed])?;
    let quality = all_finite(shown[0].quality(wanted)?)?;
    let expected = expected(plane, &model, &quality, shown[0].pixel_gain(wanted)?);
    Ok(Some((JudgedBy { key: display.key, version, quality }, expected)))
}

/// What a photograph is expected to show, by the best model of the display. `gain` is the factor from the light that its
/// pixels integrate to the target. `None`: the error of the model on test photographs is not known.
fn expected(plane: &PlaneSetup, model: &DisplayModel, quality: &Quality, gain: f64) -> Option<ExpectedPsnr> {
    let expected = ExpectedPsnr::of(quality.pixel.psnr_db, plane.test_loss?, gain / model.gain);
    // A model without light has no gain.
    expected.psnr_db.is_finite().then_some(expected)
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

/// What the hologram would show on a display of the other kind. A carrier needs optics that filter the orders.
fn other_orders_psnr_db(
    (context, setup): (&JobContext, &HologramSetup),
    plane: &PlaneSetup,
    phases: &[Plane<f32>],
    wanted: Wanted<'_>,
) -> Result<Option<f64>, TaskError> {
    let model = plane.with_other_orders.as_ref().filter(|_| setup.display.carrier.is_none());
    let Some(model) = model else { return Ok(None) };
    let psnr_db = pixel_psnr_db(context.engines(), model, phases, wanted)?;
    Ok(Some(finite("the quality with the other orders", psnr_db.min(DetectorQuality::PSNR_DB_MAX))?))
}

/// Checks that both numbers of an opinion are finite.
fn finite_opinion(opinion: SecondOpinion) -> Result<SecondOpinion, TaskError> {
    finite("the second opinion", opinion.engine_psnr_db + opinion.independent_psnr_db)?;
    Ok(opinion)
}

/// Number of iterations of each hologram.
fn steps(spec: &OptimizeHologram) -> u32 {
    if spec.method == HologramMethod::DoublePhase { 1 } else { spec.iterations }
}

/// Checks that all numbers of a quality are finite: JSON has no NaN and no infinity.
fn all_finite(quality: Quality) -> Result<Quality, TaskError> {
    for values in [quality.point, quality.pixel, quality.supersampled] {
        let required = [values.psnr_db, values.diffraction_efficiency, values.frame_efficiency];
        let optional = [values.ssim, values.ms_ssim, values.speckle_contrast];
        for value in required.into_iter().chain(optional.into_iter().flatten()) {
            finite("the quality", value)?;
        }
    }
    Ok(quality)
}
