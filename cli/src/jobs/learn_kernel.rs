//! Jobs that learn kernels, and the command `lightpath kernel learn`.

mod strengths;

use crate::arguments::{above_zero, region};
use crate::failure::Failure;
use crate::jobs::JobKind;
use crate::jobs::submission::Submission;
use crate::kernel_choice::of_dataset;
use crate::session::Session;
use crate::table::Facts;
use crate::words::WordParser;
use crate::{metrics_text, propagation_text, show};
use clap::Args;
use lightpath::v1::{self, Job, KernelModel, LearnKernel, job_spec};
use lightpath::{Words as _, learn_result, names};

/// Learn a display's light transport from photographs.
///
/// The result is the next version of the kernel for the dataset's display, wavelength and distance. It is not used
/// until it is promoted. From datasets of several distances the job learns one model, which gives a version for each
/// distance. The command kernel interpolate then makes kernels for distances between them.
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath kernel learn --dataset bench-1 --wait
  lightpath kernel promote --display lab-2 --distance 150mm --version 1 \\
      --reason \"held-out loss 0.0001\"")]
pub(crate) struct Learn {
    /// Learn from this finalized dataset; may be given up to 8 times, for one display and wavelength and different
    /// distances
    #[arg(long = "dataset", value_name = "NAME", required = true)]
    datasets: Vec<String>,

    /// Choose the model: which parameters describe the light transport
    #[arg(long, default_value = "display", value_parser = WordParser::<KernelModel>::new())]
    model: KernelModel,

    /// Make this many passes over the training pairs with Adam, 1 to 1000 [default: depends on the model]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    epochs: Option<u32>,

    /// Refine after Adam with at most this many evaluations of all pairs, 0 to 10000; only for smooth, display and
    /// varying [default: depends on the model]
    #[arg(long, value_name = "N")]
    refinement_evaluations: Option<u32>,

    /// Set the learning rate of Adam, above 0, at most 10 [default: depends on the model]
    #[arg(long, value_name = "X", value_parser = above_zero)]
    learning_rate: Option<f64>,

    /// Set the seed of the order of the pairs, and of the random start of the paper model
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,

    /// Set the highest polynomial degree of the smooth errors, 1 to 12; auto takes the one of 5, 8 and 12 that predicts
    /// the validation pairs best, and 8 without validation pairs
    #[arg(long, value_name = "N", default_value = "auto", value_parser = degree)]
    degree: Degree,

    /// Start from this version of the first dataset's kernel, by its number or name; it must be smooth, display or varying
    /// [default: the ideal kernel]
    #[arg(long, value_name = "VERSION")]
    start_version: Option<String>,

    /// Choose what the camera's pixels measure; point or pixel
    #[arg(long, default_value = "pixel", value_parser = WordParser::<v1::Detector>::new())]
    detector: v1::Detector,

    /// Compare photographs only in this region: x,y,width,height in pixels [default: the middle 80 % of each axis]
    #[arg(long, value_name = "X,Y,W,H", value_parser = region)]
    region: Option<v1::Region>,

    /// Wait until the job has ended, with a progress bar
    #[arg(long)]
    wait: bool,

    #[command(flatten)]
    submission: Submission,
}

impl Learn {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        let datasets: Vec<String> = self.datasets.iter().map(|name| names::dataset(name)).collect();
        let start_version = match &self.start_version {
            Some(text) => start_version(session, text, &datasets[0]).await?,
            None => String::new(),
        };
        let kind = job_spec::Kind::LearnKernel(LearnKernel {
            datasets,
            model: self.model.into(),
            degree: self.degree.0,
            start_version,
            epochs: self.epochs,
            learning_rate: self.learning_rate,
            refinement_evaluations: self.refinement_evaluations,
            seed: self.seed,
            detector: self.detector.into(),
            region: self.region,
        });
        self.submission.submit_and_print(session, kind, self.wait).await
    }
}

/// The name of a version that was given by its name, or by its number among those of a dataset's kernel.
async fn start_version(session: &Session, text: &str, dataset: &str) -> Result<String, Failure> {
    let Ok(number) = text.parse() else { return Ok(text.to_owned()) };
    match of_dataset(session, dataset).await? {
        Some(kernel) => kernel.version_name(session, Some(number)).await,
        None => Err(Failure::Usage(format!("give the name of the version: {dataset} has no distance"))),
    }
}

/// A polynomial degree; `None`: the one that predicts best.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Degree(Option<u32>);

/// Parses a polynomial degree, or `auto`.
fn degree(text: &str) -> Result<Degree, String> {
    match text.parse() {
        Ok(degree) if (1..=12).contains(&degree) => Ok(Degree(Some(degree))),
        _ if text == "auto" => Ok(Degree(None)),
        _ => Err("must be 1 to 12, or auto".to_owned()),
    }
}

impl JobKind for LearnKernel {
    fn title(&self) -> (&'static str, &str) {
        ("learn kernel", self.datasets.first().map_or("–", |name| names::id(name)))
    }

    fn spec_facts(&self, _: &Job, facts: &mut Facts) {
        let datasets: Vec<&str> = self.datasets.iter().map(|name| names::id(name)).collect();
        facts.add("dataset", datasets.join(", "));
        facts.add("model", self.model().word());
    }

    fn result_facts(&self, job: &Job, facts: &mut Facts) -> lightpath::Result<String> {
        let result = learn_result(job)?;
        for kernel in &result.kernels {
            facts.add("kernel", &kernel.kernel_version);
            propagation_text::add(kernel.propagation.as_ref(), facts);
            if let Some(metrics) = &kernel.metrics {
                facts.add("held-out loss", metrics_text::against_ideal(metrics.test_loss, metrics.ideal_test_loss));
                facts.add("training loss", show::loss(metrics.train_loss));
                facts.add("pairs", metrics_text::pairs(metrics));
                metrics_text::verdict(metrics, facts);
            }
            if !kernel.left_out_pairs.is_empty() {
                let ids = kernel.left_out_pairs.join(", ");
                facts.add("left out", format!("{ids}: the photographs do not match their holograms"));
            }
        }
        facts.add_some("degree", result.degree.map(|degree| degree.to_string()));
        strengths::add(result, facts);
        let parts = result.kernels.iter().filter_map(|kernel| kernel.metrics.as_ref()).map(metrics_text::parts);
        Ok(parts.filter(|table| !table.is_empty()).map(|table| format!("\n{table}")).collect())
    }
}
