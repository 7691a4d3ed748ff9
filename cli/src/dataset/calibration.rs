//! The command `lightpath dataset calibration`.

use crate::destination::{self, Destination};
use crate::failure::Failure;
use crate::jobs::submission::Submission;
use crate::jobs::{self, progress};
use crate::session::Session;
use clap::Args;
use lightpath::v1::{self, OptimizeHologram, job_spec, optimize_hologram::ImagePlane};
use lightpath::{hologram_result, names};
use std::path::PathBuf;

const PATTERN: Destination =
    Destination { option: "-o", suffix: "-pattern.png", formats: &[("png", "grey levels for the display")] };

/// Compute the hologram of a grid of dots, which is photographed to align the camera.
///
/// The hologram is optimized for the dataset's display, wavelength and distance with the ideal kernel. Display it and
/// photograph it with the camera in its position for the dataset. Give the photograph to lightpath dataset align
/// --dots.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath dataset calibration bench-1 -o dots.png
  lightpath dataset align bench-1 --dots photo-of-dots.png \\
      --picture-before before.png --picture-after after.png")]
pub(crate) struct Calibration {
    /// Name of the dataset
    name: String,

    /// Write the hologram to this file, a grey PNG of levels
    #[arg(short = 'o', value_name = "PHASE.png")]
    pattern: PathBuf,

    /// Optimize for this many steps, 1 to 10000
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..))]
    iterations: u32,

    #[command(flatten)]
    submission: Submission,
}

impl Calibration {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let name = [format!("{}-dots", self.name)];
        let pattern = PATTERN.files(&session.stdout, &self.pattern, &name)?.remove(0);
        let request = v1::GetDatasetRequest { name: names::dataset(&self.name) };
        let dataset = session.client.get_dataset(request).await?;
        let request = v1::CreateCalibrationTargetRequest { display: dataset.display.clone(), picture: None };
        let target = session.client.create_calibration_target(request).await?;
        let kind = job_spec::Kind::OptimizeHologram(OptimizeHologram {
            wavelengths_m: vec![dataset.wavelength_m()],
            display: dataset.display,
            planes: vec![ImagePlane { place: dataset.place, target: target.target.clone(), weight: None }],
            kernel: Some(v1::KernelChoice::ideal()),
            iterations: Some(self.iterations),
            seed: 1,
            ..Default::default()
        });
        let job = self.submission.submit(session, kind, "dots for the alignment", None).await?;
        let [name] = name;
        for job in progress::wait_all(session, vec![(name, job)]).await? {
            if let Ok(result) = hologram_result(&job) {
                for subframe in result.wavelengths.iter().flat_map(|hologram| &hologram.subframes) {
                    destination::save(session, &subframe.pattern, &pattern).await?;
                }
            }
            session.print(&job, |_| {
                format!("hologram of {}×{} dots  {}", target.columns(), target.rows(), destination::shown(&pattern))
            })?;
            jobs::check_success(&[job])?;
        }
        Ok(())
    }
}
