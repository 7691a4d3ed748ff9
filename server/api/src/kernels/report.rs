//! Reports of kernel versions.

use super::interpolate::VERSIONS_MAX;
use crate::api::Api;
use crate::error::ApiError;
use crate::field::Field;
use crate::names;
use lightpath_artifacts::Artifacts;
use lightpath_domain::access::Caller;
use lightpath_domain::dataset::{Dataset, Split};
use lightpath_domain::display::Display;
use lightpath_domain::job::{JobResult, LearnKernel, LearnResult, LearnedKernel};
use lightpath_domain::kernel::{KernelKey, KernelVersion};
use lightpath_media::captures::{CaptureError, Captures};
use lightpath_media::report::{self, Earlier, Evidence, PAIRS_SHOWN_MAX, Report, ReportError, ReportInput};
use lightpath_optics::learning::{Pair, ResponseUncertainty};
use lightpath_optics::{Detector, DisplayModel, Engine, RegionOfInterest};
use lightpath_proto::v1;
use lightpath_store::StoreError;
use tokio::runtime::Handle;

/// Other versions that a report compares with, at most: the newest ones.
const EARLIER_MAX: u32 = 12;
/// Training pairs whose holograms tell which band is lit: more change little.
const LIT_BY_MAX: usize = 16;

/// Why a report could not be made.
#[derive(Debug, thiserror::Error)]
enum Failure {
    #[error(transparent)]
    Capture(#[from] CaptureError),
    #[error(transparent)]
    Optics(#[from] lightpath_optics::Error),
    #[error(transparent)]
    Artifact(#[from] lightpath_artifacts::ArtifactError),
    #[error(transparent)]
    Report(#[from] ReportError),
}

impl Api {
    /// Makes the report of a version and stores its parts.
    pub(crate) async fn create_kernel_report(
        &self,
        caller: &Caller,
        request: v1::CreateKernelReportRequest,
    ) -> Result<v1::KernelReport, ApiError> {
        let (key, number) = names::kernel_version(caller, &Field::new("name"), &request.name)?;
        let version = self.store.kernel_version(&key, number).await?;
        let model = self.model_of(&version).await?;
        let dataset = self.dataset_of(&version).await?;
        let (display, _) = self.store.display(&key.display).await?;
        let earlier = self.earlier(&key, number).await?;
        let over_distance = self.over_distance(&version).await?;
        let (loss_history, left_out) = match self.learn_result(&version).await? {
            Some(learned) => (learned.loss_history, left_out_of(learned.kernels, dataset.as_ref())),
            None => Default::default(),
        };
        let (artifacts, runtime) = (self.artifacts.clone(), Handle::current());
        let make = move || -> Result<Report, Failure> {
            let parameters: Option<LearnKernel> = serde_json::from_str(&version.content.lineage.parameters_json).ok();
            let evidence = match dataset {
                None => None,
                Some(mut dataset) => {
                    dataset.pairs.retain(|pair| !left_out.contains(&pair.id));
                    Some(gather(&display, &dataset, &model, parameters.as_ref(), &artifacts, &runtime)?)
                }
            };
            Ok(report::make(&ReportInput { version, model, loss_history, evidence, earlier, over_distance })?)
        };
        let made = self.decoding.run(make).await?.map_err(|error| match error {
            Failure::Artifact(error) => error.into(),
            error => {
                ApiError::Precondition { reason: "NO_REPORT", message: format!("{key}/versions/{number}: {error}") }
            }
        })?;
        let mut figures = Vec::with_capacity(made.figures.len());
        for figure in made.figures {
            let artifact = self.keep(caller, figure.bytes).await?;
            figures.push(v1::kernel_report::Figure { name: figure.name, title: figure.title, artifact });
        }
        Ok(v1::KernelReport {
            html: self.keep(caller, made.html.into_bytes()).await?,
            arrays: self.keep(caller, made.arrays).await?,
            figures,
        })
    }

    /// What the version was learned from; `None` for imports, and where that dataset is gone or another one by now.
    async fn dataset_of(&self, version: &KernelVersion) -> Result<Option<Dataset>, ApiError> {
        let Some(learned) = version.content.lineage.own_dataset() else { return Ok(None) };
        match self.store.dataset(&learned.id).await {
            Ok(dataset) => Ok(Some(dataset).filter(|found| found.digest.as_deref() == Some(&learned.digest))),
            Err(StoreError::NotFound { .. }) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    async fn earlier(&self, key: &KernelKey, number: u32) -> Result<Vec<Earlier>, ApiError> {
        let mut earlier = Vec::new();
        for other in self.store.kernel_versions(key, None, EARLIER_MAX + 1).await? {
            if other.version != number && earlier.len() < EARLIER_MAX as usize {
                let metrics = &other.content.metrics;
                let test_loss = (metrics.test_pairs > 0).then_some(metrics.test_loss);
                earlier.push(Earlier { version: other.version, test_loss, model: self.model_of(&other).await? });
            }
        }
        Ok(earlier)
    }

    /// The model at each distance of the fit that the version is of; none where it is of one distance alone.
    async fn over_distance(&self, version: &KernelVersion) -> Result<Vec<DisplayModel>, ApiError> {
        let KernelVersion { key, content, .. } = version;
        let mut models = Vec::new();
        if content.lineage.joint_distances().is_some() {
            for other in self.store.joint_versions(&key.display, key.wavelength, VERSIONS_MAX).await? {
                if other.content.lineage.job == content.lineage.job {
                    models.push(self.model_of(&other).await?);
                }
            }
        }
        Ok(models)
    }

    /// What the job told that learned the version; `None` for imports, and where that job is gone.
    async fn learn_result(&self, version: &KernelVersion) -> Result<Option<LearnResult>, ApiError> {
        let id = &version.content.lineage.job;
        if id.is_empty() {
            return Ok(None);
        }
        match self.store.job(id).await {
            Ok(job) => Ok(match job.result {
                Some(JobResult::Learn(learned)) => Some(learned),
                _ => None,
            }),
            Err(StoreError::NotFound { .. }) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }
}

/// Ids of the dataset's pairs that learning left out.
fn left_out_of(kernels: Vec<LearnedKernel>, dataset: Option<&Dataset>) -> Vec<String> {
    let of_dataset = kernels.into_iter().find(|kernel| dataset.is_some_and(|dataset| kernel.dataset == dataset.id));
    of_dataset.map(|kernel| kernel.left_out_pairs).unwrap_or_default()
}

/// Held-out pairs first: what they say was not fitted.
fn gather(
    display: &Display,
    dataset: &Dataset,
    model: &DisplayModel,
    parameters: Option<&LearnKernel>,
    artifacts: &Artifacts,
    runtime: &Handle,
) -> Result<Evidence, Failure> {
    let captures = Captures::of(display, dataset)?;
    let grid = captures.setup().grid();
    let region = match parameters.map(|parameters| parameters.region_of_interest) {
        None => RegionOfInterest::middle(&grid),
        Some(region) => region.inside(&grid)?,
    };
    let detector = parameters.map_or(Detector::Pixel, |parameters| parameters.detector);
    let engine = Engine::new(model, detector, captures.carrier())?;
    let mut response = ResponseUncertainty::of(model, detector, captures.carrier(), region)?;
    let mut evidence = Evidence::new(region, grid.height_px(), grid.width_px(), grid.pixel_pitch_m());
    for (split, most) in
        [(Split::Test, PAIRS_SHOWN_MAX), (Split::Validation, PAIRS_SHOWN_MAX), (Split::Train, LIT_BY_MAX)]
    {
        for pair in dataset.pairs.iter().filter(|pair| pair.split == Some(split)).take(most) {
            let phase = captures.phase(&runtime.block_on(artifacts.read_all(&pair.phase))?)?;
            let photo = captures.photo(pair, &runtime.block_on(artifacts.read_all(&pair.photo))?)?;
            let seen = Pair { phase, photo };
            evidence.add(&engine, &pair.id, split, &seen)?;
            if let Some(response) = response.as_mut().filter(|_| split == Split::Train) {
                response.add(&seen)?;
            }
        }
    }
    evidence.response = response.and_then(|response| response.covariance());
    Ok(evidence)
}
