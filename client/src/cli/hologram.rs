//! `lightpath hologram …`

mod outputs;
mod pictures;
mod results;
mod work;

use super::failure::{Failure, TargetFailure};
use super::job_text;
use super::progress::{Progress, WATCHES_MAX, goes_on, or_interrupted};
use super::session::{Session, say};
use super::show;
use super::submission::{Submission, watch_hint};
use super::table::Table;
use clap::{Args, Subcommand};
use futures::{StreamExt as _, TryStreamExt as _};
use lightpath::v1::{self, job_spec};
use lightpath::{hologram_result, names};
use outputs::{Files, Outputs};
use pictures::Pictures;
use results::{Item, results};
use std::collections::BTreeSet;
use std::fs::File;
use std::path::PathBuf;
use work::Work;

/// What can be done with holograms.
// The help of each is with its arguments: a comment here would hide all but its first line.
#[derive(Debug, Subcommand)]
pub(crate) enum HologramCommand {
    Optimize(Box<Optimize>),
    Save(Save),
}

/// Find the phases that make a display show target pictures.
///
/// Each target becomes a job of its own; several --plane make one job of several pictures at several distances, and several
/// wavelengths give each job one hologram for each of them. With --wait or an output file the command waits, with a bar
/// for each job, saves the files and prints how good the holograms are; otherwise it prints the jobs and ends.
///
/// Quality is the peak signal-to-noise ratio in the region of interest, as three detectors see it: `point` at
/// the sample points, `pixel` as a camera of the same pitch integrates, `supersampled` as an eye sees.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath hologram optimize indian_head.png --display lab-2 --distance 150mm \\
      -o phase.png
  lightpath hologram optimize targets/*.png --display lab-2 --distance 150mm \\
      -o holograms/
  lightpath hologram optimize a.png b.png --display lab-2 --distance 150mm \\
      -o {name}-phase.png --reconstruction {name}-seen.png --npy {name}.npy

  A focal stack: one hologram that shows three pictures at three distances
    lightpath hologram optimize --display lab-2 -o phase.png \\
        --plane 140mm=near.png --plane 150mm=middle.png --plane 160mm=far.png

  A colour picture with depth: three wavelengths, and a depth map whose white
  is at the first distance and whose black is at the last
    lightpath hologram optimize photo.png --display rgb-1 \\
        --wavelength 638nm,520nm,450nm --distance 140mm,150mm,160mm \\
        --depth-map depth.png -o holograms/ --reconstruction holograms/

  Less speckle: the mean of eight phases, shown faster than the eye can follow
    lightpath hologram optimize photo.png --display lab-2 --distance 150mm \\
        --frames 8 --phase-range 6.2831853 -o frames/

  For the 16 levels of an old modulator: the last third of the steps goes on
  through its levels
    lightpath hologram optimize photo.png --display lab-4bit --distance 150mm \\
        --quantization-aware -o phase.png

Methods:
  lbfgs  follows the gradient and its curvature: by far the best picture for
         the time; every option works with it
  adam   follows the gradient, as most published holograms do
  gerchberg-saxton, gs
         replaces amplitudes on either side in turn; a quick draft
  weighted-gerchberg-saxton, wgs
         the same with weights that raise what is too dark
  double-phase, dpac
         no iterations, one pass; needs optics that filter away its chequerboard

Output files: one file where there is one target; a folder (made where it is missing and ends with /), which \
then gets NAME-phase.png, NAME-phase.npy and NAME-reconstruction.png; or a pattern, where {name} stands for \
the target's file name without its extension. Where a job has several wavelengths, frames or planes, each of its \
files has them in its name: phase-638nm-frame2.png, seen-150mm.png. Three wavelengths are reconstructed as colours.

With --output json each job is printed as one line of JSON.")]
pub(crate) struct Optimize {
    #[command(flatten)]
    pictures: Pictures,

    /// Light transport to optimize through: active, ideal or a version number
    ///
    /// [default: the active version where there is one, else ideal]
    #[arg(long, value_name = "KERNEL", default_value = "", hide_default_value = true)]
    kernel: String,

    /// Wait for the jobs; implied by an output file
    #[arg(long)]
    wait: bool,

    #[command(flatten)]
    work: Work,

    #[command(flatten)]
    submission: Submission,

    #[command(flatten)]
    outputs: Outputs,
}

/// Save the files of an optimization, waiting for it where it still runs.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath hologram save 01939a5e-7c1b-7d52-9b7e-0d6f3a1c2b4e -o phase.png")]
pub(crate) struct Save {
    /// Id of the job
    job: String,

    #[command(flatten)]
    outputs: Outputs,
}

impl HologramCommand {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        match self {
            Self::Optimize(optimize) => optimize.run(session).await,
            Self::Save(save) => save.run(session).await,
        }
    }
}

impl Optimize {
    async fn run(self, session: &Session) -> Result<(), Failure> {
        self.pictures.check()?;
        let names = self.pictures.names();
        let inputs = self.inputs();
        let files = self.outputs.files(&names, &inputs)?;
        check_readable(&inputs)?;
        let items = self.submit(session, names, files).await?;
        if !(self.wait || self.outputs.any()) {
            return print_submitted(session, &items);
        }
        finish(session, items).await
    }

    /// Files that are read.
    fn inputs(&self) -> Vec<PathBuf> {
        self.pictures.files().chain(self.work.files()).cloned().collect()
    }

    async fn submit(&self, session: &Session, names: Vec<String>, files: Vec<Files>) -> Result<Vec<Item>, Failure> {
        let mut items: Vec<Item> = Vec::new();
        let several = names.len() > 1;
        for (i, (name, files)) in names.into_iter().zip(files).enumerate() {
            let submitting = async {
                let spec = v1::OptimizeHologram { kernel: self.kernel.clone(), ..v1::OptimizeHologram::default() };
                let spec = self.pictures.fill(session, i, spec).await?;
                let spec = self.work.fill(session, spec).await?;
                let kind = job_spec::Kind::OptimizeHologram(spec);
                self.submission.submit(session, kind, several.then_some(name.as_str())).await
            };
            let ids: Vec<String> = items.iter().map(|item| names::id(&item.job.name).to_owned()).collect();
            let refused = |error| {
                let goes_on = (!ids.is_empty()).then(|| format!("submitted before that: the {}", goes_on(&ids)));
                Failure::Target(TargetFailure { target: self.pictures.first_file(i), error, goes_on })
            };
            let job = or_interrupted(&ids, submitting).await.map_err(|failure| match failure {
                Failure::Client(error) => refused(error),
                other => other,
            })?;
            items.push(Item { name, job, files });
        }
        Ok(items)
    }
}

impl Save {
    async fn run(self, session: &Session) -> Result<(), Failure> {
        if !self.outputs.any() {
            return Err(Failure::Usage("nothing to save: name a file with -o, --npy or --reconstruction".to_owned()));
        }
        let name = names::id(&self.job).to_owned();
        let files = self.outputs.files(std::slice::from_ref(&name), &[])?.remove(0);
        let job = session.client.get_job(v1::GetJobRequest { name: names::job(&self.job) }).await?;
        finish(session, vec![Item { name, job, files }]).await
    }
}

/// A mistyped name is told before the targets in front of it become jobs.
fn check_readable(targets: &[PathBuf]) -> Result<(), Failure> {
    for path in targets {
        File::open(path).map_err(|source| lightpath::Error::File { action: "read", path: path.clone(), source })?;
    }
    Ok(())
}

/// Waits for all jobs, saves the files of each as it succeeds, and prints how good they are.
async fn finish(session: &Session, items: Vec<Item>) -> Result<(), Failure> {
    let ids: Vec<String> = items.iter().map(|item| names::id(&item.job.name).to_owned()).collect();
    let progress = Progress::new(items.iter().map(|item| item.name.as_str()));
    let waits = items.into_iter().map(async |item| {
        let job = progress.wait(session, &item.name, &item.job.name, |_| ()).await?;
        if let Ok(result) = hologram_result(&job) {
            item.files.save(session, result).await?;
        }
        Ok::<Item, Failure>(Item { job, ..item })
    });
    let all = futures::stream::iter(waits).buffered(WATCHES_MAX).try_collect();
    let items: Vec<Item> = or_interrupted(&ids, all).await?;
    for item in &items {
        session.print_json_line(&item.job)?;
    }
    session.print_text(&results(&items))?;
    say_warnings(&items);
    job_text::check_success(&items.into_iter().map(|item| item.job).collect::<Vec<_>>())
}

/// What to beware of, once for all jobs, wavelengths and planes that have the same warning. That of a single one is among
/// its facts.
fn say_warnings(items: &[Item]) {
    let results = items.iter().filter_map(|item| hologram_result(&item.job).ok());
    let planes = results.flat_map(|result| &result.wavelengths).flat_map(|wavelength| &wavelength.planes);
    let reports: Vec<_> = planes.filter_map(|plane| plane.propagation.as_ref()).collect();
    if reports.len() > 1 {
        let warnings = reports.iter().flat_map(|report| &report.warnings);
        let once: BTreeSet<String> = warnings.map(|it| format!("warning {}: {}", it.code, it.text)).collect();
        once.iter().for_each(|warning| say(warning));
    }
}

fn print_submitted(session: &Session, items: &[Item]) -> Result<(), Failure> {
    let mut table = Table::new(&["target", "job", "kernel", "state"]);
    for item in items {
        session.print_json_line(&item.job)?;
        let id = names::id(&item.job.name).to_owned();
        table.row([
            item.name.clone(),
            id,
            show::kernel_versions(&item.job.kernel_versions),
            job_text::state(&item.job),
        ]);
    }
    session.print_text(&table.text())?;
    if let [item] = items {
        say(&watch_hint(&item.job));
    }
    Ok(())
}
