//! Checks of requests to learn kernels.

use crate::api::Api;
use crate::call::Call;
use crate::error::ApiError;
use crate::field::Field;
use crate::jobs::learning_rate::learning_rate;
use crate::optics::from_wire::region;
use crate::optics::propagation_checks::check_distance;
use crate::wrong_fields::check_all;
use lightpath_domain::dataset::Dataset;
use lightpath_domain::display::Display;
use lightpath_domain::job::LearnKernel;
use lightpath_domain::kernel::KernelKey;
use lightpath_optics::{Detector, KernelModel};
use lightpath_proto::v1;

/// Limit on the epochs: thirty times as many as the paper uses.
const EPOCHS_MAX: u32 = 1000;
const REFINEMENT_EVALUATIONS_MAX: u32 = 10_000;
/// Limit on the datasets that are learned together: at 1080×1920 px the transfer functions of eight distances need half
/// a gigabyte.
const DATASETS_MAX: usize = 8;
/// Limit on the order of the polynomials: those of higher orders do not describe smooth errors.
const ORDER_MAX: u32 = 12;

impl Api {
    /// Checks a request, looks up the named resources, fills in defaults, and converts the request.
    pub(crate) async fn learn_kernel_spec(
        &self,
        call: &Call,
        message: v1::LearnKernel,
        field: &Field,
    ) -> Result<LearnKernel, ApiError> {
        let at = |name| field.at(name);
        let model = at("model").enum_value::<KernelModel>(message.model).map(Option::unwrap_or_default);
        // If the model is wrong, the other fields are checked for the default one.
        let checked_model = *model.as_ref().unwrap_or(&KernelModel::default());
        let learned = self.datasets_to_learn(call, &at("datasets"), &message.datasets, checked_model).await;
        let region_of_interest = learned
            .as_ref()
            .ok()
            .map(|(_, display)| region(&at("region_of_interest"), message.region_of_interest, display));
        let is_smooth = checked_model.is_smooth();
        let start_version = match &learned {
            Ok((datasets, display)) => {
                let (wavelength, distance) = (datasets[0].wavelength, datasets[0].distance);
                let key = KernelKey { display: display.id.clone(), wavelength, distance };
                self.start_version(&at("start_version"), message.start_version, is_smooth, &key).await
            }
            Err(_) => Ok(None),
        };
        check_all! {
            model = model;
            learned = learned;
            epochs = at("epochs").integer(message.epochs, 0..=EPOCHS_MAX);
            refinement_evaluations =
                refinement(&at("refinement_evaluations"), message.refinement_evaluations, is_smooth);
            learning_rate = learning_rate(&at("learning_rate"), message.learning_rate);
            order = (message.order > 0).then(|| at("order").integer(message.order, 1..=ORDER_MAX)).transpose();
            start_version = start_version;
            detector = detector(&at("detector"), message.detector);
            region_of_interest = region_of_interest.transpose();
        }
        let (datasets, display) = learned;
        if !is_smooth && display.orders.are_all() {
            return Err(at("model").invalid(format!(
                "has a value for each frequency, but displays/{} shows all diffraction orders; use smooth, display or varying",
                display.id
            )));
        }
        Ok(LearnKernel {
            model,
            epochs: (epochs > 0).then_some(epochs),
            refinement_evaluations,
            learning_rate,
            seed: message.seed,
            order,
            start_version,
            detector,
            region_of_interest: at("region_of_interest").required(region_of_interest)?,
            display: display.id,
            datasets: datasets.into_iter().map(|dataset| dataset.id).collect(),
        })
    }

    /// The named datasets and their display. Refuses datasets that differ in more than their distances.
    async fn datasets_to_learn(
        &self,
        call: &Call,
        field: &Field,
        names: &[String],
        model: KernelModel,
    ) -> Result<(Vec<Dataset>, Display), ApiError> {
        if names.len() > 1 && !matches!(model, KernelModel::Smooth | KernelModel::Display) {
            return Err(
                field.invalid("has several entries, but only smooth and display models are learned from several")
            );
        }
        if names.len() > DATASETS_MAX {
            return Err(field.invalid(format!("has {} entries, but at most {DATASETS_MAX} are accepted", names.len())));
        }
        let mut datasets: Vec<Dataset> = Vec::with_capacity(names.len());
        let mut common_display = None;
        for (i, name) in names.iter().enumerate() {
            let field = field.index(i);
            let (dataset, display) = self.finalized_dataset(call, &field, name).await?;
            check_distance(&field, &display, dataset.wavelength, dataset.distance)?;
            if let Some(first) = datasets.first()
                && (&dataset.display, dataset.wavelength) != (&first.display, first.wavelength)
            {
                return Err(field.invalid(format!(
                    "is of displays/{} at {}, but must be of displays/{} at {} like datasets/{}",
                    dataset.display, dataset.wavelength, first.display, first.wavelength, first.id
                )));
            }
            if datasets.iter().any(|other| other.distance == dataset.distance) {
                let problem =
                    format!("is of {}, but another dataset is already: each distance may occur once", dataset.distance);
                return Err(field.invalid(problem));
            }
            datasets.push(dataset);
            common_display = Some(display);
        }
        match common_display {
            Some(display) => Ok((datasets, display)),
            None => Err(field.invalid("is empty, but must name a finalized dataset")),
        }
    }

    /// The version from which learning starts; `None` if the request names none.
    async fn start_version(
        &self,
        field: &Field,
        version: u32,
        is_smooth: bool,
        key: &KernelKey,
    ) -> Result<Option<u32>, ApiError> {
        if version == 0 {
            return Ok(None);
        }
        if !is_smooth {
            return Err(field.invalid("is given, but only smooth, display and varying models can start from a version"));
        }
        let start = self.store.kernel_version(key, version).await?;
        if !start.content.model.is_smooth() {
            let problem = format!(
                "is {version}, but {key}/versions/{version} is not smooth, display or varying; name one that is"
            );
            return Err(field.invalid(&problem));
        }
        Ok(Some(version))
    }
}

/// Checks the number of refining evaluations, which only smooth models have.
fn refinement(field: &Field, given: Option<u32>, is_smooth: bool) -> Result<Option<u32>, ApiError> {
    if !is_smooth && given.is_some_and(|evaluations| evaluations > 0) {
        return Err(field.invalid("is given, but only smooth, display and varying models are refined"));
    }
    given.map(|given| field.integer(given, 0..=REFINEMENT_EVALUATIONS_MAX)).transpose()
}

/// Checks what the camera's pixels measure.
fn detector(field: &Field, number: i32) -> Result<Detector, ApiError> {
    match field.enum_value::<Detector>(number)?.unwrap_or_default() {
        Detector::Supersampled => {
            Err(field.invalid("is supersampled, but must be point or pixel, which a camera measures"))
        }
        detector => Ok(detector),
    }
}
