//! The search for an exposure.
//!
//! Light is proportional to the exposure, so two or three photographs are enough, unless the first ones are black or
//! saturated: then the next one has a quarter or eight times of its exposure.

use super::bench::{Bench, failed};
use super::{Saved, Shown, progress, state};
use crate::{JobContext, TaskError};
use lightpath_domain::job::{CapturePhotos, FailureReason};
use lightpath_media::captures::identity::{Brightness, SATURATED_MAX};

/// What the brightest thousandth of the photograph is to reach, as a part of full scale. Other patterns may be brighter.
const BRIGHTEST: f64 = 0.75;
/// Accepted range of it.
const ACCEPTED: std::ops::RangeInclusive<f64> = 0.6..=0.88;
/// Brightest value below which a photograph tells only that the exposure is far too short.
const DARK: f64 = 0.05;
/// Limit on the photographs of the search.
const TRIES_MAX: u32 = 12;
/// First exposure, if the camera allows it \[s\].
const FIRST_S: f64 = 0.01;

/// The exposure for the patterns of a job \[s\]: what it asks for, or what a search with the first pattern finds.
pub(super) fn found(
    context: &JobContext,
    bench: &Bench<'_>,
    saved: &mut Saved,
    spec: &CapturePhotos,
    shown: &Shown,
) -> Result<f64, TaskError> {
    if let Some(exposure_s) = spec.exposure_s {
        return Ok(exposure_s);
    }
    let camera = bench.rig().camera;
    let mut exposure_s = FIRST_S.clamp(camera.exposure_min_s, camera.exposure_max_s);
    let mut last = None;
    for _ in 0..TRIES_MAX {
        context.step_to_keep(progress(0, spec), || state(saved))?;
        let taken = bench.taken(saved, shown, exposure_s, Some(shown))?.map_err(failed)?;
        let brightness = Brightness::of(&bench.read(&taken)?.light);
        if brightness.saturated <= SATURATED_MAX && ACCEPTED.contains(&brightness.brightest) {
            return Ok(exposure_s);
        }
        let next_s = next(exposure_s, brightness).clamp(camera.exposure_min_s, camera.exposure_max_s);
        if next_s == exposure_s {
            // The camera allows no better one. A photograph that shows something can be used.
            if brightness.saturated <= SATURATED_MAX && !brightness.is_black() {
                return Ok(exposure_s);
            }
            return Err(impossible(spec, exposure_s, brightness));
        }
        last = Some((exposure_s, brightness));
        exposure_s = next_s;
    }
    let (exposure_s, brightness) =
        last.unwrap_or((exposure_s, Brightness { brightest: 0.0, saturated: 0.0, light: 0.0 }));
    Err(impossible(spec, exposure_s, brightness))
}

/// A shorter exposure for a pattern that saturates the camera \[s\]; `None`: it does not, or the exposure is given.
pub(super) fn shorter(bench: &Bench<'_>, spec: &CapturePhotos, exposure_s: f64, brightness: Brightness) -> Option<f64> {
    let shorter_s = next(exposure_s, brightness).max(bench.rig().camera.exposure_min_s);
    let may_be = spec.exposure_s.is_none() && brightness.saturated > SATURATED_MAX;
    (may_be && shorter_s < exposure_s).then_some(shorter_s)
}

/// The exposure to try after one \[s\].
fn next(exposure_s: f64, brightness: Brightness) -> f64 {
    let Brightness { brightest, saturated, .. } = brightness;
    if saturated > SATURATED_MAX {
        exposure_s / if saturated > 0.05 { 4.0 } else { 1.6 }
    } else if brightest < DARK {
        8.0 * exposure_s
    } else {
        exposure_s * BRIGHTEST / brightest
    }
}

fn impossible(spec: &CapturePhotos, exposure_s: f64, brightness: Brightness) -> TaskError {
    let Brightness { brightest, saturated, .. } = brightness;
    let fix = if saturated > SATURATED_MAX {
        "lower the power of the laser, or put a filter before the camera"
    } else {
        "see whether the light is on, the shutter is open and the camera sees the picture"
    };
    let message = format!(
        "displays/{}: no exposure suits its camera: with {exposure_s:.2e} s the brightest thousandth has {:.1} % of full \
         scale, and {:.1} % of the pixels are saturated; {fix}",
        spec.display,
        100.0 * brightest,
        100.0 * saturated
    );
    TaskError::permanent(FailureReason::RigFailed, message)
}
