//! Photographs patterns at the bench of a display, by the rig that serves it.
//!
//! The state is saved after each photograph, and a photograph that was asked for has the same id after an interruption. So
//! the rig, which remembers what it has taken, takes nothing twice.

mod bench;
mod exposure;
mod verdict;

use crate::display_setup::DisplaySetup;
use crate::{JobContext, TaskError, TaskOutput};
use bench::Bench;
use lightpath_domain::job::{
    CapturePhotos, CapturePhotosResult, CapturedPhoto, FailureReason, JobEffect, JobResult, NamedPattern, Progress,
    Retaken,
};
use lightpath_media::captures::identity::Brightness;
use lightpath_media::pictures::{self, Hologram};
use serde::{Deserialize, Serialize};
use verdict::{Evidence, Judge};

/// Limit on the photographs of one pattern: what goes wrong so often has a cause at the bench.
const TRIES_MAX: u32 = 6;

/// What an interrupted attempt leaves to the next one.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct Saved {
    /// Photographs that were asked for, for their ids.
    takes: u32,
    /// The exposure that was found or given \[s\].
    exposure_s: Option<f64>,
    /// A shorter one for the present pattern, which saturates the camera \[s\].
    shorter_s: Option<f64>,
    result: CapturePhotosResult,
    /// What is known of the photographs, for the next ones.
    evidence: Vec<Evidence>,
    /// Photographs of the present pattern that were refused.
    tries: u32,
}

pub(super) fn run(context: &JobContext, spec: &CapturePhotos) -> Result<TaskOutput, TaskError> {
    let display = DisplaySetup::read(context, &spec.display, spec.wavelength, spec.distance)?;
    let levels = levels(context, &display, spec)?;
    let saved = context.take_saved_state().and_then(|bytes| serde_json::from_slice::<Saved>(&bytes).ok());
    let mut saved = saved.unwrap_or_default();
    let bench = Bench::of(context, spec)?;
    saved.result.rig = bench.rig().program.clone();
    let mut judge = Judge::of(context, spec, &display)?;
    judge.remember(context, &saved)?;
    if bench.rig().has_shutter && saved.result.black_level.is_none() {
        saved.result.black_level = Some(bench.black_level(&mut saved, &levels[0])?);
    }
    if saved.exposure_s.is_none() {
        saved.exposure_s = Some(exposure::found(context, &bench, &mut saved, spec, &levels[0])?);
    }
    while saved.result.photos.len() < spec.patterns.len() {
        let index = saved.result.photos.len();
        context.step_to_keep(progress(index, spec), || state(&saved))?;
        photograph(context, (&bench, &mut judge), &mut saved, spec, (&levels, index))?;
    }
    context.report(progress(spec.patterns.len(), spec))?;
    Ok(TaskOutput { result: JobResult::CapturePhotos(saved.result), effect: JobEffect::None })
}

/// Takes one photograph of a pattern, and keeps it if it is of that pattern.
fn photograph(
    context: &JobContext,
    (bench, judge): (&Bench<'_>, &mut Judge),
    saved: &mut Saved,
    spec: &CapturePhotos,
    (levels, index): (&[Shown], usize),
) -> Result<(), TaskError> {
    let Some(exposure_s) = saved.shorter_s.or(saved.exposure_s) else { return Err(TaskError::Stopped) };
    let id = &spec.patterns[index].id;
    let taken = match bench.taken(saved, &levels[index], exposure_s, levels.get(index + 1))? {
        Ok(taken) => taken,
        Err(failed) => return refused(saved, id, failed),
    };
    let photo = bench.read(&taken)?;
    let brightness = Brightness::of(&photo.light);
    if let Some(shorter_s) = exposure::shorter(bench, spec, exposure_s, brightness) {
        saved.shorter_s = Some(shorter_s);
        return Ok(());
    }
    match judge.verdict(context, index, (&levels[index], exposure_s), &taken, (photo, brightness))? {
        Ok(evidence) => {
            saved.result.photos.push(CapturedPhoto {
                id: id.clone(),
                photo: taken.photo,
                frame: taken.frame,
                exposure_time_ms: taken.exposure_time_ms,
                exposure_s,
                correlation: evidence.own,
                other_correlation: evidence.other,
                temperature_c: taken.temperature_c,
            });
            saved.evidence.push(evidence);
            (saved.tries, saved.shorter_s) = (0, None);
            Ok(())
        }
        Err(reason) => refused(saved, id, reason),
    }
}

/// Notes a photograph that cannot be used. Fails if that was so too often.
fn refused(saved: &mut Saved, id: &str, reason: String) -> Result<(), TaskError> {
    tracing::warn!(pattern = id, reason, "a photograph is taken again");
    saved.tries += 1;
    saved.result.retaken.push(Retaken { id: id.to_owned(), reason });
    if saved.tries < TRIES_MAX {
        return Ok(());
    }
    let of_it = saved.result.retaken.iter().filter(|retaken| retaken.id == id);
    let reasons: Vec<&str> = of_it.map(|retaken| retaken.reason.as_str()).collect();
    let message =
        format!("none of {TRIES_MAX} photographs of pattern \"{id}\" can be used; they are: {}", reasons.join("; "));
    Err(TaskError::permanent(FailureReason::PhotoMismatch, message))
}

/// A pattern as the rig shows it.
struct Shown {
    /// Artifact digest of the levels as a grey PNG.
    digest: String,
    /// SHA-256 of the levels.
    levels_sha256: String,
}

/// The patterns as levels. Those that are phases become levels by the display's response.
fn levels(context: &JobContext, display: &DisplaySetup, spec: &CapturePhotos) -> Result<Vec<Shown>, TaskError> {
    let bit_depth = display.declared.bit_depth;
    let shown = |named: &NamedPattern| {
        let file = context.read_artifact(&named.pattern)?;
        let hologram = pictures::hologram(&file, bit_depth, display.height_px(), display.width_px());
        let unreadable =
            |error| TaskError::permanent(FailureReason::InvalidPicture, format!("pattern \"{}\": {error}", named.id));
        let levels = match hologram.map_err(unreadable)? {
            Hologram::Levels(levels) => levels,
            Hologram::Phase(phase) => display.levels_of(&phase)?,
        };
        let levels_sha256 = bench::levels_sha256(&levels, bit_depth);
        let digest = context.put_artifact(pictures::levels_png(&levels, bit_depth)?)?;
        Ok(Shown { digest, levels_sha256 })
    };
    spec.patterns.iter().map(shown).collect()
}

fn state(saved: &Saved) -> Vec<u8> {
    // All parts are valid JSON. If this failed, the next attempt would start from the beginning.
    serde_json::to_vec(saved).unwrap_or_default()
}

fn progress(done: usize, spec: &CapturePhotos) -> Progress {
    let steps_total = spec.patterns.len() as u32;
    Progress { stage: "photograph".to_owned(), step: done as u32, steps_total, loss: None, eta_s: None }
}
