//! Jobs that photograph a hologram on a simulated display, and the command `lightpath simulate`.

use crate::arguments::Optics;
use crate::destination::{self, Destination};
use crate::failure::Failure;
use crate::jobs::submission::{Submission, label_of, submit_target};
use crate::jobs::{self, JobKind, progress};
use crate::session::Session;
use crate::table::Facts;
use crate::{inputs, propagation_text, show};
use clap::Args;
use lightpath::v1::{Job, Place, SimulateCapture, job_spec};
use lightpath::{capture_result, names};
use std::path::PathBuf;

const PHOTO: Destination =
    Destination { option: "-o", suffix: ".png", formats: &[("png", "8-bit grey levels, linear light")] };

/// Photograph holograms on a simulated display.
///
/// Works only for displays that were declared with --simulated or --simulated-seed. The photographs have the display's
/// imperfections and the camera's noise, and can be added to a dataset.
#[derive(Debug, Args)]
#[command(
    override_usage = "lightpath simulate [OPTIONS] --display <ID> --distance <LENGTH>\n           --pattern <FILE>... -o <PHOTO.png>"
)]
#[command(after_long_help = "\
Examples:
  lightpath simulate --display toy --distance 150mm --pattern p01.png -o c01.png
  lightpath dataset add bench-1 --pattern p01.png --photo c01.png

  All holograms of a folder, for lightpath dataset add --patterns --photos
    lightpath simulate --display toy --distance 150mm --pattern holograms/ \\
        -o photos/

Output files: a file for a single hologram; a folder (a missing one that ends with / is created), in which each \
photograph has the name of its hologram; a pattern in which {name} stands for that name without its extension; or - for \
standard output.")]
pub(crate) struct Simulate {
    #[command(flatten)]
    optics: Optics,

    /// Photograph these patterns, which have the display's size: grey PNGs or BMPs of levels, or .npy files of the phase
    /// in radians (floats), such as hologram optimize -o phase.npy writes; a folder stands for all PNGs in it. --phase is
    /// the same option
    #[arg(long = "pattern", alias = "phase", value_name = "FILE", required = true, num_args = 1..)]
    patterns: Vec<PathBuf>,

    /// Write the photographs here: 8-bit grey PNGs, linear light
    #[arg(short = 'o', value_name = "PHOTO.png")]
    photo: PathBuf,

    /// Set the seed of the camera's noise for the first photograph; each further photograph takes the next seed
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,

    /// Set the time since the bench was set up in hours, for benches that drift
    #[arg(long, value_name = "HOURS", default_value_t = 0.0)]
    hours: f64,

    #[command(flatten)]
    submission: Submission,
}

impl Simulate {
    pub(crate) async fn run(mut self, session: &Session) -> Result<(), Failure> {
        self.patterns = inputs::expanded(&self.patterns, inputs::HOLOGRAMS)?;
        inputs::check_readable(&self.patterns)?;
        let names: Vec<String> = self.patterns.iter().map(|pattern| destination::name_of(pattern)).collect();
        let photos = PHOTO.files(&session.stdout, &self.photo, &names)?;
        let outputs = photos.iter().map(PathBuf::as_path);
        destination::check_distinct(self.patterns.iter().map(PathBuf::as_path), outputs)?;
        let submitted = self.submit(session, &names).await?;
        let jobs = progress::wait_all(session, names.into_iter().zip(submitted).collect()).await?;
        let mut facts = Facts::default();
        for (job, photo) in jobs.iter().zip(&photos) {
            if let Ok(result) = capture_result(job) {
                destination::save(session, &result.photo, photo).await?;
                facts.add("photograph", destination::shown(photo));
            }
        }
        session.print_jobs(&jobs, &facts.text())?;
        jobs::check_success(&jobs)
    }

    async fn submit(&self, session: &Session, names: &[String]) -> Result<Vec<Job>, Failure> {
        let mut jobs: Vec<Job> = Vec::new();
        for ((pattern, name), number) in self.patterns.iter().zip(names).zip(0..) {
            let submitting = async {
                let kind = job_spec::Kind::SimulateCapture(SimulateCapture {
                    display: names::display(&self.optics.display),
                    wavelength_m: self.optics.wavelength_m(),
                    place: Some(Place::at_m(self.optics.distance)),
                    pattern: session.upload(pattern).await?,
                    seed: self.seed.wrapping_add(number),
                    elapsed_s: 3600.0 * self.hours,
                });
                let suffix = (names.len() > 1).then_some(name.as_str());
                self.submission.submit(session, kind, &label_of(pattern), suffix).await
            };
            let job = submit_target(pattern, &jobs, submitting).await?;
            jobs.push(job);
        }
        Ok(jobs)
    }
}

impl JobKind for SimulateCapture {
    fn title(&self) -> (&'static str, &str) {
        ("simulate capture", names::id(&self.display))
    }

    fn spec_facts(&self, _: &Job, facts: &mut Facts) {
        facts.add("display", names::id(&self.display));
        facts.add("optics", show::optics(self.wavelength_m(), self.place.as_ref()));
        facts.add("pattern", &self.pattern);
    }

    fn result_facts(&self, job: &Job, facts: &mut Facts) -> lightpath::Result<String> {
        let result = capture_result(job)?;
        propagation_text::add(result.propagation.as_ref(), facts);
        facts.add("photograph", &result.photo);
        Ok(String::new())
    }
}
