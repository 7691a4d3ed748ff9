//! Light of a hologram as each detector measures it.

use crate::display::Detector;
use crate::engine::{Engine, EngineCore, Real};
use crate::error::{Error, Result};
use crate::interrupt;
use crate::numerics::Plane;
use rayon::prelude::*;

const NO_FRAMES: Error = Error::Empty { name: "phases", needed: "at least one frame is needed" };

/// Light that a hologram shows: at the pixels' centres, integrated over the pixels, and at the sub-samples.
#[derive(Clone, Debug)]
pub struct ShownLight {
    pub(super) at_points: Plane<f32>,
    pub(super) integrated: Plane<f32>,
    pub(super) samples: Plane<f32>,
    /// Light that passes the optics.
    pub(super) passed: f64,
}

impl ShownLight {
    /// Light of several `phases`, shown one after the other.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`] for a phase of another size than the engine's, [`Error::Empty`] if `phases` is empty.
    pub fn of_frames(engine: &Engine, phases: &[Plane<f32>]) -> Result<Self> {
        Ok(Self::of_sets(engine, &[phases])?.remove(0))
    }

    /// Light of several sets of phases. The phases of a set are shown one after the other. The sets share transfer
    /// functions, which are made for this and take most of the time.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::of_frames`].
    pub fn of_sets(engine: &Engine, sets: &[&[Plane<f32>]]) -> Result<Vec<Self>> {
        Self::of_core(&engine.core, sets)
    }

    pub(super) fn of_core<T: Real>(engine: &EngineCore<T>, sets: &[&[Plane<T>]]) -> Result<Vec<Self>> {
        let blurred = |light: Vec<Plane<T>>| -> Vec<Plane<f32>> {
            light.into_iter().map(|light| narrowed(&engine.blurred(light))).collect()
        };
        // The pixels' light is integrated before it blurs.
        let engine = &engine.without_blur();
        if sets.iter().any(|phases| phases.is_empty()) {
            return Err(NO_FRAMES);
        }
        let of_detector = |detector| -> Result<Vec<Plane<T>>> {
            let engine = engine.with_detector(detector);
            let light_of = |phase: &Plane<T>| match detector {
                Detector::Pixel => engine.light(phase),
                Detector::Point | Detector::Supersampled => engine.samples(phase),
            };
            sets.iter().map(|phases| mean_light(phases, light_of)).collect()
        };
        let passed = |phases: &&[Plane<T>]| -> Result<f64> {
            let sum: f64 = phases.iter().map(|phase| engine.light_passed(phase)).sum::<Result<f64>>()?;
            Ok(sum / phases.len() as f64)
        };
        let passed: Vec<f64> = sets.iter().map(passed).collect::<Result<_>>()?;
        let at_points = match engine.exact_points(sets)? {
            Some(points) => points,
            None => of_detector(Detector::Point)?,
        };
        let samples = match engine.exact_samples(sets)? {
            Some(samples) => samples,
            None => of_detector(Detector::Supersampled)?,
        };
        let integrated = match (engine.light_over_pixels(sets)?, engine.camera_fill_factor() < 1.0) {
            (Some(lights), _) => lights,
            (None, true) => of_detector(Detector::Pixel)?,
            (None, false) => {
                samples.iter().map(|samples| integrated(samples, engine.height_px(), engine.width_px())).collect()
            }
        };
        let [at_points, integrated, samples] = [at_points, integrated, samples].map(blurred);
        let lights = at_points.into_iter().zip(integrated).zip(samples).zip(passed);
        let shown =
            lights.map(|(((at_points, integrated), samples), passed)| Self { at_points, integrated, samples, passed });
        Ok(shown.collect())
    }

    /// Light that a detector measures: a value for each pixel, or for the supersampled detector 2×2 values.
    #[must_use]
    pub fn seen_by(&self, detector: Detector) -> &Plane<f32> {
        match detector {
            Detector::Point => &self.at_points,
            Detector::Pixel => &self.integrated,
            Detector::Supersampled => &self.samples,
        }
    }
}

/// Mean over several phases of the light that the engine's detector measures.
///
/// # Errors
///
/// [`Error::SizeMismatch`] for a phase of another size than the engine's, [`Error::Empty`] if `phases` is empty.
pub fn light_of_frames(engine: &Engine, phases: &[Plane<f32>]) -> Result<Plane<f32>> {
    mean_light(phases, |phase| engine.light(phase))
}

/// Mean of the light over the frames, summed in their order.
fn mean_light<T: Real>(phases: &[Plane<T>], light: impl Fn(&Plane<T>) -> Result<Plane<T>>) -> Result<Plane<T>> {
    let [first, rest @ ..] = phases else {
        return Err(NO_FRAMES);
    };
    let mut sum = light(first)?;
    for phase in rest {
        let light = light(phase)?;
        sum.values_mut().par_iter_mut().zip(light.values()).for_each(|(sum, &light)| *sum = *sum + light);
    }
    let share = T::of(1.0 / phases.len() as f64);
    sum.values_mut().par_iter_mut().for_each(|value| *value = *value * share);
    Ok(sum)
}

fn narrowed<T: Real>(plane: &Plane<T>) -> Plane<f32> {
    plane.map(|value| value.wide() as f32)
}

/// Weights of the integral over a pixel on samples at ±1/4, ±3/4, ±5/4 and ±7/4 px. The samples hold all of the
/// intensity of a field without details finer than two pixels, up to one cycle per pixel. The weights fit the integral
/// of such details, sin(πν)/πν at ν cycles per pixel, to 0.5 %, and flat light exactly.
const PIXEL_WEIGHTS: [f64; 4] = [0.948_33, 0.058_50, -0.008_86, 0.002_03];

/// Light integrated over each pixel, from two samples per pixel along each axis. Beyond the sides of the image the
/// outermost samples count again.
fn integrated<T: Real>(samples: &Plane<T>, height_px: usize, width_px: usize) -> Plane<T> {
    let mut light = Plane::filled(height_px, width_px, T::zero());
    let weights = PIXEL_WEIGHTS.map(|weight| T::of(0.5 * weight));
    // The samples at `2i − reach` and `2i + 1 + reach` lie on both sides of pixel i.
    let pair = |i: usize, reach: usize, side: usize| [(2 * i).saturating_sub(reach), (2 * i + 1 + reach).min(side - 1)];
    light.values_mut().par_chunks_mut(width_px).enumerate().for_each_init(
        || vec![T::zero(); samples.width_px()],
        |along_y, (y, out)| {
            interrupt::check();
            along_y.fill(T::zero());
            for (reach, &weight) in weights.iter().enumerate() {
                for row in pair(y, reach, samples.height_px()).map(|row| samples.row(row)) {
                    along_y.iter_mut().zip(row).for_each(|(sum, &sample)| *sum = *sum + weight * sample);
                }
            }
            for (x, light) in out.iter_mut().enumerate() {
                for (reach, &weight) in weights.iter().enumerate() {
                    let [left, right] = pair(x, reach, along_y.len()).map(|i| along_y[i]);
                    *light = *light + weight * (left + right);
                }
            }
        },
    );
    light
}
