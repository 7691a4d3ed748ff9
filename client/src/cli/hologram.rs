//! `lightpath hologram …`

mod outputs;

use super::arguments::{Detector, Encoding, Optics, above_zero, region};
use super::failure::{Failure, TargetFailure};
use super::progress::{Progress, WATCHES_MAX, goes_on, or_interrupted};
use super::session::{Session, say};
use super::submission::{Submission, watch_hint};
use super::table::{Facts, Table};
use super::{destination, job_text, quality_text, show};
use clap::{Args, Subcommand, ValueEnum};
use futures::{StreamExt as _, TryStreamExt as _};
use lightpath::v1::{self, Job, OptimizeHologram, job_spec, optimize_hologram};
use lightpath::{hologram_result, names};
use outputs::{Files, Outputs};
use std::fs::File;
use std::path::PathBuf;

/// What can be done with holograms.
// The help of each is with its arguments: a comment here would hide all but its first line.
#[derive(Debug, Subcommand)]
pub(crate) enum HologramCommand {
    Optimize(Box<Optimize>),
    Save(Save),
}

/// Find the phases that make a display show target pictures.
///
/// Each target becomes a job of its own. With --wait or an output file the command waits for them, with a bar for each,
/// saves the files and prints how good the holograms are; otherwise it prints the jobs and ends.
///
/// Quality is measured in the region of interest, as three detectors see it: `point` at the sample points, `pixel` as
/// a camera of the same pitch integrates, `supersampled` as an eye sees. PSNR, SSIM and MS-SSIM compare with the target,
/// gain fitted (MS-SSIM where the region has 176 samples a side); efficiency is the light in the region as a part of
/// what leaves the SLM; speckle contrast is the grain of areas that should be even. Of several targets the table has the
/// PSNR, and at its end PSNR and SSIM of the quantized hologram as `pixel` sees it.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Examples:
  lightpath hologram optimize indian_head.png --display lab-2 --distance 150mm \\
      -o phase.png
  lightpath hologram optimize targets/*.png --display lab-2 --distance 150mm \\
      -o holograms/
  lightpath hologram optimize a.png b.png --display lab-2 --distance 150mm \\
      -o {name}-phase.png --reconstruction {name}-seen.png --npy {name}.npy

Output files: one file where there is one target; a folder (made where it is missing and ends with /), which \
then gets NAME-phase.png, NAME-phase.npy and NAME-reconstruction.png; or a pattern, where {name} stands for \
the target's file name without its extension.

With --output json each job is printed as one line of JSON.")]
pub(crate) struct Optimize {
    /// Pictures: PNG (8 or 16 bit, grey or colour), JPEG or TIFF, at least 8x8 px; colours are averaged
    #[arg(required = true, value_name = "TARGET")]
    targets: Vec<PathBuf>,

    #[command(flatten)]
    optics: Optics,

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

/// How the phase is found.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Optimization")]
struct Work {
    /// How the phase is found
    #[arg(long, default_value = "adam")]
    method: Method,

    /// Steps of the optimization, 1 to 10000
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..))]
    iterations: u32,

    /// Adam's step in radians, above 0, at most 10
    #[arg(long, value_name = "RAD", default_value_t = 0.1, value_parser = above_zero)]
    learning_rate: f64,

    /// What counts as the light of a pixel while optimizing
    #[arg(long, default_value = "pixel")]
    detector: Detector,

    /// Seed of the initial phase
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    /// The initial phase is uniform between 0 and this, in radians, at most 2π = 6.2831853
    #[arg(long, value_name = "RAD", default_value_t = 1.0)]
    phase_range: f64,

    /// How the target's values stand for light
    #[arg(long, value_name = "ENCODING", default_value = "srgb")]
    target_encoding: Encoding,

    /// How a target of another size is brought to the display's
    #[arg(long, default_value = "contain")]
    fit: Fit,

    /// Where the picture counts, in pixels: x,y,width,height [default: the middle 80 % of each axis]
    #[arg(long, value_name = "X,Y,W,H", value_parser = region)]
    roi: Option<v1::RegionOfInterest>,
}

/// How the phase is found.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Method {
    /// Adam on the phase, gain fitted.
    Adam,
}

/// How a target of another size is brought to the display's.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Fit {
    /// Scale to fit inside, keep the aspect ratio, black borders.
    Contain,
    /// Scale to cover, keep the aspect ratio, crop the overhang evenly.
    Cover,
    /// Scale each axis by itself.
    Stretch,
    /// Refuse any other size.
    Exact,
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

/// A target on its way: its name, its job and where its files go.
struct Item {
    name: String,
    job: Job,
    files: Files,
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
        let names: Vec<String> = self.targets.iter().map(|target| destination::name_of(target)).collect();
        let files = self.outputs.files(&names, &self.targets)?;
        check_readable(&self.targets)?;
        let items = self.submit(session, names, files).await?;
        if !(self.wait || self.outputs.any()) {
            return print_submitted(session, &items);
        }
        finish(session, items).await
    }

    async fn submit(&self, session: &Session, names: Vec<String>, files: Vec<Files>) -> Result<Vec<Item>, Failure> {
        let mut items: Vec<Item> = Vec::new();
        let several = names.len() > 1;
        for ((target, name), files) in self.targets.iter().zip(names).zip(files) {
            let submitting = async {
                let kind = self.kind(session.client.upload_file(target).await?);
                self.submission.submit(session, kind, several.then_some(name.as_str())).await
            };
            let ids: Vec<String> = items.iter().map(|item| names::id(&item.job.name).to_owned()).collect();
            let refused = |error| {
                let goes_on = (!ids.is_empty()).then(|| format!("submitted before that: the {}", goes_on(&ids)));
                Failure::Target(TargetFailure { target: target.clone(), error, goes_on })
            };
            let job = or_interrupted(&ids, submitting).await.map_err(|failure| match failure {
                Failure::Client(error) => refused(error),
                other => other,
            })?;
            items.push(Item { name, job, files });
        }
        Ok(items)
    }

    fn kind(&self, target: String) -> job_spec::Kind {
        let work = &self.work;
        let fit = match work.fit {
            Fit::Contain => optimize_hologram::Fit::Contain,
            Fit::Cover => optimize_hologram::Fit::Cover,
            Fit::Stretch => optimize_hologram::Fit::Stretch,
            Fit::Exact => optimize_hologram::Fit::Exact,
        };
        let method = match work.method {
            Method::Adam => optimize_hologram::Method::Adam,
        };
        job_spec::Kind::OptimizeHologram(OptimizeHologram {
            display: names::display(&self.optics.display),
            wavelength_m: self.optics.wavelength_m(),
            distance_m: self.optics.distance,
            target,
            target_encoding: v1::Encoding::from(work.target_encoding).into(),
            target_fit: fit.into(),
            kernel: self.kernel.clone(),
            kernel_version: 0,
            method: method.into(),
            detector: v1::Detector::from(work.detector).into(),
            iterations: work.iterations,
            learning_rate: work.learning_rate,
            seed: work.seed,
            initial_phase_range_rad: Some(work.phase_range),
            region_of_interest: work.roi,
        })
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
    job_text::check_success(&items.into_iter().map(|item| item.job).collect::<Vec<_>>())
}

fn print_submitted(session: &Session, items: &[Item]) -> Result<(), Failure> {
    let mut table = Table::new(&["target", "job", "kernel", "state"]);
    for item in items {
        session.print_json_line(&item.job)?;
        let id = names::id(&item.job.name).to_owned();
        table.row([item.name.clone(), id, kernel_version(&item.job), job_text::state(&item.job)]);
    }
    session.print_text(&table.text())?;
    if let [item] = items {
        say(&watch_hint(&item.job));
    }
    Ok(())
}

/// One result in full, or a table of several. The jobs that did not succeed are told as errors.
fn results(items: &[Item]) -> String {
    let succeeded = items.iter().filter_map(|item| Some((item, hologram_result(&item.job).ok()?)));
    if let ([item], Some((_, result))) = (items, succeeded.clone().next()) {
        return result_facts(item, result);
    }
    let mut table = Table::new(&[
        "target",
        "kernel",
        ">point",
        ">pixel",
        ">supersampled",
        ">quantized pixel",
        ">SSIM",
        ">ms/iteration",
        "job",
    ]);
    for (item, result) in succeeded {
        let of = |quality: Option<v1::Quality>| quality.unwrap_or_default();
        let (quality, quantized) = (of(result.quality), of(result.quantized_quality));
        table.row([
            item.name.clone(),
            kernel_version(&item.job),
            show::decibel(quality.psnr_point_db),
            show::decibel(quality.psnr_pixel_db),
            show::decibel(quality.psnr_supersampled_db),
            show::decibel(quantized.psnr_pixel_db),
            quality_text::similarity(quantized.ssim_pixel),
            format!("{:.1}", result.iteration_ms),
            names::id(&item.job.name).to_owned(),
        ]);
    }
    table.text_or("")
}

fn result_facts(item: &Item, result: &v1::HologramResult) -> String {
    let mut facts = Facts::default();
    facts.add("target", &item.name);
    facts.add("job", names::id(&item.job.name));
    facts.add("kernel", kernel_version(&item.job));
    facts.add("speed", format!("{:.1} ms an iteration, {} iterations", result.iteration_ms, result.iterations));
    facts.add_some("saved", item.files.text());
    format!("{}\n{}", facts.text(), quality_text::table(result))
}

fn kernel_version(job: &Job) -> String {
    match job.spec.as_ref().and_then(|spec| spec.kind.as_ref()) {
        Some(job_spec::Kind::OptimizeHologram(spec)) => show::kernel_version(spec.kernel_version),
        _ => "–".to_owned(),
    }
}
