//! The slow twin of a hologram's problem: the light of every image plane from its definition in f64, and the gradient
//! by differences of the loss.
//!
//! ```text
//! ∂L/∂φ_i ≈ ( L(φ + h e_i) − L(φ − h e_i) ) / 2h
//! ```
//!
//! It shares the parts of a [display](DisplayModel) with the fast problem, and nothing of how that computes: no
//! half-transformed fields and no passes. A gradient takes two evaluations for each pixel. Use it for a few hundred
//! pixels, to judge what else computes holograms.

use super::backend::{Backend, Picture};
use super::evaluate::{Evaluate, Evaluation, ProblemSize, Project};
use super::loss::Loss;
use super::roughness::EPSILON;
use crate::display::parts::light_blur;
use crate::display::{Carrier, Detector, DisplayModel};
use crate::engine::photometry::Quantity;
use crate::engine::slm::Slm;
use crate::error::{Error, Result};
use crate::interrupt;
use crate::metrics::Gain;
use crate::numerics::{Plane, RegionOfInterest};
use crate::reference::display_light::{Optics, behind_modulator, image};
use rayon::prelude::*;

/// h \[rad\]. The error of a difference is some h² of the gradient.
const STEP_RAD: f64 = 1e-4;

/// The [`Backend`] of [`PlainProblem`]s.
#[derive(Clone, Copy, Debug)]
pub struct Plain;

impl Backend for Plain {
    fn hologram(
        &self,
        pictures: Vec<Picture<'_>>,
        frames: usize,
        region: RegionOfInterest,
        loss: Loss,
    ) -> Result<Box<dyn Project>> {
        Ok(Box::new(PlainProblem::new(pictures, frames, region, loss)?))
    }
}

/// A hologram's problem, computed from definitions in f64. See [`HologramProblem`](super::HologramProblem).
#[derive(Debug)]
pub struct PlainProblem {
    pub(super) planes: Vec<PlainPlane>,
    pub(super) detector: Detector,
    pub(super) slm: Slm<f32>,
    pub(super) size: ProblemSize,
    pub(super) region: RegionOfInterest,
    loss: Loss,
}

/// A target picture with the display that shows it.
#[derive(Debug)]
pub(super) struct PlainPlane {
    pub(super) model: DisplayModel,
    pub(super) carrier: Option<Carrier>,
    pub(super) target: Plane<f32>,
    pub(super) weight: Option<Plane<f32>>,
    /// The shares of all planes add up to 1.
    pub(super) share: f64,
    pub(super) optics: Optics,
}

impl PlainProblem {
    /// Problem with pictures that [`HologramProblem::on`](super::HologramProblem::on) has checked.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] without pictures; [`Error::Incompatible`] for a display that shows all orders of its pixels.
    pub fn new(pictures: Vec<Picture<'_>>, frames: usize, region: RegionOfInterest, loss: Loss) -> Result<Self> {
        let Some(first) = pictures.first() else {
            return Err(Error::Empty { name: "planes", needed: "at least one picture is needed" });
        };
        if pictures.iter().any(|picture| picture.display.shows_all_orders()) {
            let reason = "the plain problem knows displays that show the first order only";
            return Err(Error::Incompatible { name: "orders", reason });
        }
        let (height_px, width_px) = (first.display.height_px(), first.display.width_px());
        let size = ProblemSize { planes: pictures.len(), frames, height_px, width_px };
        let (detector, slm) = (first.display.detector(), Slm::of(&first.display.modulator()));
        let shares: f64 = pictures.iter().map(|picture| picture.share).sum();
        let plane = |Picture { display, target, weight, share }: Picture<'_>| PlainPlane {
            model: display.model().clone(),
            carrier: display.modulator().carrier(),
            target,
            weight,
            share: share / shares,
            optics: Optics::new(display.model(), display.detector()),
        };
        Ok(Self { planes: pictures.into_iter().map(plane).collect(), detector, slm, size, region, loss })
    }

    /// Evaluates the loss of phases in f64.
    #[must_use]
    pub fn at(&self, phase: &[f64], gain: Gain) -> Evaluation {
        let lights = self.lights_of_planes(phase);
        let mut roughness = 0.0;
        for (plane, lights) in self.planes.iter().zip(&lights) {
            for light in lights {
                roughness += plane.share / lights.len() as f64
                    * (self.loss.total_variation * self.total_variation(plane, light)
                        + self.loss.speckle * self.speckle(plane, light));
            }
        }
        self.compare(&lights, gain, roughness)
    }

    /// Evaluates the loss of the light of all planes, with its roughness.
    pub(super) fn compare(&self, lights: &[Vec<Plane<f64>>], gain: Gain, roughness: f64) -> Evaluation {
        let quantity = |light: f64| match self.loss.quantity {
            Quantity::Intensity => light,
            Quantity::Amplitude => light.sqrt(),
        };
        let targets: Vec<_> = self.planes.iter().map(|plane| plane.target.map(|t| quantity(t.into()))).collect();
        let compared = self.compared(lights, quantity, &targets);
        let (best_gain, loss_at) = (best_gain(&compared), |gain: f64| {
            compared.iter().map(|&(w, p, t)| w * (gain * p - t).powi(2)).sum::<f64>() + roughness
        });
        let best_loss = loss_at(best_gain);
        let loss = match gain {
            Gain::Given(gain) => loss_at(gain),
            Gain::Fitted => best_loss,
        };
        Evaluation { loss, best_gain, best_loss }
    }

    /// Weight, quantity and target of every pixel and light plane. The weights add up to 1.
    pub(super) fn compared(
        &self,
        lights: &[Vec<Plane<f64>>],
        quantity: impl Fn(f64) -> f64,
        targets: &[Plane<f64>],
    ) -> Vec<(f64, f64, f64)> {
        let mut compared = Vec::new();
        for ((plane, lights), target) in self.planes.iter().zip(lights).zip(targets) {
            let share = plane.share / lights.len() as f64;
            let all: f64 = self.pixels().map(|(y, x)| plane.weight(y, x)).sum();
            for light in lights {
                let values = self
                    .pixels()
                    .map(|(y, x)| (share * plane.weight(y, x) / all, quantity(light.at(y, x)), target.at(y, x)));
                compared.extend(values);
            }
        }
        compared
    }

    /// Light planes of the detector in each image plane.
    pub(super) fn lights_of_planes(&self, phase: &[f64]) -> Vec<Vec<Plane<f64>>> {
        self.planes.iter().map(|plane| self.lights(plane, phase)).collect()
    }

    /// Light planes of the detector in an image plane, the mean over the frames.
    fn lights(&self, plane: &PlainPlane, phase: &[f64]) -> Vec<Plane<f64>> {
        let ProblemSize { frames, height_px, width_px, .. } = self.size;
        let places = self.detector.places_px().len();
        let planes = if self.detector == Detector::Supersampled { places } else { 1 };
        let mut lights = vec![Plane::filled(height_px, width_px, 0.0); planes];
        for phase in phase.chunks_exact(self.size.frame_len()) {
            let spectra = plane.optics.spectra(&behind_modulator(&plane.model, plane.carrier, phase));
            for (share, to_places) in &plane.optics.modes {
                for (place, transfers) in to_places.iter().enumerate() {
                    let image = image(&spectra, transfers);
                    let part = share * planes as f64 / (places * frames) as f64;
                    let light = &mut lights[place % planes];
                    for (y, x) in (0..height_px).flat_map(|y| (0..width_px).map(move |x| (y, x))) {
                        light.values_mut()[y * width_px + x] += part * image.at(y, x).norm_sqr();
                    }
                }
            }
        }
        lights.iter().map(|light| light_blur::blurred_light(light, &plane.model.light_blur)).collect()
    }

    fn pixels(&self) -> impl Iterator<Item = (usize, usize)> + Clone {
        let region = self.region;
        (region.y_px()..region.y_px() + region.height_px())
            .flat_map(move |y| (region.x_px()..region.x_px() + region.width_px()).map(move |x| (y, x)))
    }

    /// V of [roughness](super::roughness).
    fn total_variation(&self, plane: &PlainPlane, light: &Plane<f64>) -> f64 {
        let (_, mean, _) = self.moments(plane, light, self.pixels());
        let inside = |y, x| self.region.columns(y).is_some_and(|columns| columns.contains(&x));
        let change = |from: f64, y, x| if inside(y, x) { (light.at(y, x) - from) / mean } else { 0.0 };
        let all: f64 = self.pixels().map(|(y, x)| plane.weight(y, x)).sum();
        let terms = self.pixels().map(|(y, x)| {
            let [dx, dy] = [change(light.at(y, x), y, x + 1), change(light.at(y, x), y + 1, x)];
            plane.weight(y, x) / all * ((dx * dx + dy * dy + EPSILON * EPSILON).sqrt() - EPSILON)
        });
        if mean > 0.0 { terms.sum() } else { 0.0 }
    }

    /// S of [roughness](super::roughness).
    fn speckle(&self, plane: &PlainPlane, light: &Plane<f64>) -> f64 {
        let (region, side_px) = (self.region, self.loss.speckle_block_px);
        let target = plane.target.map(f64::from);
        let blocks = (0..region.height_px() / side_px)
            .flat_map(|row| (0..region.width_px() / side_px).map(move |column| (row, column)));
        let [mut excess, mut all] = [0.0; 2];
        for (row, column) in blocks {
            let (y0, x0) = (region.y_px() + row * side_px, region.x_px() + column * side_px);
            let pixels = (y0..y0 + side_px).flat_map(|y| (x0..x0 + side_px).map(move |x| (y, x)));
            let (weight, wanted_mean, wanted) = self.moments(plane, &target, pixels.clone());
            let (_, mean, shown) = self.moments(plane, light, pixels);
            all += weight * wanted_mean;
            excess += if mean > 0.0 { weight * wanted_mean * (shown - wanted).powi(2) } else { 0.0 };
        }
        if all > 0.0 { excess / all } else { 0.0 }
    }

    /// Sum of the weights of some pixels, and the mean and contrast √(σ²/m² + ε²) of their light.
    fn moments(
        &self,
        plane: &PlainPlane,
        light: &Plane<f64>,
        pixels: impl Iterator<Item = (usize, usize)> + Clone,
    ) -> (f64, f64, f64) {
        let weight: f64 = pixels.clone().map(|(y, x)| plane.weight(y, x)).sum();
        if weight == 0.0 {
            return (0.0, 0.0, EPSILON);
        }
        let mean = pixels.clone().map(|(y, x)| plane.weight(y, x) * light.at(y, x)).sum::<f64>() / weight;
        let variance = pixels.map(|(y, x)| plane.weight(y, x) * (light.at(y, x) - mean).powi(2)).sum::<f64>() / weight;
        let relative = if mean > 0.0 { variance / (mean * mean) } else { 0.0 };
        (weight, mean, (relative + EPSILON * EPSILON).sqrt())
    }
}

impl PlainPlane {
    pub(super) fn weight(&self, y: usize, x: usize) -> f64 {
        self.weight.as_ref().map_or(1.0, |weight| weight.at(y, x).into())
    }
}

/// The gain s with the least Σ w (s p − t)².
pub(super) fn best_gain(compared: &[(f64, f64, f64)]) -> f64 {
    let sum = |of: &dyn Fn(f64, f64) -> f64| compared.iter().map(|&(w, p, t)| w * of(p, t)).sum::<f64>();
    let (pp, tp) = (sum(&|p, _| p * p), sum(&|p, t| t * p));
    if pp > 0.0 { tp / pp } else { 0.0 }
}

impl Evaluate for PlainProblem {
    fn size(&self) -> ProblemSize {
        self.size
    }

    fn evaluate(&mut self, phase: &[f32], gain: Gain, gradient: &mut [f32]) -> Evaluation {
        let phase = widened(phase);
        gradient.par_iter_mut().enumerate().for_each(|(i, slope)| {
            interrupt::check();
            let [above, below] = [STEP_RAD, -STEP_RAD].map(|step| {
                let mut moved = phase.clone();
                moved[i] += step;
                self.at(&moved, gain).loss
            });
            *slope = ((above - below) / (2.0 * STEP_RAD)) as f32;
        });
        self.at(&phase, gain)
    }

    fn measure(&mut self, phase: &[f32], gain: f64) -> Evaluation {
        let phase = widened(phase);
        self.at(&phase, Gain::Given(gain))
    }

    fn light(&mut self, phase: &[f32]) -> Vec<f32> {
        let phase = widened(phase);
        let lights = self.lights(&self.planes[0], &phase);
        let rows = (0..self.size.height_px).flat_map(|y| lights.iter().flat_map(move |light| light.row(y)));
        rows.map(|&light| light as f32).collect()
    }
}

pub(super) fn widened(values: &[f32]) -> Vec<f64> {
    values.iter().copied().map(f64::from).collect()
}
