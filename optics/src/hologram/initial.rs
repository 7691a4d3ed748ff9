//! Initial phases of an optimization.

use super::evaluate::{ProblemSize, Project};
use super::options::HologramMethod;
use super::problem::HologramProblem;
use crate::display::{Detector, OpticalSetup};
use crate::error::{Error, Result};
use crate::interrupt;
use crate::numerics::Plane;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// Initial phase of an optimization.
///
/// The type parameter `Given` is the form in which the caller gives phases: the phases themselves for an optimization,
/// or the names of files that hold them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InitialPhase<Given = Plane<f32>> {
    /// Random phase, uniform in [0, `range_rad`) and drawn row by row from the seed.
    ///
    /// A wide range (2π) spreads the image's light over all angles and gives speckle. A narrow range keeps the light
    /// smooth and converges to a better picture, with less light outside the picture's own band.
    Random {
        /// Width of the range \[rad\], 0 to 2π.
        range_rad: f64,
    },
    /// The same phase at all pixels.
    Constant {
        /// The phase \[rad\].
        phase_rad: f64,
    },
    /// Phase of a lens, −π r² / (λ f), which sends light from all of the SLM to every part of the picture.
    Quadratic {
        /// Focal length f \[m\]. `None`: [`default_focal_length_m`], with which the SLM's edges steer light by half of
        /// the band.
        focal_length_m: Option<f64>,
    },
    /// Phase of the field on the SLM that results from propagating the targets' amplitudes backwards, with an image
    /// phase uniform in [0, `range_rad`).
    BackPropagated {
        /// Width of the range \[rad\], 0 to 2π.
        range_rad: f64,
    },
    /// Phases \[rad\] given by the caller, frame after frame: `frames · height_px` rows.
    Given(Given),
}

/// Width of the recommended range of random phases \[rad\]: within one radian there is little speckle.
pub const RANDOM_RANGE_RAD: f64 = 1.0;

/// Default focal length of `InitialPhase::Quadratic`: f = 2 N Δ² / λ \[m\] for the longer side's N pixels of pitch Δ.
/// The SLM's edges then steer light by half of the band.
#[must_use]
pub fn default_focal_length_m(setup: &OpticalSetup) -> f64 {
    let side_px = setup.grid().height_px().max(setup.grid().width_px()) as f64;
    2.0 * side_px * setup.grid().pixel_pitch_m().powi(2) / setup.wavelength_m()
}

impl<Given> InitialPhase<Given> {
    /// The start that leads to the best picture.
    ///
    /// - A method that follows the gradient starts from the field that the targets send back to the SLM, with an image
    ///   phase within 1 rad. For the light between the pixels the image has the same phase everywhere: random phases
    ///   have vortices there, which an optimization cannot remove.
    /// - Gerchberg and Saxton's methods start from a random phase within 1 rad. So do several frames, because they must
    ///   differ.
    /// - Double phase starts from an image with the same phase everywhere.
    #[must_use]
    pub fn recommended(method: HologramMethod, detector: Detector, frames: u32) -> Self {
        match (method, detector) {
            (HologramMethod::DoublePhase, _) => Self::Constant { phase_rad: 0.0 },
            _ if !method.follows_gradient() || frames > 1 => Self::Random { range_rad: RANDOM_RANGE_RAD },
            (_, Detector::Supersampled) => Self::BackPropagated { range_rad: 0.0 },
            (_, Detector::Point | Detector::Pixel) => Self::BackPropagated { range_rad: RANDOM_RANGE_RAD },
        }
    }

    /// Converts the value of `InitialPhase::Given` with `read`; other initial phases stay unchanged.
    ///
    /// # Errors
    ///
    /// The errors of `read`.
    pub fn try_map_given<Read, E>(
        &self,
        read: impl FnOnce(&Given) -> std::result::Result<Read, E>,
    ) -> std::result::Result<InitialPhase<Read>, E> {
        Ok(match self {
            Self::Random { range_rad } => InitialPhase::Random { range_rad: *range_rad },
            Self::Constant { phase_rad } => InitialPhase::Constant { phase_rad: *phase_rad },
            Self::Quadratic { focal_length_m } => InitialPhase::Quadratic { focal_length_m: *focal_length_m },
            Self::BackPropagated { range_rad } => InitialPhase::BackPropagated { range_rad: *range_rad },
            Self::Given(given) => InitialPhase::Given(read(given)?),
        })
    }
}

impl InitialPhase {
    /// Returns the phases of all frames \[rad\]. Random phases differ from frame to frame.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a range that is not between 0 and 2π, a focal length of 0, or numbers that are not
    /// finite; [`Error::SizeMismatch`] for a given phase of another size; [`Error::NotFinite`] for a given phase with
    /// values that are not finite.
    pub fn phases(&self, problem: &HologramProblem, setup: &OpticalSetup, seed: u64) -> Result<Vec<f32>> {
        let size = problem.body.size();
        let ProblemSize { frames, height_px, width_px, .. } = size;
        match self {
            Self::Random { range_rad } => random(frames, size.frame_len(), *range_rad, seed),
            Self::Constant { phase_rad } => {
                let phase_rad = finite("initial_phase.constant_rad", *phase_rad)?;
                Ok(vec![phase_rad as f32; size.parameters()])
            }
            Self::Quadratic { focal_length_m } => {
                let focal_length_m = focal_length_m.unwrap_or_else(|| default_focal_length_m(setup));
                if finite("initial_phase.focal_length_m", focal_length_m)? == 0.0 {
                    let allowed = "finite and not 0";
                    let name = "initial_phase.focal_length_m";
                    return Err(Error::OutOfRange { name, value: focal_length_m, allowed });
                }
                Ok(lens(setup, focal_length_m).into_vec().repeat(frames))
            }
            Self::BackPropagated { range_rad } => {
                let image_phase = random(frames, size.frame_len(), *range_rad, seed)?;
                Ok(phase_of_targets(&*problem.body, &image_phase))
            }
            Self::Given(phase) => {
                phase.expect_size("initial_phase", frames * height_px, width_px)?;
                phase.expect_finite("initial_phase")?;
                Ok(phase.values().to_vec())
            }
        }
    }
}

/// Random phase of one frame, uniform in [0, `range_rad`) and drawn row by row from `seed`, as by
/// [`InitialPhase::Random`].
///
/// # Errors
///
/// [`Error::OutOfRange`] when `range_rad` is not between 0 and 2π.
pub fn initial_phase(height_px: usize, width_px: usize, range_rad: f64, seed: u64) -> Result<Plane<f32>> {
    Plane::try_from_vec(height_px, width_px, random(1, height_px * width_px, range_rad, seed)?)
}

/// Random phases of several frames \[rad\]. Each frame uses its own stream of the generator.
pub(super) fn random(frames: usize, frame_len: usize, range_rad: f64, seed: u64) -> Result<Vec<f32>> {
    // The limit is slightly above 2π, so that 2π rounded to f32 is still allowed.
    if !(0.0..=TAU + 1e-6).contains(&range_rad) {
        let allowed = "between 0 and 2π";
        return Err(Error::OutOfRange { name: "initial_phase_range_rad", value: range_rad, allowed });
    }
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut phases = Vec::with_capacity(frames * frame_len);
    for frame in 0..frames {
        interrupt::check();
        random.set_stream(frame as u64);
        random.set_word_pos(0);
        phases.extend((0..frame_len).map(|_| random.random::<f32>() * range_rad as f32));
    }
    Ok(phases)
}

fn lens(setup: &OpticalSetup, focal_length_m: f64) -> Plane<f32> {
    let (height_px, width_px) = (setup.grid().height_px(), setup.grid().width_px());
    let scale = -PI * setup.grid().pixel_pitch_m().powi(2) / (setup.wavelength_m() * focal_length_m);
    let from_middle = |i: usize, side: usize| i as f64 - (side as f64 - 1.0) / 2.0;
    Plane::from_fn(height_px, width_px, |y, x| {
        let r_squared = from_middle(y, height_px).powi(2) + from_middle(x, width_px).powi(2);
        (scale * r_squared).rem_euclid(TAU) as f32
    })
}

fn finite(name: &'static str, value: f64) -> Result<f64> {
    if value.is_finite() { Ok(value) } else { Err(Error::OutOfRange { name, value, allowed: "finite" }) }
}

/// Phases that show the phase of the field that the targets send back to the SLM, with the phase `image_phase` in the
/// image.
fn phase_of_targets(problem: &dyn Project, image_phase: &[f32]) -> Vec<f32> {
    let size = problem.size();
    let mut phases = vec![0.0; size.parameters()];
    for (phase, image_phase) in
        phases.chunks_exact_mut(size.frame_len()).zip(image_phase.chunks_exact(size.frame_len()))
    {
        let mut field = problem.back_propagated(image_phase);
        // The field gets a mean power of 1, as on the modulator, so that the zero order is subtracted in proportion.
        let power: f64 = field.iter().map(|c| f64::from(c.norm_sqr())).sum::<f64>() / size.frame_len() as f64;
        let norm = (1.0 / power.sqrt().max(f64::MIN_POSITIVE)) as f32;
        field.iter_mut().for_each(|c| *c = c.scale(norm));
        let rows = phase.chunks_exact_mut(size.width_px).zip(field.chunks_exact(size.width_px));
        for (y, (phase, field)) in rows.enumerate() {
            interrupt::check();
            problem.slm().phase_of_row(y, field, phase);
        }
    }
    phases
}
