//! Learns a kernel from a dataset, or kernels for several distances jointly from several datasets.

use crate::captured;
use crate::context::Eta;
use crate::display_setup::{DisplaySetup, finite, read_dataset};
use crate::losses::{Loss, LossMeter, mean};
use crate::pairs::{JointPairs, Pairs};
use crate::state_bytes::{from_bytes, to_bytes};
use crate::{JobContext, TaskError, TaskOutput};
use lightpath_domain::dataset::{Dataset, Split};
use lightpath_domain::job::{Job, JobEffect, JobResult, LearnKernel, LearnResult, LearnedKernel, Progress};
use lightpath_domain::kernel::{KernelMetrics, NewKernelVersion};
use lightpath_domain::lineage::{KernelLineage, KernelOrigin, LearnedDataset, Learning};
use lightpath_media::captures::Captures;
use lightpath_media::kernel_file::{self, Origin};
use lightpath_optics::learning::{
    LearnOptions, LearnStage, Learner, LearningPairs, ModelPart, ModelUncertainty, PairSource, PartCost, PartStrength,
    unsaturated_px, without_each_part,
};
use lightpath_optics::{Detector, DisplayModel, KernelModel, KernelShape, OpticalSetup, RegionOfInterest};

/// Limit on the number of pairs from which the certainty of a model is measured. More would change little.
const CERTAINTY_PAIRS_MAX: usize = 16;

pub(super) fn run(context: &JobContext, job: &Job, spec: &LearnKernel) -> Result<TaskOutput, TaskError> {
    let planes = read_planes(context, spec)?;
    let region = planes[0].0.region(spec.parameters.region_of_interest)?;
    for split in [Split::Validation, Split::Test] {
        check_photographs(context, &JointPairs::of(context, &planes, split)?, region)?;
    }
    let training = JointPairs::of(context, &planes, Split::Train)?;
    check_photographs(context, &training, region)?;
    let validation = JointPairs::of(context, &planes, Split::Validation)?;
    let learner =
        learn(context, spec, &planes, region, LearningPairs { training: &training, validation: &validation })?;
    let (models, loss_history) = (learner.models(), learner.loss_history().to_vec());
    for loss in &loss_history {
        finite("the loss", *loss)?;
    }
    let kept = kept_pairs(&training, &learner.kept_pairs(training.len()));
    drop(learner);
    // Frees the memory of decoded pairs before `measure` reads pairs.
    drop((training, validation));

    let learned_from_first = kept[0].indices.clone();
    let (mut kernels, mut learned) = (Vec::with_capacity(planes.len()), Vec::with_capacity(planes.len()));
    for ((plane, model), kept) in planes.iter().zip(&models).zip(kept) {
        let metrics = measure(context, spec, plane, region, model, &kept.indices)?;
        kernels.push(LearnedKernel {
            // The store fills in the name.
            kernel_version: String::new(),
            dataset: plane.1.id.clone(),
            metrics: metrics.clone(),
            left_out_pairs: kept.left_out,
            propagation: plane.0.validity.clone(),
        });
        let kind = kind(spec.parameters.model, model);
        let display = Some(plane.0.key.display.clone());
        let file = kernel_file::encode_with(model, kind, &Origin { display, ..Origin::default() })?;
        let size_bytes = file.len() as u64;
        let (artifact, lineage) = (context.put_artifact(file)?, lineage(job, spec, plane, &planes));
        let version = NewKernelVersion { model: kind, artifact, size_bytes, metrics, lineage };
        learned.push((plane.0.key.clone(), version));
    }
    let parts = strengths(context, &planes[0], &models[0], (spec.parameters.detector, region), &learned_from_first)?;
    let degree = match &models[0].kernel {
        KernelShape::Smooth(field) => field.order as u32,
        KernelShape::Ideal | KernelShape::Bins(_) => 0,
    };
    Ok(TaskOutput {
        result: JobResult::LearnKernel(LearnResult { kernels, loss_history, degree, parts }),
        effect: JobEffect::Kernels(learned),
    })
}

/// Kind of the learned model. If the model `varying` was requested and no variation was learned, it is `display`.
fn kind(requested: KernelModel, model: &DisplayModel) -> KernelModel {
    match requested {
        KernelModel::Varying if model.variation.is_none() => KernelModel::Display,
        _ => requested,
    }
}

/// The training pairs of a dataset that learning used and those that it left out.
#[derive(Clone, Default)]
struct KeptPairs {
    /// Indices of the pairs that were used.
    indices: Vec<usize>,
    /// Ids of the pairs that were left out.
    left_out: Vec<String>,
}

/// The used and left-out training pairs of each dataset. `kept` are the indices of used pairs over all datasets.
fn kept_pairs(training: &JointPairs, kept: &[usize]) -> Vec<KeptPairs> {
    let mut of_datasets = vec![KeptPairs::default(); training.parts().len()];
    for index in 0..training.len() {
        let (plane, index_there) = training.locate(index);
        match kept.contains(&index) {
            true => of_datasets[plane].indices.push(index_there),
            false => of_datasets[plane].left_out.push(training.parts()[plane].id(index_there).to_owned()),
        }
    }
    of_datasets
}

/// Reads the datasets, each with its display setup at the dataset's distance.
fn read_planes(context: &JobContext, spec: &LearnKernel) -> Result<Vec<(DisplaySetup, Dataset)>, TaskError> {
    spec.datasets.iter().map(|id| read_dataset(context, id)).collect()
}

/// Refuses photographs that cannot be read or are saturated at every pixel. Otherwise the error would come after hours
/// of learning.
fn check_photographs(context: &JobContext, pairs: &JointPairs, region: RegionOfInterest) -> Result<(), TaskError> {
    let steps_total = pairs.len() as u32;
    for index in 0..pairs.len() {
        if unsaturated_px(&pairs.pair(index)?.photo, region) == 0 {
            let (plane, index_there) = pairs.locate(index);
            return Err(pairs.parts()[plane].named(index_there, lightpath_optics::Error::Saturated.into()));
        }
        let (stage, step) = ("check the photographs".to_owned(), index as u32 + 1);
        context.report(Progress { stage, step, steps_total, loss: None, eta_s: None })?;
    }
    Ok(())
}

/// Runs the remaining steps of learning. Returns the learner with its models.
fn learn(
    context: &JobContext,
    spec: &LearnKernel,
    planes: &[(DisplaySetup, Dataset)],
    region: RegionOfInterest,
    learning_pairs: LearningPairs<'_>,
) -> Result<Learner, TaskError> {
    let display = &planes[0].0;
    let setups: Vec<OpticalSetup> = planes.iter().map(|(display, _)| display.setup).collect();
    let warm_start =
        spec.start_version.as_ref().map(|(_, version)| display.model(context, Some(*version))).transpose()?;
    let options = LearnOptions { warm_start, ..options(spec, display, region) };
    let saved = context.take_saved_state().and_then(|bytes| from_bytes(&bytes));
    let mut learner = match saved {
        Some(state) => Learner::resume_joint(&setups, options, state)?,
        None => Learner::start_joint(&setups, options, learning_pairs.training)?,
    };
    let mut eta = None;
    while let Some(done) = learner.step(learning_pairs)? {
        let eta = *eta.get_or_insert_with(|| Eta::from(done.step));
        let stage = match done.stage {
            LearnStage::Adam => "learn".to_owned(),
            LearnStage::Refinement => match done.trial {
                Some(block) => format!("try {} at degree {}", block.name().replace('_', " "), done.order),
                None => format!("refine to degree {}", done.order),
            },
        };
        let progress = Progress {
            stage,
            step: done.step,
            steps_total: done.steps_total,
            loss: Some(finite("the loss", done.loss)?),
            eta_s: eta.left_s(done.step, done.steps_total),
        };
        context.step(progress, || to_bytes(&learner.state()))?;
    }
    Ok(learner)
}

fn options(spec: &LearnKernel, display: &DisplaySetup, region: RegionOfInterest) -> LearnOptions {
    let asked = &spec.parameters;
    let defaults = LearnOptions::new(asked.model, region);
    LearnOptions {
        degree: asked.degree.map(|degree| degree as usize),
        epochs: asked.epochs.unwrap_or(defaults.epochs),
        learning_rate: asked.learning_rate.unwrap_or(defaults.learning_rate),
        refinement_evaluations: asked.refinement_evaluations.unwrap_or(defaults.refinement_evaluations),
        seed: asked.seed,
        detector: asked.detector,
        carrier: display.carrier,
        ..defaults
    }
}

/// Measures the model learned for one distance, and the ideal model on the same test pairs.
fn measure(
    context: &JobContext,
    spec: &LearnKernel,
    (display, dataset): &(DisplaySetup, Dataset),
    region: RegionOfInterest,
    model: &DisplayModel,
    kept: &[usize],
) -> Result<KernelMetrics, TaskError> {
    let detector = spec.parameters.detector;
    let validation = Pairs::of(context, display, dataset, Split::Validation)?;
    let test = Pairs::of(context, display, dataset, Split::Test)?;
    let learned = LossMeter::new(context, display, model, detector, region)?;
    let training = Pairs::of(context, display, dataset, Split::Train)?;
    let train_losses = learned.losses(&training, "measure on training pairs")?;
    let train_loss = mean(&kept.iter().map(|&index| train_losses[index]).collect::<Vec<_>>());
    let validation_losses = learned.losses(&validation, "measure on validation pairs")?;
    let test_losses = learned.losses(&test, "measure on test pairs")?;
    let (validation_loss, test_loss) = (mean(&validation_losses), mean(&test_losses));
    let held_out = if test.is_empty() { (&validation, &validation_losses[..]) } else { (&test, &test_losses[..]) };
    // Frees the transfer function of the learned model, so that only one is in memory at a time.
    drop(learned);
    let ideal = LossMeter::new(context, display, &DisplayModel::ideal(display.setup), detector, region)?;
    let ideal_test_loss = mean(&ideal.losses(&test, "measure the ideal kernel")?);
    drop(ideal);
    let parts = part_costs(context, display, model, (detector, region), held_out)?;
    let captures = Captures::of(&display.declared, dataset)?;
    let (validation_pairs, test_pairs) = (validation.len() as u32, test.len() as u32);
    // Frees the decoded pairs before holograms are computed.
    drop((training, validation, test));
    Ok(KernelMetrics {
        train_pairs: kept.len() as u32,
        validation_pairs,
        test_pairs,
        train_loss: train_loss.region,
        validation_loss: validation_loss.region,
        test_loss: test_loss.region,
        ideal_test_loss: ideal_test_loss.region,
        test_loss_full_frame: test_loss.full_frame,
        ideal_test_loss_full_frame: ideal_test_loss.full_frame,
        captured: captured::compare(context, display, &captures, model, detector, region)?,
        parts,
    })
}

/// How strong a model's parts are, and how certain that is, from training pairs that learning used.
fn strengths(
    context: &JobContext,
    (display, dataset): &(DisplaySetup, Dataset),
    model: &DisplayModel,
    (detector, region): (Detector, RegionOfInterest),
    kept: &[usize],
) -> Result<Vec<PartStrength>, TaskError> {
    let Some(mut uncertainty) = ModelUncertainty::of(model, detector, display.carrier, region)? else {
        return Ok(PartStrength::all_of(model));
    };
    let training = Pairs::of(context, display, dataset, Split::Train)?;
    let used = &kept[..kept.len().min(CERTAINTY_PAIRS_MAX)];
    let steps_total = used.len() as u32;
    for (done, &index) in used.iter().enumerate() {
        uncertainty.add(&training.pair(index)?)?;
        let (stage, step) = ("measure the certainty".to_owned(), done as u32 + 1);
        context.report(Progress { stage, step, steps_total, loss: None, eta_s: None })?;
    }
    Ok(uncertainty.strengths().unwrap_or_else(|| PartStrength::all_of(model)))
}

/// What the model loses without each of its parts, on pairs whose losses with all parts are known.
fn part_costs(
    context: &JobContext,
    display: &DisplaySetup,
    model: &DisplayModel,
    (detector, region): (Detector, RegionOfInterest),
    (pairs, with): (&Pairs, &[Loss]),
) -> Result<Vec<PartCost>, TaskError> {
    let of_region = |losses: &[Loss]| losses.iter().map(|loss| loss.region).collect::<Vec<_>>();
    let with = of_region(with);
    let cost = |(part, without): (ModelPart, DisplayModel)| {
        let losses =
            LossMeter::new(context, display, &without, detector, region)?.losses(pairs, "measure the parts")?;
        Ok(PartCost::of(part, &with, &of_region(&losses)))
    };
    if pairs.is_empty() {
        return Ok(Vec::new());
    }
    let costs = without_each_part(model).into_iter().map(cost).collect::<Result<Vec<_>, TaskError>>()?;
    let mut costs: Vec<PartCost> = costs.into_iter().flatten().collect();
    costs.sort_by(|a, b| b.cost_db.total_cmp(&a.cost_db));
    Ok(costs)
}

fn lineage(
    job: &Job,
    spec: &LearnKernel,
    (_, dataset): &(DisplaySetup, Dataset),
    planes: &[(DisplaySetup, Dataset)],
) -> KernelLineage {
    let mut datasets: Vec<LearnedDataset> = planes.iter().map(|(_, dataset)| learned_dataset(dataset)).collect();
    datasets.sort_by_key(|other| (other.distance != dataset.distance, other.distance));
    KernelLineage::of(KernelOrigin::Learned(Learning {
        job: job.id.clone(),
        datasets,
        parent_version: spec.start_version.as_ref().map(|(kernel, version)| format!("{kernel}/versions/{version}")),
        parameters: Some(spec.parameters),
    }))
}

fn learned_dataset(dataset: &Dataset) -> LearnedDataset {
    let digest = dataset.digest.clone().unwrap_or_default();
    LearnedDataset { distance: dataset.distance, id: dataset.id.clone(), digest }
}
