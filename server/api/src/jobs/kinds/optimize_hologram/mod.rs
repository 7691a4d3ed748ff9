//! Hologram jobs: optimized phases that show pictures.

mod planes;
mod search;

use super::kernel_choice;
use crate::api::Api;
use crate::enumerations::{OnWire as _, WireField as _};
use crate::optics::from_wire::{convolution_method, region};
use crate::optics::to_wire::{engine_judgements, opinions, other_orders, place, region_message, validity_report};
use lightpath_domain::dataset::Encoding;
use lightpath_domain::display::Display;
use lightpath_domain::expected_psnr::ExpectedPsnr;
use lightpath_domain::job::{
    Area, HologramResult, ImagePlane, Job, JudgedBy, OptimizeHologram, PlaneResult, Subframe, WavelengthResult,
};
use lightpath_domain::kernel::KernelKey;
use lightpath_domain::units::Wavelength;
use lightpath_optics::hologram::Loss;
use lightpath_optics::{Detector, HologramMethod, InitialPhase, PropagationMethod, RegionOfInterest};
use lightpath_proto::v1::{
    self,
    judgement::Stage,
    optimize_hologram::{
        self,
        initial_phase::{Constant, Given, Kind, Lens, Random},
    },
    optimize_hologram_result,
};
use lightpath_service::{Call, Field, KernelChoice, Result, check_all};

/// Limit on the subframes: the fastest phase modulators show no more within the eye's integration time.
const SUBFRAMES_MAX: u32 = 24;

/// What depends on the display of a request.
struct Shown {
    display: Display,
    wavelengths: Vec<Wavelength>,
    region_of_interest: RegionOfInterest,
}

impl Shown {
    fn on(display: Display, field: &Field, message: &v1::OptimizeHologram) -> Result<Self> {
        check_all! {
            wavelengths = planes::wavelengths(field, message, &display);
            region_of_interest = region(&field.at("region"), message.region, &display);
        }
        Ok(Self { display, wavelengths, region_of_interest })
    }
}

/// Checks a request, looks up the named resources, fills in defaults, and converts the request. Returns also the
/// largest memory for decoding one of its pictures \[bytes\]. `before` is the job of an earlier submission of the
/// same request.
pub(super) async fn from_wire(
    api: &Api,
    call: &Call,
    message: v1::OptimizeHologram,
    field: &Field,
    before: Option<&Job>,
) -> Result<(OptimizeHologram, u64)> {
    let at = |name| field.at(name);
    let display = api.display_named(call, &at("display"), &message.display).await;
    let shown = display.and_then(|display| Shown::on(display, field, &message));
    let method = search::method(field, &message);
    let detector = at("detector").enum_value(message.detector).map(Option::unwrap_or_default);
    let subframes = at("subframes").integer_or(message.subframes, 1, 1..=SUBFRAMES_MAX);
    // The default and the limits of the initial phase depend on these. If one of them is wrong, its default serves.
    let phases = search::PhaseDefaults {
        method: *method.as_ref().unwrap_or(&HologramMethod::Lbfgs),
        detector: *detector.as_ref().unwrap_or(&Detector::default()),
        subframes: *subframes.as_ref().unwrap_or(&1),
        wavelengths: message.wavelengths_m.len().max(1),
    };
    let region = shown.as_ref().ok().map(|shown| shown.region_of_interest);
    check_all! {
        shown = shown;
        planes = planes::planes(&at("planes"), &message.planes);
        depth_map = planes::depth_map(&at("depth_map"), &message.depth_map, message.planes.len());
        target_encoding = at("target_encoding").enum_value(message.target_encoding);
        target_fit = at("target_fit").enum_value(message.target_fit);
        target_area = at("target_area").enum_value(message.target_area);
        propagation = convolution_method(&at("propagation"), message.propagation);
        method = method;
        iterations = search::iterations(&at("iterations"), &message);
        judge = search::judge(&at("judge"), &message);
        subframes = subframes;
        initial_phase = search::initial_phase(&at("initial_phase"), message.initial_phase, phases);
        loss = search::loss(&at("loss"), message.loss, region);
        detector = detector;
        weight_mask = planes::optional_digest(&at("weight_mask"), &message.weight_mask);
        kernel = kernel_choice::from_wire(call, &at("kernel"), message.kernel, KernelChoice::ActiveOrIdeal);
    }
    let Shown { display, wavelengths, region_of_interest } = shown;
    let target_fit = target_fit.unwrap_or_default();
    let target_area = target_area.unwrap_or(Area::recommended(target_fit));
    let spec = OptimizeHologram {
        display: display.id.clone(),
        wavelengths,
        planes,
        depth_map,
        target_encoding: target_encoding.unwrap_or(Encoding::Srgb),
        target_fit,
        target_area,
        kernel_versions: Vec::new(),
        judging_versions: Vec::new(),
        propagation,
        method,
        iterations,
        subframes,
        initial_phase,
        seed: message.seed,
        loss,
        detector,
        region_of_interest,
        weight_mask,
        quantization_aware: message.quantization_aware,
        judge,
    };
    api.service.jobs.complete_hologram(call, field, (spec, &display), &kernel, before).await
}

/// Converts the request, with its defaults and the kernels that it uses, into its message.
pub(super) fn to_wire(spec: OptimizeHologram, kernels: &[(KernelKey, Option<u32>)]) -> v1::OptimizeHologram {
    let (method, learning_rate) = method(spec.method);
    v1::OptimizeHologram {
        display: format!("displays/{}", spec.display),
        wavelengths_m: spec.wavelengths.iter().map(|wavelength| wavelength.m()).collect(),
        planes: spec.planes.into_iter().map(plane).collect(),
        depth_map: spec.depth_map.unwrap_or_default(),
        target_encoding: spec.target_encoding.to_wire(),
        target_fit: spec.target_fit.to_wire(),
        target_area: spec.target_area.to_wire(),
        kernel: kernel_choice::to_wire(kernels),
        propagation: spec.propagation.map_or(0, |method| PropagationMethod::from(method).to_wire()),
        method: method.into(),
        iterations: Some(spec.iterations),
        learning_rate,
        subframes: Some(spec.subframes),
        initial_phase: Some(initial_phase(spec.initial_phase)),
        seed: spec.seed,
        loss: Some(loss_to_wire(spec.loss)),
        detector: spec.detector.to_wire(),
        region: Some(region_message(spec.region_of_interest)),
        weight_mask: spec.weight_mask.unwrap_or_default(),
        quantization_aware: spec.quantization_aware,
        judge: spec.judge.to_wire(),
    }
}

fn plane(plane: ImagePlane) -> optimize_hologram::ImagePlane {
    let ImagePlane { distance, target, weight } = plane;
    optimize_hologram::ImagePlane { place: place(distance), target, weight: Some(weight) }
}

/// The method and its learning rate.
fn method(method: HologramMethod) -> (v1::HologramMethod, Option<f64>) {
    match method {
        HologramMethod::Adam { learning_rate } => (v1::HologramMethod::Adam, Some(learning_rate)),
        HologramMethod::Lbfgs => (v1::HologramMethod::Lbfgs, None),
        HologramMethod::GerchbergSaxton => (v1::HologramMethod::GerchbergSaxton, None),
        HologramMethod::WeightedGerchbergSaxton => (v1::HologramMethod::WeightedGerchbergSaxton, None),
        HologramMethod::DoublePhase => (v1::HologramMethod::DoublePhase, None),
    }
}

fn initial_phase(initial: InitialPhase<Vec<String>>) -> optimize_hologram::InitialPhase {
    let random = |range_rad| Random { range_rad: Some(range_rad) };
    let kind = match initial {
        InitialPhase::Random { range_rad } => Kind::Random(random(range_rad)),
        InitialPhase::BackPropagated { range_rad } => Kind::BackPropagated(random(range_rad)),
        InitialPhase::Quadratic { focal_length_m } => Kind::Quadratic(Lens { focal_length_m }),
        InitialPhase::Constant { phase_rad } => Kind::Constant(Constant { phase_rad }),
        InitialPhase::Given(phases) => Kind::Given(Given { phases }),
    };
    optimize_hologram::InitialPhase { kind: Some(kind) }
}

fn loss_to_wire(loss: Loss) -> optimize_hologram::Loss {
    let Loss { quantity, total_variation, speckle, speckle_block_px } = loss;
    let (quantity, speckle_block_px) = (quantity.to_wire(), Some(speckle_block_px as u32));
    optimize_hologram::Loss { quantity, total_variation, speckle, speckle_block_px }
}

/// Converts the result into its message.
pub(super) fn result(result: HologramResult) -> v1::OptimizeHologramResult {
    let detector = result.detector;
    v1::OptimizeHologramResult {
        wavelengths: result.wavelengths.into_iter().map(|each| wavelength_result(each, detector)).collect(),
        colour_reconstructions: result.colour_reconstructions,
        iterations: result.iterations,
        iteration_time_s: result.iteration_time_s,
        judged: result.judged.to_wire(),
        computed_by: result.computed_by.unwrap_or_default(),
    }
}

fn wavelength_result(result: WavelengthResult, detector: Detector) -> optimize_hologram_result::WavelengthResult {
    let subframes = result.subframes.into_iter();
    optimize_hologram_result::WavelengthResult {
        wavelength_m: result.wavelength.m(),
        subframes: subframes
            .map(|Subframe { pattern, phase }| optimize_hologram_result::Subframe { pattern, phase })
            .collect(),
        planes: result.planes.into_iter().map(|plane| plane_result(plane, detector)).collect(),
        intensity_scale: result.intensity_scale,
        loss: result.loss,
        largest_amplitude: result.largest_amplitude,
        notes: result.notes,
    }
}

fn plane_result(plane: PlaneResult, detector: Detector) -> optimize_hologram_result::PlaneResult {
    let by_engine = |quality, stage| engine_judgements(quality, stage).collect::<Vec<v1::Judgement>>();
    let mut own = plane.quantized_quality.map_or_else(Vec::new, |quality| by_engine(quality, Stage::Displayed));
    let mut by_best = plane.judged_by.map(|JudgedBy { key, version, quality }| {
        let kernel_version = format!("{key}/versions/{version}");
        let displayed = engine_judgements(quality, Stage::Displayed);
        displayed.map(|judged| v1::Judgement { kernel_version: kernel_version.clone(), ..judged }).collect()
    });
    mark_headline(by_best.as_mut().unwrap_or(&mut own), plane.in_photograph);
    let mut judgements = own;
    judgements.extend(plane.quality.into_iter().flat_map(|quality| by_engine(quality, Stage::Optimized)));
    judgements.extend(plane.other_orders_psnr_db.map(other_orders));
    judgements.extend(plane.second_opinion.into_iter().flat_map(|opinion| opinions(opinion, detector)));
    judgements.extend(by_best.into_iter().flatten());
    optimize_hologram_result::PlaneResult {
        place: place(plane.distance),
        reconstruction: plane.reconstruction,
        judgements,
        propagation: Some(validity_report(plane.propagation)),
    }
}

/// Marks the headline among the judgements of displayed phases by the best model: that of a camera, which integrates the
/// light over its pixels; with the error of the model, if it is known.
fn mark_headline(displayed: &mut Vec<v1::Judgement>, in_photograph: Option<ExpectedPsnr>) {
    let Some(camera) = displayed.iter_mut().find(|judged| judged.detector() == v1::Detector::Pixel) else { return };
    match in_photograph {
        None => camera.headline = true,
        Some(ExpectedPsnr { psnr_db, std_db }) => {
            let psnr_db = Some(v1::Measure { value: psnr_db, std: Some(std_db), ..v1::Measure::default() });
            let stage = Stage::Photographed.into();
            let headline = v1::Judgement { headline: true, stage, psnr_db, ..camera.clone() };
            displayed.push(headline);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headline_has_the_error_of_the_model_if_it_is_known() {
        let judged = |detector: v1::Detector| v1::Judgement {
            detector: detector.into(),
            stage: Stage::Displayed.into(),
            psnr_db: Some(v1::Measure { value: 46.0, ..v1::Measure::default() }),
            ssim: Some(0.9),
            ..v1::Judgement::default()
        };
        let displayed = vec![judged(v1::Detector::Point), judged(v1::Detector::Pixel)];
        let marked = |in_photograph| {
            let mut judgements = displayed.clone();
            mark_headline(&mut judgements, in_photograph);
            judgements
        };
        let headline = v1::Judgement { headline: true, ..displayed[1].clone() };
        assert_eq!(marked(None), [displayed[0].clone(), headline.clone()]);
        let psnr_db = Some(v1::Measure { value: 40.0, std: Some(1.25), ..v1::Measure::default() });
        let expected = v1::Judgement { stage: Stage::Photographed.into(), psnr_db, ..headline };
        let found = marked(Some(ExpectedPsnr { psnr_db: 40.0, std_db: 1.25 }));
        assert_eq!(found, [displayed[0].clone(), displayed[1].clone(), expected]);
    }
}
