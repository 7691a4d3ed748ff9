//! Jobs that optimize holograms, and the commands `lightpath hologram optimize` and `save`.

mod comparison;
mod evaluation;
mod optimization;
mod outputs;
mod pictures;
mod quality;
mod results;

use crate::failure::Failure;
use crate::identifiers::job_names;
use crate::jobs::progress::{Awaited, Progress, WATCHES_MAX, or_interrupted};
use crate::jobs::submission::{Submission, submit_target, watch_hint};
use crate::jobs::{self, JobKind};
use crate::kernel_choice::{KernelChoice, used};
use crate::session::{Session, print_note};
use crate::table::{Facts, Table};
use crate::{inputs, show};
use clap::Args;
pub(crate) use evaluation::Evaluate;
use futures::{StreamExt as _, TryStreamExt as _};
use lightpath::v1::{self, Job, OptimizeHologram, job_spec};
use lightpath::{Words as _, hologram_result, names};
use optimization::OptimizationOptions;
use outputs::{Files, Outputs};
use pictures::Pictures;
use results::{Item, results};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Compute the phases that make a display show target pictures.
///
/// Each target becomes a job of its own. Several --plane options make one job that shows several pictures at several
/// distances. With several wavelengths each job computes one hologram per wavelength. With --wait or an output file the
/// command waits with a progress bar for each job, saves the files and prints the quality of the holograms. Otherwise
/// it prints the jobs and ends.
///
/// The printed quality is the peak signal-to-noise ratio (PSNR) in the region of interest for three detectors: `point`
/// sees only the sample points, `pixel` integrates over each pixel like a camera of the same pitch, `supersampled` also
/// sees between the sample points like an eye.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath hologram optimize indian_head.png --display lab-2 --distance 150mm \\
      -o pattern.png
  lightpath hologram optimize targets/*.png --display lab-2 --distance 150mm \\
      -o holograms/
  lightpath hologram optimize targets/ --display lab-2 --distance 150mm \\
      -o 'holograms/{name}.png'
  lightpath hologram optimize a.png b.png --display lab-2 --distance 150mm \\
      -o {name}-pattern.png --reconstruction {name}-seen.png --npy {name}.npy

  A focal stack: one hologram that shows three pictures at three distances
    lightpath hologram optimize --display lab-2 -o pattern.png \\
        --plane 140mm=near.png --plane 150mm=middle.png --plane 160mm=far.png

  A colour picture with depth: three wavelengths, and a depth map in which
  white is at the first distance and black at the last
    lightpath hologram optimize photo.png --display rgb-1 \\
        --wavelength 638nm,520nm,450nm --distance 140mm,150mm,160mm \\
        --depth-map depth.png -o holograms/ --reconstruction holograms/

  Less speckle: eight phases shown so fast that the eye sees their mean
    lightpath hologram optimize photo.png --display lab-2 --distance 150mm \\
        --subframes 8 --phase-range 6.2831853 -o fast/

  A display with only 16 levels: the last third of the steps optimizes with
  these levels
    lightpath hologram optimize photo.png --display lab-4bit --distance 150mm \\
        --quantization-aware -o pattern.png

Methods:
  lbfgs  follows the gradient and its curvature: by far the best picture for
         the time; all options except --learning-rate work with it
  adam   follows the gradient; most published holograms use it
  gerchberg-saxton, gs
         replaces the amplitudes at the SLM and in the image in turn; a quick
         draft
  weighted-gerchberg-saxton, wgs
         gerchberg-saxton with weights that brighten what is too dark
  double-phase, dpac
         one pass without iterations; needs optics that filter out its
         chequerboard

Output files: a file for a single target; a folder (a missing one that ends with / is created), which gets \
NAME-pattern.png, NAME-phase.npy and NAME-reconstruction.png; or a pattern in which {name} stands for the target's \
file name without its extension. If a job has several wavelengths, subframes or planes, the names of its files \
contain them: pattern-638nm-subframe2.png, seen-150mm.png. Reconstructions of three wavelengths are colour pictures.

With -o - the file of a single target goes to standard output, and all messages go to standard error.

With --output json the command prints the job, or for several targets one document with all jobs; with --output jsonl \
each job is a line.")]
pub(crate) struct Optimize {
    #[command(flatten)]
    pictures: Pictures,

    /// Optimize for this kernel: active, ideal, the number or name of a version, or an alias [default: the active version
    /// if there is one, else ideal]
    #[arg(long, value_name = "KERNEL", default_value = "", hide_default_value = true)]
    kernel: String,

    /// Wait until the jobs have ended; implied by an output file
    #[arg(long)]
    wait: bool,

    #[command(flatten)]
    optimization: OptimizationOptions,

    #[command(flatten)]
    submission: Submission,

    #[command(flatten)]
    outputs: Outputs,
}

/// Save the files of hologram jobs; wait for their end if they are still queued or running.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath hologram save 01939a5e-7c1b -o pattern.png
  lightpath hologram save 01939a5e-7c1b 01939a60 -o holograms/
  lightpath hologram save 01939a5e-7c1b -o - | my-display

Of several jobs the files are named after the jobs' ids; {name} in a pattern stands for the id.")]
pub(crate) struct Save {
    /// Save the files of the jobs with these ids, or beginnings of ids
    #[arg(required = true, value_name = "JOB")]
    jobs: Vec<String>,

    #[command(flatten)]
    outputs: Outputs,
}

impl Optimize {
    pub(crate) async fn run(mut self, session: &Session) -> Result<(), Failure> {
        self.pictures.check()?;
        self.pictures.expand()?;
        let names = self.pictures.names();
        let inputs: Vec<PathBuf> = self.pictures.files().chain(self.optimization.files()).cloned().collect();
        inputs::check_readable(&inputs)?;
        let files = self.outputs.files(&session.stdout, &names, &inputs)?;
        let items = self.submit(session, names, files).await?;
        if !(self.wait || self.outputs.any()) {
            return print_submitted(session, &items);
        }
        finish(session, items).await
    }

    async fn submit(&self, session: &Session, names: Vec<String>, files: Vec<Files>) -> Result<Vec<Item>, Failure> {
        let mut items: Vec<Item> = Vec::new();
        let several = names.len() > 1;
        for (i, (name, files)) in names.into_iter().zip(files).enumerate() {
            let submitting = async {
                let spec = self.pictures.request(session, i).await?;
                let kernel = used(session, &self.kernel, async || Ok(only_kernel(&spec))).await?;
                let spec = OptimizeHologram { kernel, ..spec };
                let spec = self.optimization.fill(session, spec).await?;
                let kind = job_spec::Kind::OptimizeHologram(spec);
                self.submission.submit(session, kind, &self.pictures.label(i), several.then_some(name.as_str())).await
            };
            let earlier = items.iter().map(|item| &item.job);
            let job = submit_target(&self.pictures.first_file(i), earlier, submitting).await?;
            items.push(Item { name, job, files });
        }
        Ok(items)
    }
}

impl Save {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        if !self.outputs.any() {
            return Err(Failure::Usage(
                "there is nothing to save: give a file with -o, --npy or --reconstruction".to_owned(),
            ));
        }
        let found = job_names(session, &self.jobs).await?;
        let ids: Vec<String> = found.iter().map(|name| names::id(name).to_owned()).collect();
        let files = self.outputs.files(&session.stdout, &ids, &[])?;
        let mut items = Vec::new();
        for ((name, id), files) in found.into_iter().zip(ids).zip(files) {
            let job = session.client.get_job(v1::GetJobRequest { name }).await?;
            if !jobs::is_hologram(&job) {
                let (kind, _) = jobs::title(&job);
                return Err(Failure::Usage(format!("job {id} is of the kind {kind}, but only holograms can be saved")));
            }
            items.push(Item { name: id, job, files });
        }
        finish(session, items).await
    }
}

/// The kernel of a job that has only one.
fn only_kernel(spec: &OptimizeHologram) -> Option<KernelChoice> {
    let (OptimizeHologram { wavelengths_m, planes, .. }, display) = (spec, names::id(&spec.display));
    let [plane] = planes.as_slice() else { return None };
    let distance_m = plane.place.and_then(|place| place.distance_m())?;
    (wavelengths_m.len() < 2).then(|| KernelChoice::at(display, distance_m, wavelengths_m.first().copied()))
}

/// Waits for all jobs, saves the files of those that succeeded, and prints the quality of the holograms.
async fn finish(session: &Session, items: Vec<Item>) -> Result<(), Failure> {
    let ids: Vec<String> = items.iter().map(|item| names::id(&item.job.name).to_owned()).collect();
    let awaited = Awaited::new(&ids, items.iter().map(|item| &item.job));
    let progress = Progress::new(items.iter().map(|item| item.name.as_str()));
    let waits = items.into_iter().map(async |item| {
        let job = progress.wait(session, &item.name, &item.job.name, |_| ()).await?;
        if let Ok(result) = hologram_result(&job) {
            item.files.save(session, result).await?;
        }
        Ok::<Item, Failure>(Item { job, ..item })
    });
    let all = futures::stream::iter(waits).buffered(WATCHES_MAX).try_collect();
    let items: Vec<Item> = or_interrupted(awaited, all).await?;
    let text = results(&items);
    print_warnings(&items);
    let jobs: Vec<Job> = items.into_iter().map(|item| item.job).collect();
    session.print_jobs(&jobs, &text)?;
    jobs::check_success(&jobs)
}

/// Prints each warning once if there are several jobs, wavelengths or planes. For a single plane the facts have the
/// warnings.
fn print_warnings(items: &[Item]) {
    let results = items.iter().filter_map(|item| hologram_result(&item.job).ok());
    let planes = results.flat_map(|result| &result.wavelengths).flat_map(|wavelength| &wavelength.planes);
    let reports: Vec<_> = planes.filter_map(|plane| plane.propagation.as_ref()).collect();
    if reports.len() > 1 {
        let warnings = reports.iter().flat_map(|report| &report.warnings);
        let distinct: BTreeSet<String> =
            warnings.map(|warning| format!("warning {}: {}", warning.code, warning.text)).collect();
        distinct.iter().for_each(|warning| print_note(warning));
    }
}

fn print_submitted(session: &Session, items: &[Item]) -> Result<(), Failure> {
    let mut table = Table::new("target~|job|kernel~??|state?");
    for item in items {
        let id = names::id(&item.job.name).to_owned();
        let state = item.job.state().word().to_owned();
        table.row([item.name.clone(), id, show::used_kernels(&item.job.kernels), state]);
    }
    let jobs: Vec<Job> = items.iter().map(|item| item.job.clone()).collect();
    session.print_jobs(&jobs, &table.text())?;
    if let [item] = items {
        print_note(&watch_hint(&item.job));
    }
    Ok(())
}

impl JobKind for OptimizeHologram {
    fn title(&self) -> (&'static str, &str) {
        ("optimize hologram", names::id(&self.display))
    }

    fn spec_facts(&self, job: &Job, facts: &mut Facts) {
        facts.add("display", names::id(&self.display));
        facts.add("wavelength", show::lengths(self.wavelengths_m.iter().copied()));
        facts.add("distance", show::places(self.planes.iter().map(|plane| plane.place.as_ref())));
        facts.add("kernel", show::used_kernels(&job.kernels));
        let targets: BTreeSet<&str> = self.planes.iter().map(|plane| plane.target.as_str()).collect();
        targets.into_iter().for_each(|target| facts.add("target", target));
        let detector = self.detector().word();
        facts.add("work", format!("{} iterations, {detector} detector, seed {}", self.iterations(), self.seed));
    }

    fn result_facts(&self, job: &Job, facts: &mut Facts) -> lightpath::Result<String> {
        let result = hologram_result(job)?;
        facts.add("speed", results::speed(result));
        Ok(results::in_full(result, &job.kernels))
    }
}

/// The PSNR that a photograph of a hologram is expected to show, of several wavelengths or planes the lowest, for example `31.2 dB`. `–` for other jobs.
pub(crate) fn psnr(job: &Job) -> String {
    let Ok(result) = hologram_result(job) else { return "–".to_owned() };
    let planes = result.wavelengths.iter().flat_map(|wavelength| &wavelength.planes);
    let found = planes.filter_map(quality::headline_psnr).map(|psnr| psnr.value);
    let lowest = found.min_by(f64::total_cmp).map(show::decibel);
    lowest.or_else(|| quality::without_headline(result.judged())).unwrap_or_else(|| "–".to_owned())
}
