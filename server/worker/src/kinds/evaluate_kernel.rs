//! Measures a kernel on a dataset.

use crate::display_setup::{DisplaySetup, read_dataset};
use crate::losses::LossMeter;
use crate::pairs::Pairs;
use crate::{JobContext, TaskError, TaskOutput};
use lightpath_domain::dataset::Split;
use lightpath_domain::job::{EvaluateKernel, EvaluateResult, JobEffect, JobResult, PairLoss};
use lightpath_optics::Detector;

pub(super) fn run(context: &JobContext, spec: &EvaluateKernel) -> Result<TaskOutput, TaskError> {
    let (display, dataset) = read_dataset(context, &spec.dataset)?;
    let region = display.region(spec.region_of_interest)?;
    let model = display.model(context, spec.kernel_version)?;
    let detector = detector_of(context, &display, spec.kernel_version)?;
    let meter = LossMeter::new(context, &display, &model, detector, region)?;
    let mut pairs = Vec::new();
    for (split, stage) in [
        (Split::Train, "measure on training pairs"),
        (Split::Validation, "measure on validation pairs"),
        (Split::Test, "measure on test pairs"),
    ] {
        let source = Pairs::of(context, &display, &dataset, split)?;
        let losses = meter.losses(&source, stage)?;
        pairs.extend(losses.iter().enumerate().map(|(index, loss)| PairLoss {
            pair: source.name(index).to_owned(),
            split,
            loss: loss.region,
            loss_full_frame: loss.full_frame,
        }));
    }
    pairs.sort_by(|a, b| a.pair.cmp(&b.pair));
    let propagation = display.validity_of(&model);
    Ok(TaskOutput { result: JobResult::EvaluateKernel(EvaluateResult { pairs, propagation }), effect: JobEffect::None })
}

/// Detector with which a kernel version was learned. If it is unknown, it is the mean over the pixel.
fn detector_of(context: &JobContext, display: &DisplaySetup, version: Option<u32>) -> Result<Detector, TaskError> {
    let Some(version) = version else { return Ok(Detector::Pixel) };
    let version = context.wait(context.store().kernel_version(&display.key, version))?;
    Ok(version.content.lineage.parameters().map_or(Detector::Pixel, |parameters| parameters.detector))
}
