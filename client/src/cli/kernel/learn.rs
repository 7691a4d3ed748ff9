//! `lightpath kernel learn` and `evaluate`.

use crate::cli::arguments::{above_zero, region};
use crate::cli::failure::Failure;
use crate::cli::session::Session;
use crate::cli::submission::Submission;
use crate::cli::words::WordParser;
use clap::Args;
use lightpath::names;
use lightpath::v1::{self, EvaluateKernel, KernelModel, LearnKernel, job_spec};

/// Learn a display's light transport from photographs.
///
/// The result is the next version of the kernel of the dataset's display, wavelength and distance. It is not
/// used until it is promoted. From datasets of several distances one model is learned: it gives a version for each, and kernels of
/// distances between them (kernel interpolate).
#[derive(Debug, Args)]
#[command(after_long_help = "\
Example:
  lightpath kernel learn --dataset bench-1 --wait
  lightpath kernel promote --display lab-2 --distance 150mm --version 1 \\
      --reason \"held-out loss 0.0001\"")]
pub(crate) struct Learn {
    /// Name of a finalized dataset; several, of one display at different distances, are learned together
    #[arg(long = "dataset", value_name = "NAME", required = true)]
    datasets: Vec<String>,

    /// How the light transport is written as parameters
    #[arg(long, default_value = "display", value_parser = WordParser::<KernelModel>::new())]
    model: KernelModel,

    /// Passes over the training pairs with Adam, 1 to 1000 [default: the model's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    epochs: Option<u32>,

    /// Evaluations of all pairs after Adam (smooth, display and varying), at most 10000 [default: the model's]
    #[arg(long, value_name = "N")]
    refinement_evaluations: Option<u32>,

    /// Adam's step, above 0, at most 10 [default: the model's]
    #[arg(long, value_name = "X", value_parser = above_zero)]
    learning_rate: Option<f64>,

    /// Seed of the order of the pairs, and of the paper model's start
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    /// Highest polynomial degree of the smooth errors, 1 to 12; auto: 5, 8 or 12, as the validation pairs choose
    #[arg(long, value_name = "N", default_value = "auto", value_parser = order)]
    order: u32,

    /// Start from this version of the kernel, learned as smooth, display or varying, instead of the ideal kernel
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    start_version: Option<u32>,

    /// What the camera's pixels measure (supersampled is no camera)
    #[arg(long, default_value = "pixel", value_parser = WordParser::<v1::Detector>::new())]
    detector: v1::Detector,

    /// Where the photographs count, in pixels: x,y,width,height [default: the middle 80 % of each axis]
    #[arg(long, value_name = "X,Y,W,H", value_parser = region)]
    roi: Option<v1::RegionOfInterest>,

    /// Wait for the job, with a bar
    #[arg(long)]
    wait: bool,

    #[command(flatten)]
    submission: Submission,
}

/// Measure how well a kernel predicts a dataset's photographs.
#[derive(Debug, Args)]
pub(crate) struct Evaluate {
    /// Name of a finalized dataset
    #[arg(long, value_name = "NAME")]
    dataset: String,

    /// Which kernel of the dataset's display, wavelength and distance: active, ideal or a version number
    #[arg(long, value_name = "KERNEL", default_value = "active")]
    kernel: String,

    /// Where the photographs count, in pixels: x,y,width,height [default: the middle 80 % of each axis]
    #[arg(long, value_name = "X,Y,W,H", value_parser = region)]
    roi: Option<v1::RegionOfInterest>,

    /// Wait for the job, with a bar
    #[arg(long)]
    wait: bool,

    #[command(flatten)]
    submission: Submission,
}

impl Learn {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let kind = job_spec::Kind::LearnKernel(LearnKernel {
            datasets: self.datasets.iter().map(|name| names::dataset(name)).collect(),
            model: self.model.into(),
            order: self.order,
            start_version: self.start_version.unwrap_or(0),
            epochs: self.epochs.unwrap_or(0),
            learning_rate: self.learning_rate.unwrap_or(0.0),
            refinement_evaluations: self.refinement_evaluations,
            seed: self.seed,
            detector: self.detector.into(),
            region_of_interest: self.roi,
        });
        self.submission.submit_and_print(session, kind, self.wait).await
    }
}

/// 0 stands for auto.
fn order(text: &str) -> Result<u32, String> {
    match text.parse() {
        Ok(order) if (1..=12).contains(&order) => Ok(order),
        _ if text == "auto" => Ok(0),
        _ => Err("an order is 1 to 12, or auto".to_owned()),
    }
}

impl Evaluate {
    pub(super) async fn run(self, session: &Session) -> Result<(), Failure> {
        let kind = job_spec::Kind::EvaluateKernel(EvaluateKernel {
            dataset: names::dataset(&self.dataset),
            kernel: self.kernel,
            region_of_interest: self.roi,
        });
        self.submission.submit_and_print(session, kind, self.wait).await
    }
}
