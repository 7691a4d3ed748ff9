//! Estimates of a job's memory and time when it is submitted, and their limits.

use super::{Jobs, kinds};
use crate::error::ServiceError;
use lightpath_domain::ability::counted_memory;
use lightpath_domain::dataset::Dataset;
use lightpath_domain::display::Display;
use lightpath_domain::job::estimate::{KernelSize, PairsSize};
use lightpath_domain::job::{Estimate, JobSpec, LearnKernel};
use lightpath_domain::kernel::{KernelKey, KernelVersion};
use lightpath_domain::planning;
use lightpath_domain::reason::PreconditionReason;
use lightpath_media::kernel_file;
use lightpath_optics::learning::{Blocks, KernelModel};
use lightpath_optics::memory::EngineSize;
use lightpath_optics::propagation::ConvolutionMethod;
use lightpath_optics::{Detector, DisplayModel, KernelShape};
use lightpath_store::StoreError;

const MIB: f64 = 1_048_576.0;

/// Limits on a job, and the speed with which its time is estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JobLimits {
    /// Limit on the memory of a job \[bytes\].
    pub memory_bytes: u64,
    /// Limit on the memory for transfer functions that are kept from job to job \[bytes\].
    pub cache_bytes: u64,
    /// Limit on the time of an attempt \[s\].
    pub time_s: f64,
    /// Work that this machine does each second, in the unit of `lightpath_optics::memory`.
    pub work_per_s: f64,
    /// Threads of a job.
    pub threads: usize,
}

impl Default for JobLimits {
    /// No limits.
    fn default() -> Self {
        Self { memory_bytes: u64::MAX, cache_bytes: 0, time_s: f64::INFINITY, work_per_s: 1e9, threads: 1 }
    }
}

impl Jobs {
    /// Estimates memory and time of a job. Refuses a job that would exceed the limits. `decoding_bytes` is the largest
    /// memory for decoding one of its pictures.
    pub(super) async fn estimated(&self, spec: &JobSpec, decoding_bytes: u64) -> Result<Estimate, ServiceError> {
        let need = kinds::need(self, spec, decoding_bytes).await?;
        let estimate = need.on(self.limits.work_per_s);
        // A server alone runs whatever is within its limit.
        let counted =
            if self.store.is_shared() { counted_memory(estimate.memory_bytes) } else { estimate.memory_bytes };
        if counted > self.largest_memory_bytes() {
            // A larger process may have come in the last seconds.
            self.store.read_living().await?;
        }
        let limits = JobLimits { memory_bytes: self.largest_memory_bytes(), ..self.limits };
        require_within(&Estimate { memory_bytes: counted, ..estimate }, &limits, spec)?;
        Ok(estimate)
    }

    /// The largest memory that a living process, or this one, gives a job \[bytes\].
    fn largest_memory_bytes(&self) -> u64 {
        let living = self.store.living();
        let largest = living.iter().map(|process| process.abilities.memory_bytes).max().unwrap_or(0);
        largest.max(self.limits.memory_bytes)
    }

    /// Pairs of the dataset from which a version was learned; `None`: it has none, or it was deleted.
    pub(super) async fn learned_pairs(
        &self,
        version: &KernelVersion,
        display: &Display,
    ) -> Result<Option<PairsSize>, ServiceError> {
        let Some(learned) = version.content.lineage.own_dataset() else { return Ok(None) };
        match self.store.dataset(&learned.id).await {
            // Another dataset, perhaps of another display, may have the id of a deleted one.
            Ok(dataset) => {
                let is_same = dataset.digest.as_deref() == Some(&learned.digest);
                Ok(is_same.then(|| PairsSize::of(&dataset, display)))
            }
            Err(StoreError::NotFound { .. }) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// Engine of the ideal display, or of one whose kernel has a value for each frequency, with the given propagation or
    /// the planner's choice.
    pub(super) fn ideal_engine(
        &self,
        display: &Display,
        key: &KernelKey,
        detector: Detector,
        propagation: Option<ConvolutionMethod>,
        has_bins: bool,
    ) -> Result<EngineSize, ServiceError> {
        let (height_px, width_px) = (display.height_px as usize, display.width_px as usize);
        let ideal = EngineSize::ideal(height_px, width_px, detector, self.limits.threads);
        // Where no method is valid, the job fails before it needs memory.
        let planned = planning::setup(display, key.wavelength, key.distance)
            .and_then(|setup| planning::planned(setup, propagation));
        Ok(planned.map_or(ideal, |(setup, _)| ideal.sampled_with(&setup, has_bins)))
    }

    /// Size of a kernel version; `None`: of the ideal kernel.
    pub(super) async fn kernel_size(
        &self,
        display: &Display,
        key: &KernelKey,
        version: Option<u32>,
        detector: Detector,
        propagation: Option<ConvolutionMethod>,
    ) -> Result<KernelSize, ServiceError> {
        let ideal = |has_bins| self.ideal_engine(display, key, detector, propagation, has_bins);
        let Some(version) = version else {
            let engine = ideal(false)?;
            return Ok(KernelSize { engine, order: 0, blocks: Blocks::NONE, has_bins: false, file_bytes: 0 });
        };
        let content = self.store.kernel_version(key, version).await?.content;
        let (engine, order, blocks) = match content.model {
            KernelModel::Paper | KernelModel::Dense => (ideal(true)?, 0, Blocks::NONE),
            // Such files have some hundred numbers.
            KernelModel::Smooth | KernelModel::Display | KernelModel::Varying => {
                let file = self.artifacts.read_all(&content.artifact).await?;
                let unreadable = (ideal(false)?, 0, Blocks::ALL);
                kernel_file::decode(&file).map_or(unreadable, |(model, _)| {
                    let engine = EngineSize::of(&model, detector, self.limits.threads);
                    (engine, order_of(&model), Blocks::of(&model))
                })
            }
        };
        Ok(KernelSize { engine, order, blocks, has_bins: !content.model.is_smooth(), file_bytes: content.size_bytes })
    }
}

/// Highest order of a smooth kernel.
fn order_of(model: &DisplayModel) -> usize {
    match &model.kernel {
        KernelShape::Smooth(field) => field.order,
        KernelShape::Ideal | KernelShape::Bins(_) => 0,
    }
}

pub(super) fn key_of(dataset: &Dataset) -> KernelKey {
    KernelKey { display: dataset.display.clone(), wavelength: dataset.wavelength, distance: dataset.distance }
}

/// Rows and columns of the region that the job compared which learned a version \[px\]; all if it is not known.
pub(super) fn learned_region_px(version: &KernelVersion, kernel: &KernelSize) -> [usize; 2] {
    let parameters = serde_json::from_str(&version.content.lineage.parameters_json);
    let region = parameters.map(|parameters: LearnKernel| parameters.region_of_interest);
    region.map_or([kernel.engine.height_px, kernel.engine.width_px], |region| [region.height_px(), region.width_px()])
}

/// Refuses a job that needs more memory or time than the living processes give a job.
fn require_within(estimate: &Estimate, limits: &JobLimits, spec: &JobSpec) -> Result<(), ServiceError> {
    let Estimate { memory_bytes, time_s } = *estimate;
    if memory_bytes <= limits.memory_bytes && time_s <= limits.time_s {
        return Ok(());
    }
    let mib = |bytes: u64| (bytes as f64 / MIB).ceil();
    let message = format!(
        "spec: the job would need {} MiB of memory and {:.0} s, but a job gets at most {} MiB \
         (job_memory_mib_max) and {:.0} s (job_time_s_max); {}",
        mib(memory_bytes),
        time_s.ceil(),
        mib(limits.memory_bytes),
        limits.time_s,
        kinds::advice(spec)
    );
    Err(ServiceError::Precondition { reason: PreconditionReason::JobTooLarge, message })
}
