//! Learning a kernel from a dataset.

use super::captured;
use super::context::Eta;
use super::losses::{Judge, mean};
use super::pairs::Pairs;
use super::setting::{Setting, detector, finite};
use super::state_bytes::{learn_state_from_bytes, learn_state_to_bytes};
use super::{JobContext, TaskError, TaskOutput};
use crate::captures::Captures;
use crate::dataset::{Dataset, Split};
use crate::job::{Job, JobResult, LearnKernel, LearnResult, Progress};
use crate::kernel::{KernelLineage, KernelMetrics, KernelModel, NewKernelVersion};
use crate::kernel_file;
use lightpath_optics::learning::{LearnModel, LearnOptions, LearnStage, Learner, Lessons, PairSource, unsaturated_px};
use lightpath_optics::{DisplayModel, KernelShape, RegionOfInterest};

pub(super) fn run(context: &JobContext, job: &Job, spec: &LearnKernel) -> Result<TaskOutput, TaskError> {
    let (setting, dataset) = read_dataset(context, &spec.dataset)?;
    let region = setting.region(spec.region_of_interest)?;
    for split in [Split::Validation, Split::Test] {
        check_photographs(context, &Pairs::of(context, &setting, &dataset, split)?, region)?;
    }
    let training = Pairs::of(context, &setting, &dataset, Split::Train)?;
    check_photographs(context, &training, region)?;
    let validation = Pairs::of(context, &setting, &dataset, Split::Validation)?;
    let learner = learn(context, spec, &setting, region, Lessons { training: &training, validation: &validation })?;
    let (model, loss_history) = (learner.model(), learner.loss_history().to_vec());
    let kept = learner.kept_pairs(training.len());
    drop(learner);
    let left_out_pairs = (0..training.len()).filter(|index| !kept.contains(index));
    let left_out_pairs = left_out_pairs.map(|index| training.id(index).to_owned()).collect();
    // What is kept of pairs makes room for those of the next step.
    drop((training, validation));

    let mut metrics = measure(context, spec, &setting, &dataset, region, &model, &kept)?;
    metrics.captured = captured::compare(
        context,
        &setting,
        &Captures::of(&setting.display, &dataset)?,
        &model,
        detector(spec.detector),
        region,
    )?;
    let file = kernel_file::encode(&model, spec.model)?;
    let size_bytes = file.len() as u64;
    let version = NewKernelVersion {
        model: spec.model,
        artifact: context.put_artifact(file)?,
        size_bytes,
        metrics: metrics.clone(),
        lineage: lineage(job, spec, &dataset)?,
    };
    for loss in &loss_history {
        finite("the loss", *loss)?;
    }
    // The store fills in the name.
    let propagation = Some(setting.validity.clone());
    let order = match &model.kernel {
        KernelShape::Smooth(field) => field.order as u32,
        KernelShape::Ideal | KernelShape::Bins(_) => 0,
    };
    let kernel_version = String::new();
    let result = LearnResult { kernel_version, metrics, loss_history, propagation, left_out_pairs, order };
    Ok(TaskOutput { result: JobResult::Learn(result), learned: Some((setting.key, version)) })
}

/// A finalized dataset and the display that it is about.
pub(super) fn read_dataset(context: &JobContext, id: &str) -> Result<(Setting, Dataset), TaskError> {
    let dataset = context.wait(context.store().dataset(id))?;
    if dataset.digest.is_none() {
        let message = format!("datasets/{id} is still open; finalize it first");
        return Err(TaskError::permanent("DATASET_OPEN", message));
    }
    let setting = Setting::read(context, &dataset.display, dataset.wavelength, dataset.distance)?;
    Ok((setting, dataset))
}

/// Refuses photographs that cannot be read or of which nothing counts: better now than after hours of learning.
fn check_photographs(context: &JobContext, pairs: &Pairs, region: RegionOfInterest) -> Result<(), TaskError> {
    let steps_total = pairs.len() as u32;
    for index in 0..pairs.len() {
        if unsaturated_px(&pairs.pair(index)?.photo, region) == 0 {
            return Err(pairs.named(index, lightpath_optics::Error::Saturated.into()));
        }
        let (stage, step) = ("check the photographs".to_owned(), index as u32 + 1);
        context.report(Progress { stage, step, steps_total, loss: 0.0, eta_s: None })?;
    }
    Ok(())
}

/// All steps that are left.
fn learn(
    context: &JobContext,
    spec: &LearnKernel,
    setting: &Setting,
    region: RegionOfInterest,
    lessons: Lessons<'_>,
) -> Result<Learner, TaskError> {
    let warm_start = spec.start_version.map(|version| setting.model(context, Some(version))).transpose()?;
    let options = LearnOptions { warm_start, ..options(spec, setting, region) };
    let saved = context.take_saved_state().and_then(|bytes| learn_state_from_bytes(&bytes));
    let mut learner = match saved {
        Some(state) => Learner::resume(setting.setup, options, state)?,
        None => Learner::start(setting.setup, options, lessons.training)?,
    };
    let mut eta = None;
    while let Some(done) = learner.step(lessons)? {
        let eta = *eta.get_or_insert_with(|| Eta::from(done.step));
        let stage = match done.stage {
            LearnStage::Adam => "learn".to_owned(),
            LearnStage::Refinement => format!("refine to order {}", done.order),
        };
        let progress = Progress {
            stage,
            step: done.step,
            steps_total: done.steps_total,
            loss: finite("the loss", done.loss)?,
            eta_s: eta.left_s(done.step, done.steps_total),
        };
        context.step(progress, || learn_state_to_bytes(&learner.state()))?;
    }
    Ok(learner)
}

fn options(spec: &LearnKernel, setting: &Setting, region: RegionOfInterest) -> LearnOptions {
    let order = spec.order.map(|order| order as usize);
    let model = match spec.model {
        KernelModel::Paper => LearnModel::Paper,
        KernelModel::Dense => LearnModel::Dense,
        KernelModel::Smooth => LearnModel::Smooth { order },
        KernelModel::Display => LearnModel::Display { order },
    };
    let defaults = LearnOptions::new(model, region);
    LearnOptions {
        epochs: spec.epochs.unwrap_or(defaults.epochs),
        learning_rate: spec.learning_rate.unwrap_or(defaults.learning_rate),
        refinement_evaluations: spec.refinement_evaluations.unwrap_or(defaults.refinement_evaluations),
        seed: spec.seed,
        detector: detector(spec.detector),
        carrier: setting.carrier,
        ..defaults
    }
}

/// Judges the learned model, and the ideal one on the same test pairs.
fn measure(
    context: &JobContext,
    spec: &LearnKernel,
    setting: &Setting,
    dataset: &Dataset,
    region: RegionOfInterest,
    model: &DisplayModel,
    kept: &[usize],
) -> Result<KernelMetrics, TaskError> {
    let detector = detector(spec.detector);
    let validation = Pairs::of(context, setting, dataset, Split::Validation)?;
    let test = Pairs::of(context, setting, dataset, Split::Test)?;
    let learned = Judge::new(context, setting, model, detector, region)?;
    let training = Pairs::of(context, setting, dataset, Split::Train)?;
    let train_losses = learned.losses(&training, "measure on training pairs")?;
    let train_loss = mean(&kept.iter().map(|&index| train_losses[index]).collect::<Vec<_>>());
    let validation_loss = mean(&learned.losses(&validation, "measure on validation pairs")?);
    let test_loss = mean(&learned.losses(&test, "measure on test pairs")?);
    // Two transfer functions of a large display need not be in memory at once.
    drop(learned);
    let ideal = Judge::new(context, setting, &DisplayModel::ideal(setting.setup), detector, region)?;
    let ideal_test_loss = mean(&ideal.losses(&test, "measure the ideal kernel")?);
    Ok(KernelMetrics {
        train_pairs: kept.len() as u32,
        validation_pairs: validation.len() as u32,
        test_pairs: test.len() as u32,
        train_loss: train_loss.region,
        validation_loss: validation_loss.region,
        test_loss: test_loss.region,
        ideal_test_loss: ideal_test_loss.region,
        test_loss_full_frame: test_loss.full_frame,
        ideal_test_loss_full_frame: ideal_test_loss.full_frame,
        captured: None,
    })
}

fn lineage(job: &Job, spec: &LearnKernel, dataset: &Dataset) -> Result<KernelLineage, TaskError> {
    let parameters_json = serde_json::to_string(spec).map_err(|error| TaskError::permanent("LINEAGE", error))?;
    Ok(KernelLineage {
        job: job.id.clone(),
        dataset: dataset.id.clone(),
        dataset_digest: dataset.digest.clone().unwrap_or_default(),
        parameters_json,
        seed: spec.seed,
        code_version: env!("CARGO_PKG_VERSION").to_owned(),
        parent_version: spec.start_version.unwrap_or(0),
    })
}
