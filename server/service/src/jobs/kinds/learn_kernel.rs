//! Learning jobs: kernels learned from datasets.

use super::Kind;
use crate::call::Call;
use crate::error::Result;
use crate::field::Field;
use crate::jobs::Jobs;
use crate::propagation::check_distance;
use lightpath_domain::dataset::Dataset;
use lightpath_domain::display::Display;
use lightpath_domain::job::LearnKernel;
use lightpath_domain::job::estimate::{Need, PairsSize};
use lightpath_domain::job::kinds::learn_kernel::{self, LearningInputs};
use lightpath_domain::kernel::KernelKey;
use lightpath_optics::memory::EngineSize;
use lightpath_optics::{KernelModel, OpticalSetup};
use lightpath_store::StoreError;

/// Limit on the datasets that are learned together: at 1080×1920 px the transfer functions of eight distances need half
/// a gigabyte.
const DATASETS_MAX: usize = 8;

impl Kind for LearnKernel {
    const ADVICE: &'static str =
        "use a smooth or display model, a lower degree, fewer datasets, epochs or pairs, or a smaller display";

    async fn need(&self, jobs: &Jobs, _: u64) -> Result<Need> {
        let (display, _) = jobs.store.display(&self.display).await?;
        let (mut pairs, mut engine) = (Vec::with_capacity(self.datasets.len()), None);
        for id in &self.datasets {
            let dataset = jobs.store.dataset(id).await?;
            let own = jobs.ideal_engine(&display, &dataset.kernel_key(), self.parameters.detector, None, false)?;
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
        let cache_bytes_max = jobs.limits.cache_bytes;
        Ok(learn_kernel::need(self, &LearningInputs { engine, pairs, cache_bytes_max, bench }))
    }
}

impl Jobs {
    /// The datasets with these ids, each given or refused by its name, and their display. Refuses datasets that differ in more than their distances.
    pub async fn datasets_to_learn(
        &self,
        call: &Call,
        field: &Field,
        ids: Vec<Result<String>>,
        model: KernelModel,
    ) -> Result<(Vec<Dataset>, Display)> {
        if ids.len() > 1 && !matches!(model, KernelModel::Smooth | KernelModel::Display) {
            return Err(field.but("has several entries", "only smooth and display models are learned from several"));
        }
        if ids.len() > DATASETS_MAX {
            return Err(field.but(format!("has {} entries", ids.len()), format!("at most {DATASETS_MAX} are accepted")));
        }
        let mut datasets: Vec<Dataset> = Vec::with_capacity(ids.len());
        let mut common_display = None;
        for (i, id) in ids.into_iter().enumerate() {
            let field = field.index(i);
            let (dataset, display) = self.datasets.finalized(call, &field, &id?).await?;
            check_distance(&field, &display, dataset.wavelength, dataset.distance)?;
            if let Some(first) = datasets.first()
                && (&dataset.display, dataset.wavelength) != (&first.display, first.wavelength)
            {
                let problem = format!("is of displays/{} at {}", dataset.display, dataset.wavelength);
                let (display, wavelength, id) = (&first.display, first.wavelength, &first.id);
                let rule = format!("must be of displays/{display} at {wavelength} like datasets/{id}");
                return Err(field.but(problem, rule));
            }
            if datasets.iter().any(|other| other.distance == dataset.distance) {
                let rule = "another dataset is already: each distance may occur once";
                return Err(field.but(format!("is of {}", dataset.distance), rule));
            }
            datasets.push(dataset);
            common_display = Some(display);
        }
        match common_display {
            Some(display) => Ok((datasets, display)),
            None => Err(field.but("is empty", "must name a finalized dataset")),
        }
    }

    /// Refuses a model that cannot describe the display.
    pub fn require_learnable(&self, field: &Field, model: KernelModel, display: &Display) -> Result<()> {
        if model.is_smooth() || !display.orders.are_all() {
            return Ok(());
        }
        let problem =
            format!("has a value for each frequency, but displays/{} shows all diffraction orders", display.id);
        Err(field.invalid(problem, "use smooth, display or varying"))
    }

    /// The version from which learning starts; `None` if the request names none.
    pub async fn start_version(
        &self,
        field: &Field,
        named: Option<(KernelKey, u32)>,
        is_smooth: bool,
        key: &KernelKey,
    ) -> Result<Option<(KernelKey, u32)>> {
        let Some((kernel, version)) = named else { return Ok(None) };
        if !is_smooth {
            return Err(field.but("is given", "only smooth, display and varying models can start from a version"));
        }
        let name = format!("{kernel}/versions/{version}");
        if kernel != *key {
            return Err(
                field.but(format!("is {name}"), format!("must be a version of {key}, the first dataset's kernel"))
            );
        }
        let start = self.store.kernel_version(key, version).await?;
        if !start.content.model.is_smooth() {
            return Err(
                field.invalid(format!("is {name}, which is not smooth, display or varying"), "name one that is")
            );
        }
        Ok(Some((kernel, version)))
    }
}
