//! The bench as the job sees it: asks the rig for photographs, and reads them.

use super::{Saved, Shown};
use crate::{JobContext, TaskError};
use lightpath_domain::dataset::Encoding;
use lightpath_domain::digests::sha256_hex;
use lightpath_domain::job::{CapturePhotos, FailureReason};
use lightpath_media::pictures::{self, Photo, PhotoReading, PictureError};
use lightpath_optics::Plane;
use lightpath_rigs::{RigDescription, Take, TakeError, Taken};
use std::time::Duration;

/// Time for a photograph besides settling and exposure: carrying the files, and a person who works at the bench.
const PATIENCE: Duration = Duration::from_secs(120);
/// Largest distance between the places of the job and of the rig's camera \[m\].
const PLACE_TOLERANCE_M: f64 = 0.5e-3;

/// The rig of the job's display.
pub(super) struct Bench<'a> {
    context: &'a JobContext,
    spec: &'a CapturePhotos,
    rig: RigDescription,
}

impl<'a> Bench<'a> {
    /// The rig, if it has the light and the place of the job.
    pub(super) fn of(context: &'a JobContext, spec: &'a CapturePhotos) -> Result<Self, TaskError> {
        let absent = || TaskError::transient(FailureReason::RigAbsent, TakeError::Absent(spec.display.clone()));
        let rig = context.rigs().of(&spec.display).ok_or_else(absent)?;
        let refused = |message: String| {
            let message = format!("the rig of displays/{}: {message}", spec.display);
            TaskError::permanent(FailureReason::RigFailed, message)
        };
        if (rig.distance.m() - spec.distance.m()).abs() > PLACE_TOLERANCE_M {
            return Err(refused(format!(
                "its camera is focused at {}, but the job is for {}; focus it there, and say so in the rig's settings, \
                 or submit the job for that place",
                rig.distance, spec.distance
            )));
        }
        if !rig.wavelengths.contains(&spec.wavelength) {
            return Err(refused(format!("it has no light of {}", spec.wavelength)));
        }
        let camera = rig.camera;
        if let Some(exposure_s) = spec.exposure_s
            && !(camera.exposure_min_s..=camera.exposure_max_s).contains(&exposure_s)
        {
            return Err(refused(format!(
                "the exposure is {exposure_s} s, but it allows {} s to {} s",
                camera.exposure_min_s, camera.exposure_max_s
            )));
        }
        Ok(Self { context, spec, rig })
    }

    pub(super) fn rig(&self) -> &RigDescription {
        &self.rig
    }

    /// Photographs a pattern. The inner error says why the rig took none, and that another try may succeed.
    pub(super) fn taken(
        &self,
        saved: &mut Saved,
        shown: &Shown,
        exposure_s: f64,
        next: Option<&Shown>,
    ) -> Result<Result<Taken, String>, TaskError> {
        self.ask(saved, shown, exposure_s, (false, next))
    }

    /// Mean of a photograph with the shutter closed, as a part of full scale.
    pub(super) fn black_level(&self, saved: &mut Saved, shown: &Shown) -> Result<f64, TaskError> {
        let exposure_s = self.spec.exposure_s.unwrap_or(self.rig.camera.exposure_min_s);
        let taken = self.ask(saved, shown, exposure_s, (true, Some(shown)))?.map_err(failed)?;
        let light = self.read(&taken)?.light;
        Ok(light.values().iter().map(|&value| f64::from(value)).sum::<f64>() / light.values().len() as f64)
    }

    fn ask(
        &self,
        saved: &mut Saved,
        shown: &Shown,
        exposure_s: f64,
        (dark, next): (bool, Option<&Shown>),
    ) -> Result<Result<Taken, String>, TaskError> {
        // The number is saved only with the photograph, so that a request is repeated with its id after an interruption.
        let take = Take {
            id: format!("{}-{}", self.context.job_id(), saved.takes),
            pattern: shown.digest.clone(),
            exposure_s,
            exposures: self.spec.exposures,
            dark,
            next_pattern: next.map(|next| next.digest.clone()),
            wavelength_m: self.spec.wavelength.m(),
        };
        saved.takes += 1;
        let frames = f64::from(take.exposures + self.rig.camera.exposure_delay_frames + 2);
        let wait_max = PATIENCE + Duration::from_secs_f64(self.rig.slm.settling_time_s + frames * exposure_s);
        let asked = self.context.rigs().photograph(&self.spec.display, &take, wait_max);
        match self.context.wait_unless_stopped(asked)? {
            Ok(taken) => Ok(Ok(taken)),
            Err(TakeError::Failed { message, retryable: true, .. }) => {
                Ok(Err(format!("could not be taken: {message}")))
            }
            Err(silent @ TakeError::Silent { .. }) => Ok(Err(format!("could not be taken: {silent}"))),
            Err(error @ TakeError::Absent(_)) => Err(TaskError::transient(FailureReason::RigAbsent, error)),
            Err(error @ TakeError::Failed { .. }) => Err(TaskError::permanent(FailureReason::RigFailed, error)),
        }
    }

    /// Reads a photograph.
    pub(super) fn read(&self, taken: &Taken) -> Result<Photo, TaskError> {
        let file = self.context.read_artifact(&taken.photo)?;
        let photo = photo(&file)?;
        let (width_px, height_px) = (photo.light.width_px(), photo.light.height_px());
        let camera = self.rig.camera;
        if (width_px, height_px) != (camera.width_px as usize, camera.height_px as usize) {
            let message = format!(
                "the rig of displays/{} sent a photograph of {width_px}×{height_px} px, but its camera has {}×{} px",
                self.spec.display, camera.width_px, camera.height_px
            );
            return Err(TaskError::permanent(FailureReason::RigFailed, message));
        }
        Ok(photo)
    }
}

impl Drop for Bench<'_> {
    /// Lets the rig go into its safe state, however the attempt ends.
    fn drop(&mut self) {
        self.context.rigs().rest(&self.spec.display);
    }
}

/// SHA-256 of levels, row by row: a byte for each, or two, the lower first, if levels have more than 8 bits.
pub(super) fn levels_sha256(levels: &Plane<u16>, bit_depth: u32) -> String {
    let levels = levels.values().iter();
    let bytes: Vec<u8> = match bit_depth {
        ..=8 => levels.map(|&level| level as u8).collect(),
        _ => levels.flat_map(|level| level.to_le_bytes()).collect(),
    };
    sha256_hex(&bytes)
}

/// The light of a photograph: white is the camera's full scale.
pub(super) fn photo(file: &[u8]) -> Result<Photo, PictureError> {
    pictures::photo(file, &PhotoReading { encoding: Encoding::Linear, bit_depth: 0, black_level: 0.0 })
}

/// The failure of a job whose first photographs could not be taken.
pub(super) fn failed(reason: String) -> TaskError {
    TaskError::transient(FailureReason::RigFailed, format!("a photograph {reason}"))
}
