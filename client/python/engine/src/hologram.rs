//! Optimization of the hologram of one wavelength, with the steps and results of the server's job.

use crate::arrays::{array, frames_of, plane, stack};
use crate::display::DisplayModel;
use crate::error::Refused;
use crate::loss::Compared;
use crate::optics::json;
use crate::pictures::levels_png;
use crate::threads::{self, Progress};
use lightpath_domain::job::{Judging, nearest_planes, pixels_of_planes, weight_in_plane};
use lightpath_domain::units::Distance;
use lightpath_media::pictures;
use lightpath_optics::display::phase_response::{PhaseResponse, wrap_f32};
use lightpath_optics::engine::photometry::Quantity;
use lightpath_optics::hologram::{HologramOptions, ImagePlane, Levels, Quality, ShownLight, Wanted, light_of_frames};
use lightpath_optics::second_opinion::{Effort, SecondOpinion};
use lightpath_optics::{HologramMethod, HologramProblem, InitialPhase, Optimization, Plane, RegionOfInterest};
use numpy::{PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3};
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
    /// Number of patterns that are shown one after the other.
    subframes: u32,
    bit_depth: u32,
    quantization_aware: bool,
    judge: Judging,
}

/// Numbers of a finished hologram.
#[derive(Serialize)]
struct Facts {
    /// x, y, width, height \[px\].
    region: [usize; 4],
    planes: Vec<PlaneFacts>,
    intensity_scale: f64,
    largest_amplitude: Option<f64>,
}

/// Numbers of one picture of a hologram.
#[derive(Default, Serialize)]
struct PlaneFacts {
    /// `None`: not judged.
    quality: Option<Quality>,
    quantized_quality: Option<Quality>,
    second_opinion: Option<SecondOpinion>,
}

struct Optimized {
    phases: Vec<Plane<f32>>,
    reconstructions: Vec<Plane<f32>>,
    levels_png: Vec<Vec<u8>>,
    reconstructions_png: Vec<Vec<u8>>,
    loss: Vec<f64>,
    facts: Facts,
}

/// Phases of all subframes; of each plane the reconstruction; PNGs of the levels; PNGs of the reconstructions; losses;
/// and other facts as JSON.
type Answer<'py> = (
    Bound<'py, PyArray3<f32>>,
    Vec<Bound<'py, PyArray2<f32>>>,
    Vec<Bound<'py, PyBytes>>,
    Vec<Bound<'py, PyBytes>>,
    Vec<f64>,
    String,
);

/// Planes that an optimization may have besides its targets: the weights of the pixels, a depth map (1: the first of the
/// displays, 0: the last), and the phases \[rad\] of the initial phase `given`, one for each subframe.
type Maps<'py> =
    (Option<PyReadonlyArray2<'py, f32>>, Option<PyReadonlyArray2<'py, f32>>, Option<PyReadonlyArray3<'py, f32>>);

/// Optimizes a hologram that shows a target on each of some displays, which are one display at several distances.
#[pyfunction]
pub(crate) fn optimize<'py>(
    py: Python<'py>,
    displays: Vec<Py<DisplayModel>>,
    targets: Vec<PyReadonlyArray2<'py, f32>>,
    options: &str,
    maps: Maps<'py>,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<Answer<'py>> {
    let (weight, depth, given) = maps;
    let given = given.map(|phases| frames_of("initial_phase", &phases)).transpose()?;
    let request = Request {
        displays: displays.iter().map(Py::get).collect(),
        targets: targets.iter().map(|target| plane("target", target)).collect::<Result<_, _>>()?,
        weight: weight.map(|weight| plane("weight", &weight)).transpose()?,
        depth: depth.map(|depth| plane("depth_map", &depth)).transpose()?,
        options: serde_json::from_str(options).map_err(Refused::from)?,
    };
    let done = threads::compute_long(py, progress, |sender| request.run(given, sender))?;
    let bytes = |files: Vec<Vec<u8>>| files.iter().map(|file| PyBytes::new(py, file)).collect();
    Ok((
        stack(py, done.phases)?,
        done.reconstructions.into_iter().map(|shown| array(py, shown)).collect::<PyResult<_>>()?,
        bytes(done.levels_png),
        bytes(done.reconstructions_png),
        done.loss,
        json(&done.facts)?,
    ))
}

struct Request<'a> {
    /// The display at the distance of each target.
    displays: Vec<&'a DisplayModel>,
    targets: Vec<Plane<f32>>,
    weight: Option<Plane<f32>>,
    depth: Option<Plane<f32>>,
    options: Options,
}

impl Request<'_> {
    fn run(&self, given: Option<Plane<f32>>, sender: &Sender<Progress>) -> Result<Optimized, Refused> {
        let Options { compared, method, iterations, seed, initial_phase, subframes, bit_depth, .. } = &self.options;
        let [first, ..] = self.displays[..] else {
            return Err(Refused::new("distance", "EMPTY", "at least one plane is needed"));
        };
        let is_given = matches!(initial_phase, Some(InitialPhase::Given(())));
        if *iterations == 0 && (!is_given || *method == HologramMethod::DoublePhase) {
            let problem = "iterations is 0, but must be at least 1; 0 judges phases that initial_phase gives";
            return Err(Refused::new("iterations", "OUT_OF_RANGE", problem));
        }
        if *iterations == 0 && self.options.judge == Judging::None {
            let problem = "judge is none, but must be quick or full for 0 iterations, which only judge";
            return Err(Refused::new("judge", "OUT_OF_RANGE", problem));
        }
        let response = PhaseResponse::linear(*bit_depth)?;
        let (region, nearest) = (compared.region(first)?, self.nearest()?);
        let problem = self.problem(region, nearest.as_ref())?;
        let initial = match initial_phase {
            None => InitialPhase::recommended(*method, compared.detector, *subframes),
            Some(initial) => initial.try_map_given(|()| {
                given.ok_or_else(|| Refused::new("initial_phase", "EMPTY", "initial_phase has no phases"))
            })?,
        };
        let start = initial.phases(&problem, &first.model.setup, *seed)?;
        let mut options = HologramOptions::new(*method, *iterations);
        if self.options.quantization_aware {
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
        self.finish(optimization, &response, loss, (region, nearest))
    }

    /// Index of the plane to which each pixel belongs.
    fn nearest(&self) -> Result<Option<Plane<u8>>, Refused> {
        let Some(depth) = &self.depth else { return Ok(None) };
        let place = |display: &&DisplayModel| {
            let distance_m = display.model.setup.distance_m();
            let outside = || Refused::new("distance", "OUT_OF_RANGE", format!("distance is {distance_m} m"));
            let distance = Distance::from_m(distance_m).ok_or_else(outside)?;
            Ok(lightpath_domain::job::ImagePlane { distance, target: String::new(), weight: 1.0 })
        };
        Ok(Some(nearest_planes(depth, &self.displays.iter().map(place).collect::<Result<Vec<_>, Refused>>()?)))
    }

    /// The problem. Planes of a depth map without any weight are left out, as on a server.
    fn problem(&self, region: RegionOfInterest, nearest: Option<&Plane<u8>>) -> Result<HologramProblem, Refused> {
        let compared = &self.options.compared;
        let mut planes = Vec::new();
        for (p, (display, target)) in self.displays.iter().zip(&self.targets).enumerate() {
            let (weight, share) = weight_in_plane(p, self.weight.as_ref(), nearest, region);
            if share > 0.0 {
                let engine = display.engine(compared.detector)?;
                planes.push(ImagePlane { weight, share, ..ImagePlane::new(engine, target.clone()) });
            }
        }
        Ok(HologramProblem::with_planes(planes, self.options.subframes as usize, region, compared.loss)?)
    }

    /// Rounds the phases to the display's levels, and measures both.
    fn finish(
        &self,
        mut optimization: Optimization,
        response: &PhaseResponse,
        mut loss: Vec<f64>,
        (region, nearest): (RegionOfInterest, Option<Plane<u8>>),
    ) -> Result<Optimized, Refused> {
        let [height_px, width_px] = [self.targets[0].height_px(), self.targets[0].width_px()];
        let (mut phases, mut files, mut displayed) = (Vec::new(), Vec::new(), Vec::new());
        for phase in optimization.phases().chunks_exact(height_px * width_px) {
            let wrapped = phase.iter().map(|&phase| wrap_f32(f64::from(phase))).collect();
            let phase = Plane::try_from_vec(height_px, width_px, wrapped)?;
            let levels = response.quantize(&phase)?;
            files.push(levels_png(&levels, self.options.bit_depth)?);
            displayed.push(response.dequantize(&levels)?);
            phases.push(phase);
        }
        if loss.is_empty() {
            // Given phases are judged as they are.
            let given: Vec<f32> = phases.iter().flat_map(|phase| phase.values()).copied().collect();
            loss.push(optimization.measure(&given)?.best_loss);
        }
        let all: Vec<f32> = displayed.iter().flat_map(|phase| phase.values()).copied().collect();
        let gain = optimization.measure(&all)?.best_gain;
        let intensity_scale = match self.options.compared.loss.quantity {
            Quantity::Intensity => gain,
            Quantity::Amplitude => gain * gain,
        };
        let largest_amplitude = optimization.largest_amplitude();
        // Frees the buffers of the optimization before the quality is measured.
        drop(optimization);
        let (mut planes, mut reconstructions, mut pictures) = (Vec::new(), Vec::new(), Vec::new());
        for (p, (display, target)) in self.displays.iter().zip(&self.targets).enumerate() {
            let belonging = belonging(nearest.as_ref(), p, self.displays.len(), region);
            let wanted = Wanted { target, region, belonging: belonging.as_ref() };
            planes.push(self.measured(display, wanted, &phases, &displayed)?);
            let light = light_of_frames(&display.engine(self.options.compared.detector)?, &displayed)?;
            let shown = light.map(|light| (intensity_scale * f64::from(light)) as f32);
            pictures.push(pictures::grey_png_srgb(&shown)?);
            reconstructions.push(shown);
        }
        let region = [region.x_px(), region.y_px(), region.width_px(), region.height_px()];
        let facts = Facts { region, planes, intensity_scale, largest_amplitude };
        Ok(Optimized { phases, reconstructions, levels_png: files, reconstructions_png: pictures, loss, facts })
    }

    /// Measures one picture of the phases, and of those phases that the display shows.
    fn measured(
        &self,
        display: &DisplayModel,
        wanted: Wanted<'_>,
        phases: &[Plane<f32>],
        displayed: &[Plane<f32>],
    ) -> Result<PlaneFacts, Refused> {
        if self.options.judge == Judging::None {
            return Ok(PlaneFacts::default());
        }
        let detector = self.options.compared.detector;
        let shown = ShownLight::of_sets(&display.engine(detector)?, &[phases, displayed])?;
        let opinion =
            || SecondOpinion::of((&display.model, None), displayed, &shown[1], detector, wanted, Effort::CHEAP);
        Ok(PlaneFacts {
            quality: Some(shown[0].quality(wanted)?),
            quantized_quality: Some(shown[1].quality(wanted)?),
            second_opinion: if self.options.judge == Judging::Full { opinion()? } else { None },
        })
    }
}

/// Pixels that belong to plane `p`; `None`: all of them, also if the depth map gives the plane no pixel of the region.
fn belonging(nearest: Option<&Plane<u8>>, p: usize, planes: usize, region: RegionOfInterest) -> Option<Plane<bool>> {
    let nearest = nearest?;
    (pixels_of_planes(nearest, planes, region)[p] > 0).then(|| nearest.map(|plane| usize::from(plane) == p))
}
