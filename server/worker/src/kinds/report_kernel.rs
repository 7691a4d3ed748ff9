//! Makes the report of a kernel version, for people.

use crate::learned_from::{LearnedFrom, learn_result};
use crate::version_model::model_of;
use crate::{JobContext, TaskError, TaskOutput};
use lightpath_domain::dataset::{self, Split};
use lightpath_domain::job::{
    FailureReason, JobEffect, JobResult, OTHER_VERSIONS_MAX, Progress, ReportFigure, ReportKernel, ReportResult,
};
use lightpath_domain::kernel::KernelVersion;
use lightpath_media::report::{self, Evidence, OtherVersion, PAIRS_SHOWN_MAX, ReportError, ReportInput};
use lightpath_optics::DisplayModel;
use lightpath_optics::learning::{ModelUncertainty, Pair};

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
    let evidence = match LearnedFrom::read(context, &version, &learned)? {
        None => None,
        Some(from) => Some(collect_evidence(context, &from, &model)?),
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
    Ok(TaskOutput { result: JobResult::ReportKernel(result), effect: JobEffect::None })
}

/// Reports the progress. A report has no checkpoints, because it takes little time to make it again.
fn report_progress(context: &JobContext, stage: &str, done: usize, total: usize) -> Result<(), TaskError> {
    let (step, steps_total) = (done as u32, total as u32);
    context.report(Progress { stage: stage.to_owned(), step, steps_total, loss: None, eta_s: None })
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
    let same_fit = versions.iter().filter(|other| other.content.lineage.job() == content.lineage.job());
    same_fit.map(|other| model_of(context, other)).collect()
}

/// Compares photographs of the dataset with the model's predictions. Test and validation pairs come first, because the
/// model was not fitted to them.
fn collect_evidence(context: &JobContext, from: &LearnedFrom, model: &DisplayModel) -> Result<Evidence, TaskError> {
    let LearnedFrom { display, captures, detector, region, .. } = from;
    let grid = captures.setup().grid();
    let engine = context.engines().engine(model, *detector, display.carrier)?;
    let mut uncertainty = ModelUncertainty::of(model, *detector, display.carrier, *region)?;
    let mut evidence = Evidence::new(*region, grid.height_px(), grid.width_px(), grid.pixel_pitch_m());
    let pairs: Vec<&dataset::Pair> =
        [(Split::Test, PAIRS_SHOWN_MAX), (Split::Validation, PAIRS_SHOWN_MAX), (Split::Train, BAND_PAIRS_MAX)]
            .into_iter()
            .flat_map(|(split, most)| from.pairs(split, most))
            .collect();
    for (done, pair) in pairs.iter().enumerate() {
        report_progress(context, "compare photographs with predictions", done, pairs.len())?;
        let phase = captures.phase(&context.read_artifact(&pair.pattern)?)?;
        let photo = captures.photo(pair, &context.read_artifact(&pair.photo)?)?;
        let (decoded, split) = (Pair { phase, photo }, pair.split.unwrap_or(Split::Train));
        evidence.add(&engine, &pair.id, split, &decoded)?;
        if let Some(uncertainty) = uncertainty.as_mut().filter(|_| split == Split::Train) {
            uncertainty.add(&decoded)?;
        }
    }
    evidence.response = uncertainty.as_ref().and_then(ModelUncertainty::response);
    evidence.strengths = uncertainty.as_ref().and_then(ModelUncertainty::strengths);
    Ok(evidence)
}

impl From<ReportError> for TaskError {
    fn from(error: ReportError) -> Self {
        Self::permanent(FailureReason::NoReport, error)
    }
}
