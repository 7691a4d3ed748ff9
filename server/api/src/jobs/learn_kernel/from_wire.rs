//! Checking requests to learn a kernel.

use crate::api::Api;
use crate::error::ApiError;
use crate::field::Field;
use crate::jobs::learning_rate::learning_rate;
use crate::kernels::from_wire::model as kernel_model;
use crate::optics::from_wire::{detector, region};
use crate::optics::propagation_checks::check_distance;
use lightpath_domain::access::Caller;
use lightpath_domain::dataset::Dataset;
use lightpath_domain::job::{Detector, LearnKernel};
use lightpath_domain::kernel::{KernelKey, KernelModel};
use lightpath_proto::v1;

/// Epochs that a request may ask for: thirty times as many as the paper uses.
const EPOCHS_MAX: u32 = 1000;
const REFINEMENT_EVALUATIONS_MAX: u32 = 10_000;
/// Joint datasets beside the first: at 1080×1920 px the transfer functions of eight distances take half a gigabyte.
const JOINT_DATASETS_MAX: usize = 7;
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
        let (dataset, display) = self.finalized_dataset(caller, &at("dataset"), &message.dataset).await?;
        check_distance(&at("dataset"), &display, dataset.wavelength, dataset.distance)?;
        let model = kernel_model(&at("model"), message.model)?;
        let refinement = message.refinement_evaluations;
        let refined = model.is_smooth();
        if !refined && refinement.is_some_and(|evaluations| evaluations > 0) {
            return Err(
                at("refinement_evaluations").invalid("is given, but only smooth, display and varying models refine")
            );
        }
        let detector = detector(&at("detector"), message.detector)?;
        if detector == Detector::Supersampled {
            return Err(at("detector").invalid("is supersampled, but a camera's pixels measure either point or pixel"));
        }
        let joint_datasets =
            self.joint_datasets(caller, &at("joint_datasets"), &message.joint_datasets, model, &dataset).await?;
        let key = KernelKey { display: display.id.clone(), wavelength: dataset.wavelength, distance: dataset.distance };
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
            joint_datasets,
            dataset: dataset.id,
        })
    }

    /// The ids of the joint datasets, which may differ from the first dataset in distance only.
    async fn joint_datasets(
        &self,
        caller: &Caller,
        field: &Field,
        names: &[String],
        model: KernelModel,
        first: &Dataset,
    ) -> Result<Vec<String>, ApiError> {
        if !names.is_empty() && !matches!(model, KernelModel::Smooth | KernelModel::Display) {
            return Err(field.invalid("is given, but only the models smooth and display are learned over distances"));
        }
        if names.len() > JOINT_DATASETS_MAX {
            return Err(field.invalid(format!("names {}, but must name at most {JOINT_DATASETS_MAX}", names.len())));
        }
        let mut distances = vec![first.distance];
        let mut ids = Vec::with_capacity(names.len());
        for (i, name) in names.iter().enumerate() {
            let field = field.index(i);
            let (dataset, display) = self.finalized_dataset(caller, &field, name).await?;
            check_distance(&field, &display, dataset.wavelength, dataset.distance)?;
            if (&dataset.display, dataset.wavelength) != (&first.display, first.wavelength) {
                return Err(field.invalid(format!(
                    "is of displays/{} at {}, but must be of displays/{} at {}, as datasets/{} is",
                    dataset.display, dataset.wavelength, first.display, first.wavelength, first.id
                )));
            }
            if distances.contains(&dataset.distance) {
                let problem =
                    format!("is of {}, but another dataset is already: each must have its own", dataset.distance);
                return Err(field.invalid(problem));
            }
            distances.push(dataset.distance);
            ids.push(dataset.id);
        }
        Ok(ids)
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
