//! Learning jobs: kernels learned from datasets.

use super::learning_rate::learning_rate;
use crate::api::Api;
use crate::enumerations::{OnWire as _, WireField as _};
use crate::kernels::to_wire::{metrics, parts};
use crate::names;
use crate::optics::from_wire::region;
use crate::optics::to_wire::{region_message, validity_report};
use lightpath_domain::job::{LearnKernel, LearnResult, LearnedKernel};
use lightpath_domain::lineage::LearningParameters;
use lightpath_optics::{Detector, KernelModel};
use lightpath_proto::v1;
use lightpath_service::{Call, Field, Result, check_all};

/// Limit on the epochs: thirty times as many as the paper uses.
const EPOCHS_MAX: u32 = 1000;
const REFINEMENT_EVALUATIONS_MAX: u32 = 10_000;
/// Limit on the degree of the polynomials: those of higher degrees do not describe smooth errors.
const DEGREE_MAX: u32 = 12;
/// What the settings of the optimizer are if they are left out.
const OF_MODEL: &str = "the model's default";

/// Checks a request, looks up the named resources, fills in defaults, and converts the request.
pub(super) async fn from_wire(api: &Api, call: &Call, message: v1::LearnKernel, field: &Field) -> Result<LearnKernel> {
    let at = |name| field.at(name);
    let model = at("model").enum_value::<KernelModel>(message.model).map(Option::unwrap_or_default);
    // If the model is wrong, the other fields are checked for the default one.
    let checked_model = *model.as_ref().unwrap_or(&KernelModel::default());
    let list = at("datasets");
    let names = message.datasets.iter().enumerate();
    let ids = names.map(|(i, name)| names::dataset_id(&list.index(i), name)).collect();
    let learned = api.service.jobs.datasets_to_learn(call, &list, ids, checked_model).await;
    let region_of_interest = learned.as_ref().ok().map(|(_, display)| region(&at("region"), message.region, display));
    let is_smooth = checked_model.is_smooth();
    let start_version = match &learned {
        Ok((datasets, _)) => {
            let key = datasets[0].kernel_key();
            let field = at("start_version");
            let named = (!message.start_version.is_empty())
                .then(|| names::kernel_version(call, &field, &message.start_version))
                .transpose();
            match named {
                Ok(named) => api.service.jobs.start_version(&field, named, is_smooth, &key).await,
                Err(refusal) => Err(refusal),
            }
        }
        Err(_) => Ok(None),
    };
    check_all! {
        model = model;
        learned = learned;
        epochs = at("epochs").if_set(message.epochs, OF_MODEL, |epochs| at("epochs").integer(epochs, 1..=EPOCHS_MAX));
        refinement_evaluations =
            refinement(&at("refinement_evaluations"), message.refinement_evaluations, is_smooth);
        learning_rate = learning_rate(&at("learning_rate"), message.learning_rate, OF_MODEL);
        degree = degree(&at("degree"), message.degree);
        start_version = start_version;
        detector = detector(&at("detector"), message.detector);
        region_of_interest = region_of_interest.transpose();
    }
    let (datasets, display) = learned;
    api.service.jobs.require_learnable(&at("model"), model, &display)?;
    Ok(LearnKernel {
        display: display.id,
        datasets: datasets.into_iter().map(|dataset| dataset.id).collect(),
        start_version,
        parameters: LearningParameters {
            model,
            degree,
            epochs,
            learning_rate,
            refinement_evaluations,
            seed: message.seed,
            detector,
            region_of_interest: at("region").required(region_of_interest)?,
        },
    })
}

/// Checks the degree of the polynomials, which the validation pairs choose if it is left out.
fn degree(field: &Field, degree: Option<u32>) -> Result<Option<u32>> {
    field.if_set(degree, "the one that predicts best", |degree| field.integer(degree, 1..=DEGREE_MAX))
}

/// Checks the number of refining evaluations, which only smooth models have.
fn refinement(field: &Field, given: Option<u32>, is_smooth: bool) -> Result<Option<u32>> {
    if !is_smooth && given.is_some_and(|evaluations| evaluations > 0) {
        return Err(field.but("is given", "only smooth, display and varying models are refined"));
    }
    given.map(|given| field.integer(given, 0..=REFINEMENT_EVALUATIONS_MAX)).transpose()
}

/// Checks what the camera's pixels measure.
fn detector(field: &Field, number: i32) -> Result<Detector> {
    match field.enum_value::<Detector>(number)?.unwrap_or_default() {
        Detector::Supersampled => Err(field.but("is supersampled", "must be point or pixel, which a camera measures")),
        detector => Ok(detector),
    }
}

/// Converts the request, with its defaults, into its message.
pub(super) fn to_wire(LearnKernel { datasets, display: _, start_version, parameters }: LearnKernel) -> v1::LearnKernel {
    v1::LearnKernel {
        datasets: datasets.iter().map(|id| format!("datasets/{id}")).collect(),
        start_version: start_version
            .map_or_else(String::new, |(kernel, version)| format!("{kernel}/versions/{version}")),
        model: parameters.model.to_wire(),
        degree: parameters.degree,
        epochs: parameters.epochs,
        learning_rate: parameters.learning_rate,
        refinement_evaluations: parameters.refinement_evaluations,
        seed: parameters.seed,
        detector: parameters.detector.to_wire(),
        region: Some(region_message(parameters.region_of_interest)),
    }
}

/// Converts the result into its message.
pub(super) fn result(result: LearnResult) -> v1::LearnKernelResult {
    v1::LearnKernelResult {
        kernels: result.kernels.into_iter().map(kernel).collect(),
        loss_history: result.loss_history,
        degree: (result.degree > 0).then_some(result.degree),
        parts: result.parts.into_iter().map(parts::learned).collect(),
    }
}

fn kernel(kernel: LearnedKernel) -> v1::learn_kernel_result::LearnedKernel {
    v1::learn_kernel_result::LearnedKernel {
        kernel_version: kernel.kernel_version,
        dataset: format!("datasets/{}", kernel.dataset),
        metrics: metrics(&kernel.metrics),
        left_out_pairs: kernel.left_out_pairs,
        propagation: Some(validity_report(kernel.propagation)),
    }
}
