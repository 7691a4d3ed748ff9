//! `lightpath simulate`

use super::arguments::Optics;
use super::failure::Failure;
use super::session::Session;
use super::submission::Submission;
use super::{destination, job_text, progress};
use clap::Args;
use lightpath::v1::{SimulateCapture, job_spec};
use lightpath::{capture_result, names};
use std::path::PathBuf;

/// Photograph a hologram on a simulated display.
///
/// Works only for displays that were declared with --simulated or --simulated-seed. The photograph has the display's
/// imperfections and the camera's noise, and can be added to a dataset.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath simulate --display toy --distance 150mm --phase p01.png -o c01.png
  lightpath dataset add bench-1 --phase p01.png --photo c01.png")]
pub(crate) struct Simulate {
    #[command(flatten)]
    optics: Optics,

    /// Photograph this hologram: a grey PNG of levels with the display's size
    #[arg(long, value_name = "FILE.png")]
    phase: PathBuf,

    /// Write the photograph to this file: an 8-bit grey PNG, linear light
    #[arg(short = 'o', value_name = "PHOTO.png")]
    photo: PathBuf,

    /// Set the seed of the camera's noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    /// Set the time since the bench was set up in hours, for benches that drift
    #[arg(long, value_name = "HOURS", default_value_t = 0.0)]
    hours: f64,

    #[command(flatten)]
    submission: Submission,
}

impl Simulate {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        let name = destination::name_of(&self.phase);
        let photo = destination::files("-o", &self.photo, std::slice::from_ref(&name), "-photo.png")?.remove(0);
        destination::check_distinct([self.phase.as_path()].into_iter(), [photo.as_path()].into_iter())?;
        let kind = job_spec::Kind::SimulateCapture(SimulateCapture {
            display: names::display(&self.optics.display),
            wavelength_m: self.optics.wavelength_m(),
            distance_m: self.optics.distance,
            phase: session.client.upload_file(&self.phase).await?,
            seed: self.seed,
            elapsed_s: 3600.0 * self.hours,
        });
        let job = self.submission.submit(session, kind, None).await?;
        for job in progress::wait_all(session, vec![(name, job)]).await? {
            if let Ok(result) = capture_result(&job) {
                session.client.download_to(&result.photo, &photo).await?;
            }
            session.print(&job, |_| format!("photograph  {}", photo.display()))?;
            job_text::check_success(&[job])?;
        }
        Ok(())
    }
}
