//! Estimates of a job's memory and time when it is submitted, and their limits.

use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use lightpath_domain::ability::counted_memory;
use lightpath_domain::dataset::Dataset;
use lightpath_domain::display::Display;
use lightpath_domain::job::estimate::{
    HologramInputs, KernelSize, LearningInputs, Need, PairsSize, PreparingInputs, ReportInputs, SuggestInputs,
    evaluate_kernel, learn_kernel, optimize_hologram, prepare_dataset, report_kernel, simulate_capture,
    suggest_holograms, verify_hologram,
};
use lightpath_domain::job::{
    AlignBy, Estimate, EvaluateKernel, JobSpec, LearnKernel, OTHER_VERSIONS_MAX, OptimizeHologram, PrepareDataset,
    PrepareStep, ReportKernel, SimulateCapture, SuggestHolograms, VerifyHologram,
};
use lightpath_domain::kernel::{KernelKey, KernelVersion};
use lightpath_domain::planning;
use lightpath_domain::reason::PreconditionReason;
use lightpath_media::{captures, kernel_file};
use lightpath_optics::learning::{Blocks, KernelModel};
use lightpath_optics::memory::EngineSize;
use lightpath_optics::propagation::ConvolutionMethod;
use lightpath_optics::{Detector, DisplayModel, KernelShape, OpticalSetup};
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

impl Api {
    /// Estimates memory and time of a job. Refuses a job that would exceed the limits. `decoding_bytes` is the largest
    /// memory for decoding one of its pictures.
    pub(crate) async fn estimated(&self, spec: &JobSpec, decoding_bytes: u64) -> Result<Estimate, ApiError> {
        let need = match spec {
            JobSpec::OptimizeHologram(spec) => self.hologram_need(spec, decoding_bytes).await?,
            JobSpec::LearnKernel(spec) => self.learning_need(spec).await?,
            JobSpec::SimulateCapture(spec) => self.capture_need(spec).await?,
            JobSpec::EvaluateKernel(spec) => self.evaluation_need(spec).await?,
            JobSpec::PrepareDataset(spec) => self.preparing_need(spec, decoding_bytes).await?,
            JobSpec::ReportKernel(spec) => self.report_need(spec).await?,
            JobSpec::VerifyHologram(spec) => self.verification_need(spec).await?,
            JobSpec::SuggestHolograms(spec) => self.suggestion_need(spec).await?,
        };
        let estimate = need.on(self.job_limits.work_per_s);
        // A server alone runs whatever is within its limit.
        let counted =
            if self.store.is_shared() { counted_memory(estimate.memory_bytes) } else { estimate.memory_bytes };
        if counted > self.largest_memory_bytes() {
            // A larger process may have come in the last seconds.
            self.store.read_living().await?;
        }
        let limits = JobLimits { memory_bytes: self.largest_memory_bytes(), ..self.job_limits };
        require_within(&Estimate { memory_bytes: counted, ..estimate }, &limits, spec)?;
        Ok(estimate)
    }

    /// The largest memory that a living process, or this one, gives a job \[bytes\].
    fn largest_memory_bytes(&self) -> u64 {
        let living = self.store.living();
        let largest = living.iter().map(|process| process.abilities.memory_bytes).max().unwrap_or(0);
        largest.max(self.job_limits.memory_bytes)
    }

    async fn hologram_need(&self, spec: &OptimizeHologram, decoding_bytes: u64) -> Result<Need, ApiError> {
        let kernels = self.hologram_kernels(spec).await?;
        let cache_bytes_max = self.job_limits.cache_bytes;
        Ok(optimize_hologram(spec, &HologramInputs { cache_bytes_max, kernels, decoding_bytes }))
    }

    async fn verification_need(&self, spec: &VerifyHologram) -> Result<Need, ApiError> {
        let JobSpec::OptimizeHologram(verified) = self.store.job(&spec.job).await?.spec else {
            return Err(StoreError::NotFound { resource: format!("jobs/{}", spec.job) }.into());
        };
        Ok(verify_hologram(&verified, &self.hologram_kernels(&verified).await?))
    }

    /// Kernels of a hologram job: for each wavelength one for each plane.
    async fn hologram_kernels(&self, spec: &OptimizeHologram) -> Result<Vec<Vec<KernelSize>>, ApiError> {
        let (display, _) = self.store.display(&spec.display).await?;
        let mut kernels = Vec::with_capacity(spec.wavelengths.len());
        for (&wavelength, versions) in spec.wavelengths.iter().zip(&spec.kernel_versions) {
            let mut of_planes = Vec::with_capacity(spec.planes.len());
            for (plane, &version) in spec.planes.iter().zip(versions) {
                let key = KernelKey { display: display.id.clone(), wavelength, distance: plane.distance };
                of_planes.push(self.kernel_size(&display, &key, version, spec.detector, spec.propagation).await?);
            }
            kernels.push(of_planes);
        }
        Ok(kernels)
    }

    async fn learning_need(&self, spec: &LearnKernel) -> Result<Need, ApiError> {
        let (display, _) = self.store.display(&spec.display).await?;
        let (mut pairs, mut engine) = (Vec::with_capacity(spec.datasets.len()), None);
        for id in &spec.datasets {
            let dataset = self.store.dataset(id).await?;
            let own = self.ideal_engine(&display, &key_of(&dataset), spec.detector, None, false)?;
            let before: EngineSize = engine.unwrap_or(own);
            let sampling_bytes = before.sampling_bytes.max(own.sampling_bytes);
            // A bench of all orders takes the most memory at the smallest distance.
            let distance_m = |setup: &OpticalSetup| setup.distance_m().abs();
            let setups = before.orders_setup.into_iter().chain(own.orders_setup);
            let orders_setup = setups.min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)));
            engine = Some(EngineSize { sampling_bytes, orders_setup, ..own });
            pairs.push(PairsSize::of(&dataset, &display));
        }
        let Some(engine) = engine else { return Err(StoreError::NotFound { resource: "datasets".to_owned() }.into()) };
        let bench = display.simulated_bench;
        let cache_bytes_max = self.job_limits.cache_bytes;
        Ok(learn_kernel(spec, &LearningInputs { engine, pairs, cache_bytes_max, bench }))
    }

    async fn capture_need(&self, spec: &SimulateCapture) -> Result<Need, ApiError> {
        let (display, _) = self.store.display(&spec.display).await?;
        let key = KernelKey { display: spec.display.clone(), wavelength: spec.wavelength, distance: spec.distance };
        let engine = self.ideal_engine(&display, &key, Detector::Pixel, None, false)?;
        let bench = display.simulated_bench.unwrap_or_default();
        // The levels of a hologram have at most two bytes.
        Ok(simulate_capture(engine, &bench, 6 * engine.pixels()))
    }

    async fn evaluation_need(&self, spec: &EvaluateKernel) -> Result<Need, ApiError> {
        let (display, _) = self.store.display(&spec.display).await?;
        let dataset = self.store.dataset(&spec.dataset).await?;
        // The detector is the one with which the kernel was learned. None that a camera measures with is larger.
        let kernel = self.kernel_size(&display, &key_of(&dataset), spec.kernel_version, Detector::Pixel, None).await?;
        Ok(evaluate_kernel(&kernel, &PairsSize::of(&dataset, &display)))
    }

    async fn preparing_need(&self, spec: &PrepareDataset, dots_bytes: u64) -> Result<Need, ApiError> {
        let (display, _) = self.store.display(&spec.display).await?;
        let dataset = self.store.dataset(&spec.dataset).await?;
        let engine = self.ideal_engine(&display, &key_of(&dataset), Detector::Pixel, None, false)?;
        let needs_alignment = captures::needs_alignment(&dataset);
        let pairs = PairsSize::of(&dataset, &display);
        Ok(prepare_dataset(&spec.step, &PreparingInputs { engine, pairs, needs_alignment, dots_bytes }))
    }

    async fn report_need(&self, spec: &ReportKernel) -> Result<Need, ApiError> {
        let (display, _) = self.store.display(&spec.kernel.display).await?;
        let version = self.store.kernel_version(&spec.kernel, spec.version).await?;
        let kernel = self.kernel_size(&display, &spec.kernel, Some(spec.version), Detector::Pixel, None).await?;
        let others = self.store.kernel_versions(&spec.kernel, None, OTHER_VERSIONS_MAX + 1).await?;
        let sizes = || others.iter().map(|other| other.content.size_bytes);
        let (other_file_bytes, other_files_bytes) = (sizes().max().unwrap_or(0), sizes().sum());
        let pairs = self.learned_pairs(&version, &display).await?;
        let (model, region_px) = (version.content.model, learned_region_px(&version, &kernel));
        Ok(report_kernel(&ReportInputs { kernel, model, other_file_bytes, other_files_bytes, pairs, region_px }))
    }

    async fn suggestion_need(&self, spec: &SuggestHolograms) -> Result<Need, ApiError> {
        let (display, _) = self.store.display(&spec.kernel.display).await?;
        let version = self.store.kernel_version(&spec.kernel, spec.version).await?;
        let kernel = self.kernel_size(&display, &spec.kernel, Some(spec.version), Detector::Pixel, None).await?;
        let (model, region_px) = (version.content.model, learned_region_px(&version, &kernel));
        match self.learned_pairs(&version, &display).await? {
            Some(pairs) => Ok(suggest_holograms(spec, &SuggestInputs { kernel, model, pairs, region_px })),
            None => Err(ApiError::Precondition {
                reason: PreconditionReason::DatasetDeleted,
                message: format!(
                    "the dataset of {}/versions/{} was deleted, and with it the holograms that were photographed; name a \
                     version whose dataset exists",
                    spec.kernel, spec.version
                ),
            }),
        }
    }

    /// Pairs of the dataset from which a version was learned; `None`: it has none, or it was deleted.
    async fn learned_pairs(&self, version: &KernelVersion, display: &Display) -> Result<Option<PairsSize>, ApiError> {
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
    fn ideal_engine(
        &self,
        display: &Display,
        key: &KernelKey,
        detector: Detector,
        propagation: Option<ConvolutionMethod>,
        has_bins: bool,
    ) -> Result<EngineSize, ApiError> {
        let (height_px, width_px) = (display.height_px as usize, display.width_px as usize);
        let ideal = EngineSize::ideal(height_px, width_px, detector, self.job_limits.threads);
        // Where no method is valid, the job fails before it needs memory.
        let planned = planning::setup(display, key.wavelength, key.distance)
            .and_then(|setup| planning::planned(setup, propagation));
        Ok(planned.map_or(ideal, |(setup, _)| ideal.sampled_with(&setup, has_bins)))
    }

    /// Size of a kernel version; `None`: of the ideal kernel.
    async fn kernel_size(
        &self,
        display: &Display,
        key: &KernelKey,
        version: Option<u32>,
        detector: Detector,
        propagation: Option<ConvolutionMethod>,
    ) -> Result<KernelSize, ApiError> {
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
                    let engine = EngineSize::of(&model, detector, self.job_limits.threads);
                    (engine, order_of(&model), Blocks::of(&model))
                })
            }
        };
        Ok(KernelSize { engine, order, blocks, has_bins: !content.model.is_smooth(), file_bytes: content.size_bytes })
    }

    /// Memory for decoding the photograph of dots from which a dataset is aligned; 0 for other jobs.
    pub(crate) async fn dots_decoding_bytes(
        &self,
        call: &Call,
        field: &Field,
        spec: &PrepareDataset,
    ) -> Result<u64, ApiError> {
        match &spec.step {
            PrepareStep::Align(AlignBy::Dots { photo }) => self.reading_bytes(call, field, photo, 0).await,
            _ => Ok(0),
        }
    }
}

/// Highest order of a smooth kernel.
fn order_of(model: &DisplayModel) -> usize {
    match &model.kernel {
        KernelShape::Smooth(field) => field.order,
        KernelShape::Ideal | KernelShape::Bins(_) => 0,
    }
}

fn key_of(dataset: &Dataset) -> KernelKey {
    KernelKey { display: dataset.display.clone(), wavelength: dataset.wavelength, distance: dataset.distance }
}

/// Rows and columns of the region that the job compared which learned a version \[px\]; all if it is not known.
fn learned_region_px(version: &KernelVersion, kernel: &KernelSize) -> [usize; 2] {
    let parameters = serde_json::from_str(&version.content.lineage.parameters_json);
    let region = parameters.map(|parameters: LearnKernel| parameters.region_of_interest);
    region.map_or([kernel.engine.height_px, kernel.engine.width_px], |region| [region.height_px(), region.width_px()])
}

/// Refuses a job that needs more memory or time than the living processes give a job.
fn require_within(estimate: &Estimate, limits: &JobLimits, spec: &JobSpec) -> Result<(), ApiError> {
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
        advice(spec)
    );
    Err(ApiError::Precondition { reason: PreconditionReason::JobTooLarge, message })
}

/// What makes a job of this kind smaller.
fn advice(spec: &JobSpec) -> &'static str {
    match spec {
        JobSpec::OptimizeHologram(_) => {
            "use fewer frames, planes or iterations, a smaller display, or the method adam, which needs half the memory \
             of lbfgs"
        }
        JobSpec::LearnKernel(_) => {
            "use a smooth or display model, a lower order, fewer datasets, epochs or pairs, or a smaller display"
        }
        JobSpec::EvaluateKernel(_) | JobSpec::PrepareDataset(_) => {
            "use fewer pairs, smaller photographs, or a smaller display"
        }
        JobSpec::SimulateCapture(_) | JobSpec::ReportKernel(_) => "use a smaller display",
        JobSpec::SuggestHolograms(_) => "ask for fewer holograms, or use a smaller display",
        JobSpec::VerifyHologram(_) => "verify holograms with fewer frames or planes, or of a smaller display",
    }
}
