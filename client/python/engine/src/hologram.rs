//! Optimization of a hologram, with the steps and results of the server's job.

use crate::arrays::{array, plane};
use crate::display::DisplayModel;
use crate::error::Refused;
use crate::loss::Compared;
use crate::optics::json;
use crate::pictures::levels_png;
use crate::threads::{self, Progress};
use lightpath_media::pictures;
use lightpath_optics::display::phase_response::{PhaseResponse, wrap_f32};
use lightpath_optics::engine::photometry::Quantity;
use lightpath_optics::hologram::{HologramOptions, Levels, Quality, ShownLight, light_of_frames};
use lightpath_optics::second_opinion::{Effort, SecondOpinion};
use lightpath_optics::{HologramMethod, InitialPhase, Optimization, Plane};
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde::{Deserialize, Serialize};
use std::sync::mpsc::Sender;

/// Options of an optimization.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Options {
    compared: Compared,
    method: HologramMethod,
    iterations: u32,
    seed: u64,
    /// `None`: the recommended one.
    initial_phase: Option<InitialPhase<()>>,
    bit_depth: u32,
    quantization_aware: bool,
}

/// Numbers of a finished hologram.
#[derive(Serialize)]
struct Facts {
    quality: Quality,
    quantized_quality: Quality,
    second_opinion: Option<SecondOpinion>,
    intensity_scale: f64,
    largest_amplitude: Option<f64>,
}

struct Optimized {
    phase: Plane<f32>,
    reconstruction: Plane<f32>,
    levels_png: Vec<u8>,
    reconstruction_png: Vec<u8>,
    loss: Vec<f64>,
    facts: Facts,
}

/// Phase, reconstruction, PNG of the levels, PNG of the reconstruction, losses, and other facts as JSON.
type Answer<'py> =
    (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<f32>>, Bound<'py, PyBytes>, Bound<'py, PyBytes>, Vec<f64>, String);

/// Optimizes a hologram. The pair of planes has the weights of the pixels, and the phase \[rad\] of the initial phase
/// `given`.
#[pyfunction]
pub(crate) fn optimize<'py>(
    py: Python<'py>,
    display: &DisplayModel,
    target: PyReadonlyArray2<'py, f32>,
    options: &str,
    weight_and_initial_phase: (Option<PyReadonlyArray2<'py, f32>>, Option<PyReadonlyArray2<'py, f32>>),
    progress: Option<&Bound<'py, PyAny>>,
) -> PyResult<Answer<'py>> {
    let (weight, initial_phase) = weight_and_initial_phase;
    let target = plane("target", &target)?;
    let weight = weight.map(|weight| plane("weight", &weight)).transpose()?;
    let given = initial_phase.map(|phase| plane("initial_phase", &phase)).transpose()?;
    let options: Options = serde_json::from_str(options).map_err(Refused::from)?;
    let work = |sender: &Sender<Progress>| Request { display, target, weight, options }.run(given, sender);
    let done = threads::compute_long(py, progress, work)?;
    Ok((
        array(py, done.phase)?,
        array(py, done.reconstruction)?,
        PyBytes::new(py, &done.levels_png),
        PyBytes::new(py, &done.reconstruction_png),
        done.loss,
        json(&done.facts)?,
    ))
}

struct Request<'a> {
    display: &'a DisplayModel,
    target: Plane<f32>,
    weight: Option<Plane<f32>>,
    options: Options,
}

impl Request<'_> {
    fn run(self, given: Option<Plane<f32>>, sender: &Sender<Progress>) -> Result<Optimized, Refused> {
        let Options { compared, method, iterations, seed, initial_phase, bit_depth, quantization_aware } =
            &self.options;
        let response = PhaseResponse::linear(*bit_depth)?;
        let problem = compared.problem(self.display, self.target.clone(), self.weight.clone())?;
        let initial = match initial_phase {
            None => InitialPhase::recommended(*method, compared.detector, 1),
            Some(initial) => initial.try_map_given(|()| {
                given.ok_or_else(|| Refused::new("initial_phase", "EMPTY", "initial_phase has no phases"))
            })?,
        };
        let start = initial.phases(&problem, &self.display.model.setup, *seed)?;
        let mut options = HologramOptions::new(*method, *iterations);
        if *quantization_aware {
            options.levels = Some(Levels::new(response.clone(), None)?);
        }
        let mut optimization = Optimization::start(problem, options, start)?;
        let mut loss = Vec::new();
        while let Some(step) = optimization.step() {
            loss.push(step.evaluation.loss);
            let (step, steps_total, loss) = (step.iteration, step.iterations, step.evaluation.loss);
            // Nobody listens any more after an exception, which also ends this loop.
            let _ = sender.send(Progress { step, steps_total, loss });
        }
        self.finish(optimization, &response, loss)
    }

    /// Rounds the phase to the display's levels, and measures both.
    fn finish(
        &self,
        mut optimization: Optimization,
        response: &PhaseResponse,
        loss: Vec<f64>,
    ) -> Result<Optimized, Refused> {
        let compared = &self.options.compared;
        let wrapped = optimization.phases().iter().map(|&phase| wrap_f32(f64::from(phase))).collect();
        let phase = Plane::try_from_vec(self.target.height_px(), self.target.width_px(), wrapped)?;
        let levels = response.quantize(&phase)?;
        let displayed = [response.dequantize(&levels)?];
        let gain = optimization.measure(displayed[0].values())?.best_gain;
        let intensity_scale = match compared.loss.quantity {
            Quantity::Intensity => gain,
            Quantity::Amplitude => gain * gain,
        };
        let largest_amplitude = optimization.largest_amplitude();
        drop(optimization);
        let engine = self.display.engine(compared.detector)?;
        let light = light_of_frames(&engine, &displayed)?;
        let reconstruction = light.map(|light| (intensity_scale * f64::from(light)) as f32);
        let region = compared.region(self.display)?;
        let shown = ShownLight::of_sets(&engine, &[std::slice::from_ref(&phase), &displayed])?;
        let facts = Facts {
            quality: shown[0].quality((&self.target, region).into())?,
            quantized_quality: shown[1].quality((&self.target, region).into())?,
            second_opinion: SecondOpinion::of(
                (&self.display.model, None),
                &displayed,
                &shown[1],
                compared.detector,
                (&self.target, region).into(),
                Effort::CHEAP,
            )?,
            intensity_scale,
            largest_amplitude,
        };
        let (levels_png, reconstruction_png) =
            (levels_png(&levels, self.options.bit_depth)?, pictures::grey_png_srgb(&reconstruction)?);
        Ok(Optimized { phase, reconstruction, levels_png, reconstruction_png, loss, facts })
    }
}
