//! Jobs that optimize holograms, and their results, as messages.

use crate::datasets::to_wire::encoding;
use crate::jobs::kernel_choice::kernel_named;
use crate::optics::to_wire::{detector, propagation_method, quality, region, validity_report};
use lightpath_domain::job::{
    Fit, HologramResult, ImagePlane, InitialPhase, Loss, Method, OptimizeHologram, PlaneResult, Quantity,
    WavelengthResult,
};
use lightpath_proto::v1::{
    self, hologram_result,
    optimize_hologram::{self, initial_phase::Kind, loss},
};

/// What was asked for, with its defaults.
pub(crate) fn spec(spec: OptimizeHologram) -> v1::OptimizeHologram {
    let (wavelengths, planes) = (spec.wavelengths(), spec.planes());
    let versions = spec.kernel_versions.iter().map(|version| version.unwrap_or(0)).collect();
    let several = spec.kernel_versions.len() > 1;
    let with_range = matches!(spec.initial_phase, InitialPhase::Random | InitialPhase::BackPropagated);
    let mut message = v1::OptimizeHologram {
        display: format!("displays/{}", spec.display),
        wavelength_m: spec.wavelength.m(),
        distance_m: spec.distance.m(),
        target: spec.target,
        target_encoding: encoding(spec.target_encoding),
        target_fit: fit(spec.target_fit).into(),
        // Several kernels have no common choice: the versions tell.
        kernel: if several { String::new() } else { kernel_named(spec.kernel_version) },
        kernel_version: spec.kernel_version.unwrap_or(0),
        method: method(spec.method).into(),
        detector: detector(spec.detector),
        iterations: spec.iterations,
        learning_rate: if spec.method == Method::Adam { spec.learning_rate } else { 0.0 },
        seed: spec.seed,
        initial_phase_range_rad: with_range.then_some(spec.initial_phase_range_rad),
        region_of_interest: Some(region(spec.region_of_interest)),
        frames: spec.frames,
        initial_phase: Some(initial_phase(spec.initial_phase)),
        loss: Some(loss_of(spec.loss)),
        weight_mask: spec.weight_mask.unwrap_or_default(),
        quantization_aware: spec.quantization_aware,
        kernel_versions: versions,
        propagation: spec.propagation.map_or(v1::PropagationMethod::Unspecified, propagation_method).into(),
        ..v1::OptimizeHologram::default()
    };
    if wavelengths.len() > 1 {
        message.wavelength_m = 0.0;
        message.wavelengths_m = wavelengths.iter().map(|wavelength| wavelength.m()).collect();
    }
    if let Some(map) = spec.depth_map {
        message.distance_m = 0.0;
        let distances_m = planes.iter().map(|plane| plane.distance.m()).collect();
        message.depth_map = Some(optimize_hologram::DepthMap { map, distances_m });
    } else if planes.len() > 1 {
        (message.distance_m, message.target) = (0.0, String::new());
        message.planes = planes.into_iter().map(image_plane).collect();
    }
    message
}

fn image_plane(plane: ImagePlane) -> optimize_hologram::ImagePlane {
    let ImagePlane { distance, target, weight } = plane;
    optimize_hologram::ImagePlane { distance_m: distance.m(), target, weight }
}

fn fit(fit: Fit) -> optimize_hologram::Fit {
    match fit {
        Fit::Contain => optimize_hologram::Fit::Contain,
        Fit::Cover => optimize_hologram::Fit::Cover,
        Fit::Stretch => optimize_hologram::Fit::Stretch,
        Fit::Exact => optimize_hologram::Fit::Exact,
    }
}

fn method(method: Method) -> optimize_hologram::Method {
    match method {
        Method::Adam => optimize_hologram::Method::Adam,
        Method::Lbfgs => optimize_hologram::Method::Lbfgs,
        Method::GerchbergSaxton => optimize_hologram::Method::GerchbergSaxton,
        Method::WeightedGerchbergSaxton => optimize_hologram::Method::WeightedGerchbergSaxton,
        Method::DoublePhase => optimize_hologram::Method::DoublePhase,
    }
}

fn initial_phase(initial: InitialPhase) -> optimize_hologram::InitialPhase {
    let of_kind = |kind: Kind| optimize_hologram::InitialPhase { kind: kind.into(), ..Default::default() };
    match initial {
        InitialPhase::Random => of_kind(Kind::Random),
        InitialPhase::BackPropagated => of_kind(Kind::BackPropagated),
        InitialPhase::Quadratic { focal_length_m } => optimize_hologram::InitialPhase {
            focal_length_m: focal_length_m.unwrap_or(0.0),
            ..of_kind(Kind::Quadratic)
        },
        InitialPhase::Constant { phase_rad } => {
            optimize_hologram::InitialPhase { constant_rad: phase_rad, ..of_kind(Kind::Constant) }
        }
        InitialPhase::Given(phases) => optimize_hologram::InitialPhase { phases, ..of_kind(Kind::Given) },
    }
}

fn loss_of(loss: Loss) -> optimize_hologram::Loss {
    let quantity = match loss.quantity {
        Quantity::Intensity => loss::Quantity::Intensity,
        Quantity::Amplitude => loss::Quantity::Amplitude,
    };
    let Loss { total_variation, speckle, speckle_block_px, .. } = loss;
    optimize_hologram::Loss { quantity: quantity.into(), total_variation, speckle, speckle_block_px }
}

/// What was found.
pub(crate) fn result(result: HologramResult) -> v1::HologramResult {
    v1::HologramResult {
        phase: result.phase,
        phase_npy: result.phase_npy,
        reconstruction: result.reconstruction,
        quality: Some(quality(result.quality)),
        quantized_quality: Some(quality(result.quantized_quality)),
        intensity_scale: result.intensity_scale,
        loss: result.loss,
        iterations: result.iterations,
        iteration_ms: result.iteration_ms,
        region_of_interest: Some(region(result.region_of_interest)),
        wavelengths: result.wavelengths.into_iter().map(wavelength_result).collect(),
        colour_reconstructions: result.colour_reconstructions,
    }
}

fn wavelength_result(result: WavelengthResult) -> hologram_result::WavelengthResult {
    let frames = result.frames.into_iter();
    hologram_result::WavelengthResult {
        wavelength_m: result.wavelength.m(),
        frames: frames.map(|frame| hologram_result::Frame { phase: frame.phase, phase_npy: frame.phase_npy }).collect(),
        planes: result.planes.into_iter().map(plane_result).collect(),
        intensity_scale: result.intensity_scale,
        loss: result.loss,
        largest_amplitude: result.largest_amplitude,
    }
}

fn plane_result(plane: PlaneResult) -> hologram_result::PlaneResult {
    hologram_result::PlaneResult {
        distance_m: plane.distance.m(),
        reconstruction: plane.reconstruction,
        quality: Some(quality(plane.quality)),
        quantized_quality: Some(quality(plane.quantized_quality)),
        propagation: plane.propagation.map(validity_report),
    }
}
