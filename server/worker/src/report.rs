//! Makes the report of a kernel version, for people.

use super::display_setup::DisplaySetup;
use super::{JobContext, TaskError, TaskOutput};
use lightpath_domain::dataset::{self, Dataset, Split};
use lightpath_domain::job::{
    FailureReason, JobEffect, JobResult, LearnKernel, LearnResult, LearnedKernel, OTHER_VERSIONS_MAX, Progress,
    ReportFigure, ReportKernel, ReportResult,
};
use lightpath_domain::kernel::KernelVersion;
use lightpath_media::captures::Captures;
use lightpath_media::kernel_file;
use lightpath_media::report::{self, Evidence, OtherVersion, PAIRS_SHOWN_MAX, ReportError, ReportInput};
use lightpath_optics::learning::{Pair, ResponseUncertainty};
use lightpath_optics::{Detector, DisplayModel, RegionOfInterest};
use lightpath_store::StoreError;

/// Largest number of training pairs whose holograms are used to find the illuminated band. More pairs would change
/// little.
const BAND_PAIRS_MAX: usize = 16;
/// Largest number of jointly learned versions that are searched for those of the same job.
const JOINT_VERSIONS_MAX: u32 = 1000;

pub(super) fn run(context: &JobContext, spec: &ReportKernel) -> Result<TaskOutput, TaskError> {
    let version = context.wait(context.store().kernel_version(&spec.kernel, spec.version))?;
    let model = model_of(context, &version)?;
    let other_versions = other_versions(context, &version, &model)?;
    let over_distance = over_distance(context, &version)?;
    let (loss_history, learned) = match learn_result(context, &version)? {
        Some(learned) => (learned.loss_history, learned.kernels),
        None => Default::default(),
    };
    let evidence = match dataset_of(context, &version)? {
        None => None,
        Some(mut dataset) => {
            leave_out(&mut dataset, &learned);
            let parameters = serde_json::from_str(&version.content.lineage.parameters_json).ok();
            Some(collect_evidence(context, &dataset, &model, parameters.as_ref())?)
        }
    };
    let input = ReportInput { version, model, loss_history, evidence, other_versions, over_distance };
    let draw = |done: u32| report_progress(context, "draw the report", done as usize, report::STEPS as usize);
    let made = report::make(&input, draw)?;
    draw(report::STEPS)?;
    let mut figures = Vec::with_capacity(made.figures.len());
    for figure in made.figures {
        let artifact = context.put_artifact(figure.bytes)?;
        figures.push(ReportFigure { name: figure.name, title: figure.title, artifact });
    }
    let (html, arrays) = (context.put_artifact(made.html.into_bytes())?, context.put_artifact(made.arrays)?);
    let result = ReportResult { html, arrays, figures };
    Ok(TaskOutput { result: JobResult::Report(result), effect: JobEffect::None })
}

/// Reports the progress. A report has no checkpoints, because it takes little time to make it again.
fn report_progress(context: &JobContext, stage: &str, done: usize, total: usize) -> Result<(), TaskError> {
    let (step, steps_total) = (done as u32, total as u32);
    context.report(Progress { stage: stage.to_owned(), step, steps_total, loss: 0.0, eta_s: None })
}

/// Reads the display model of a kernel version.
fn model_of(context: &JobContext, version: &KernelVersion) -> Result<DisplayModel, TaskError> {
    let (model, _) = kernel_file::decode(&context.read_artifact(&version.content.artifact)?)?;
    Ok(model)
}

/// The dataset from which the version was learned. `None`: the version was imported, or the dataset was deleted or
/// replaced by another one.
fn dataset_of(context: &JobContext, version: &KernelVersion) -> Result<Option<Dataset>, TaskError> {
    let Some(learned) = version.content.lineage.own_dataset() else { return Ok(None) };
    match context.wait(context.store().dataset(&learned.id)) {
        Ok(dataset) => Ok(Some(dataset).filter(|found| found.digest.as_deref() == Some(&learned.digest))),
        Err(StoreError::NotFound { .. }) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// Compares other versions of the same kernel with `model`, newest first. One of them is in memory at a time.
fn other_versions(
    context: &JobContext,
    version: &KernelVersion,
    model: &DisplayModel,
) -> Result<Vec<OtherVersion>, TaskError> {
    let mut records = context.wait(context.store().kernel_versions(&version.key, None, OTHER_VERSIONS_MAX + 1))?;
    records.retain(|other| other.version != version.version);
    records.truncate(OTHER_VERSIONS_MAX as usize);
    let mut others = Vec::with_capacity(records.len());
    for other in &records {
        report_progress(context, "read other versions", others.len(), records.len())?;
        let metrics = &other.content.metrics;
        let test_loss = (metrics.test_pairs > 0).then_some(metrics.test_loss);
        let difference = report::difference(model, &model_of(context, other)?);
        others.push(OtherVersion { version: other.version, test_loss, difference });
    }
    Ok(others)
}

/// Reads the models at all distances that were learned together with the version. Empty: the version was learned at one
/// distance.
fn over_distance(context: &JobContext, version: &KernelVersion) -> Result<Vec<DisplayModel>, TaskError> {
    let KernelVersion { key, content, .. } = version;
    if content.lineage.joint_distances().is_none() {
        return Ok(Vec::new());
    }
    let versions = context.wait(context.store().joint_versions(&key.display, key.wavelength, JOINT_VERSIONS_MAX))?;
    let same_fit = versions.iter().filter(|other| other.content.lineage.job == content.lineage.job);
    same_fit.map(|other| model_of(context, other)).collect()
}

/// Result of the job that learned the version. `None`: the version was imported, or the job was deleted.
fn learn_result(context: &JobContext, version: &KernelVersion) -> Result<Option<LearnResult>, TaskError> {
    let id = &version.content.lineage.job;
    if id.is_empty() {
        return Ok(None);
    }
    match context.wait(context.store().job(id)) {
        Ok(job) => Ok(match job.result {
            Some(JobResult::Learn(learned)) => Some(learned),
            _ => None,
        }),
        Err(StoreError::NotFound { .. }) => Ok(None),
        Err(error) => Err(error.into()),
    }
}

/// Removes the pairs that learning left out.
fn leave_out(dataset: &mut Dataset, learned: &[LearnedKernel]) {
    let Some(kernel) = learned.iter().find(|kernel| kernel.dataset == dataset.id) else { return };
    dataset.pairs.retain(|pair| !kernel.left_out_pairs.contains(&pair.id));
}

/// Compares photographs of the dataset with the model's predictions. Test and validation pairs come first, because the
/// model was not fitted to them.
fn collect_evidence(
    context: &JobContext,
    dataset: &Dataset,
    model: &DisplayModel,
    parameters: Option<&LearnKernel>,
) -> Result<Evidence, TaskError> {
    let display = DisplaySetup::read(context, &dataset.display, dataset.wavelength, dataset.distance)?;
    let captures = Captures::of(&display.declared, dataset)?;
    let grid = captures.setup().grid();
    let region = match parameters {
        None => RegionOfInterest::middle(&grid),
        Some(parameters) => display.region(parameters.region_of_interest)?,
    };
    let detector = parameters.map_or(Detector::Pixel, |parameters| parameters.detector);
    let engine = context.engines().engine(model, detector, display.carrier)?;
    let mut response = ResponseUncertainty::of(model, detector, display.carrier, region)?;
    let mut evidence = Evidence::new(region, grid.height_px(), grid.width_px(), grid.pixel_pitch_m());
    let pairs: Vec<&dataset::Pair> =
        [(Split::Test, PAIRS_SHOWN_MAX), (Split::Validation, PAIRS_SHOWN_MAX), (Split::Train, BAND_PAIRS_MAX)]
            .into_iter()
            .flat_map(|(split, most)| dataset.pairs.iter().filter(move |pair| pair.split == Some(split)).take(most))
            .collect();
    for (done, pair) in pairs.iter().enumerate() {
        report_progress(context, "compare photographs with predictions", done, pairs.len())?;
        let phase = captures.phase(&context.read_artifact(&pair.phase)?)?;
        let photo = captures.photo(pair, &context.read_artifact(&pair.photo)?)?;
        let (decoded, split) = (Pair { phase, photo }, pair.split.unwrap_or(Split::Train));
        evidence.add(&engine, &pair.id, split, &decoded)?;
        if let Some(response) = response.as_mut().filter(|_| split == Split::Train) {
            response.add(&decoded)?;
        }
    }
    evidence.response = response.and_then(|response| response.covariance());
    Ok(evidence)
}

impl From<ReportError> for TaskError {
    fn from(error: ReportError) -> Self {
        Self::permanent(FailureReason::NoReport, error)
    }
}
