//! Checking requests to learn a kernel.

use crate::api::Api;
use crate::error::ApiError;
use crate::field::Field;
use crate::jobs::learning_rate::learning_rate;
use crate::optics::from_wire::region;
use crate::optics::propagation_checks::check_distance;
use lightpath_domain::access::Caller;
use lightpath_domain::dataset::Dataset;
use lightpath_domain::display::Display;
use lightpath_domain::job::LearnKernel;
use lightpath_domain::kernel::KernelKey;
use lightpath_optics::{Detector, KernelModel};
use lightpath_proto::v1;

/// Epochs that a request may ask for: thirty times as many as the paper uses.
const EPOCHS_MAX: u32 = 1000;
const REFINEMENT_EVALUATIONS_MAX: u32 = 10_000;
/// Datasets that are learned together: at 1080×1920 px the transfer functions of eight distances take half a gigabyte.
const DATASETS_MAX: usize = 8;
/// Highest order of the polynomials: those of higher orders do not describe smooth errors.
const ORDER_MAX: u32 = 12;

impl Api {
    /// The job that a request asks for: every field checked, every default filled in, every name found.
    pub(crate) async fn learn_kernel_spec(
        &self,
        caller: &Caller,
        message: v1::LearnKernel,
        field: &Field,
    ) -> Result<LearnKernel, ApiError> {
        let at = |name| field.at(name);
        let model = at("model").one_of::<KernelModel>(message.model)?.unwrap_or_default();
        let (datasets, display) = self.datasets_to_learn(caller, &at("datasets"), &message.datasets, model).await?;
        let refinement = message.refinement_evaluations;
        let refined = model.is_smooth();
        if !refined && refinement.is_some_and(|evaluations| evaluations > 0) {
            return Err(
                at("refinement_evaluations").invalid("is given, but only smooth, display and varying models refine")
            );
        }
        let detector = at("detector").one_of::<Detector>(message.detector)?.unwrap_or_default();
        if detector == Detector::Supersampled {
            return Err(at("detector").invalid("is supersampled, but a camera's pixels measure either point or pixel"));
        }
        let (wavelength, distance) = (datasets[0].wavelength, datasets[0].distance);
        let key = KernelKey { display: display.id.clone(), wavelength, distance };
        let epochs = at("epochs").integer(message.epochs, 0..=EPOCHS_MAX)?;
        let evaluations = at("refinement_evaluations");
        Ok(LearnKernel {
            model,
            epochs: (epochs > 0).then_some(epochs),
            refinement_evaluations: refinement
                .map(|given| evaluations.integer(given, 0..=REFINEMENT_EVALUATIONS_MAX))
                .transpose()?,
            learning_rate: learning_rate(&at("learning_rate"), message.learning_rate)?,
            seed: message.seed,
            order: (message.order > 0).then(|| at("order").integer(message.order, 1..=ORDER_MAX)).transpose()?,
            start_version: self.start_version(&at("start_version"), message.start_version, refined, &key).await?,
            detector,
            region_of_interest: region(&at("region_of_interest"), message.region_of_interest, &display)?,
            display: display.id,
            datasets: datasets.into_iter().map(|dataset| dataset.id).collect(),
        })
    }

    /// The datasets, which may differ in their distances only, and their display.
    async fn datasets_to_learn(
        &self,
        caller: &Caller,
        field: &Field,
        names: &[String],
        model: KernelModel,
    ) -> Result<(Vec<Dataset>, Display), ApiError> {
        if names.len() > 1 && !matches!(model, KernelModel::Smooth | KernelModel::Display) {
            return Err(field.invalid("are several, but only the models smooth and display are learned over distances"));
        }
        if names.len() > DATASETS_MAX {
            return Err(field.invalid(format!("has {} entries, but at most {DATASETS_MAX} are accepted", names.len())));
        }
        let mut datasets: Vec<Dataset> = Vec::with_capacity(names.len());
        let mut of_display = None;
        for (i, name) in names.iter().enumerate() {
            let field = field.index(i);
            let (dataset, display) = self.finalized_dataset(caller, &field, name).await?;
            check_distance(&field, &display, dataset.wavelength, dataset.distance)?;
            if let Some(first) = datasets.first()
                && (&dataset.display, dataset.wavelength) != (&first.display, first.wavelength)
            {
                return Err(field.invalid(format!(
                    "is of displays/{} at {}, but must be of displays/{} at {}, as datasets/{} is",
                    dataset.display, dataset.wavelength, first.display, first.wavelength, first.id
                )));
            }
            if datasets.iter().any(|other| other.distance == dataset.distance) {
                let problem =
                    format!("is of {}, but another dataset is already: each must have its own", dataset.distance);
                return Err(field.invalid(problem));
            }
            datasets.push(dataset);
            of_display = Some(display);
        }
        match of_display {
            Some(display) => Ok((datasets, display)),
            None => Err(field.invalid("is empty, but must name a finalized dataset")),
        }
    }

    /// The version that learning starts from; `None` where the request names none.
    async fn start_version(
        &self,
        field: &Field,
        version: u32,
        refined: bool,
        key: &KernelKey,
    ) -> Result<Option<u32>, ApiError> {
        if version == 0 {
            return Ok(None);
        }
        if !refined {
            return Err(field.invalid("is given, but only smooth, display and varying models can start from a version"));
        }
        let start = self.store.kernel_version(key, version).await?;
        if !start.content.model.is_smooth() {
            let problem = format!("is {version}, but {key}/versions/{version} has no smooth kernel; name one that has");
            return Err(field.invalid(&problem));
        }
        Ok(Some(version))
    }
}
