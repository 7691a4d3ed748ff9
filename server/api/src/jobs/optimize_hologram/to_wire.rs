//! Conversion of the requests and results of hologram jobs into messages.

use crate::enumerations::OnWire as _;
use crate::jobs::kernel_choice::kernel_text;
use crate::optics::to_wire::{quality, region, second_opinion, validity_report};
use lightpath_domain::job::{HologramResult, ImagePlane, OptimizeHologram, PlaneResult, WavelengthResult};
use lightpath_optics::hologram::Loss;
use lightpath_optics::{HologramMethod, InitialPhase, PropagationMethod};
use lightpath_proto::v1::{
    self, hologram_result,
    optimize_hologram::{
        self,
        initial_phase::{Constant, Given, Kind, Lens, Random},
    },
};

/// Converts the request, with its defaults, into its message.
pub(crate) fn spec(spec: OptimizeHologram) -> v1::OptimizeHologram {
    let (method, learning_rate) = method(spec.method);
    v1::OptimizeHologram {
        display: format!("displays/{}", spec.display),
        wavelengths_m: spec.wavelengths.iter().map(|wavelength| wavelength.m()).collect(),
        planes: spec.planes.into_iter().map(plane).collect(),
        depth_map: spec.depth_map.unwrap_or_default(),
        target_encoding: spec.target_encoding.to_wire(),
        target_fit: spec.target_fit.to_wire(),
        kernel: kernel(&spec.kernel_versions),
        propagation: spec.propagation.map_or(0, |method| PropagationMethod::from(method).to_wire()),
        method: method.into(),
        iterations: spec.iterations,
        learning_rate,
        frames: spec.frames,
        initial_phase: Some(initial_phase(spec.initial_phase)),
        seed: spec.seed,
        loss: Some(loss(spec.loss)),
        detector: spec.detector.to_wire(),
        region_of_interest: Some(region(spec.region_of_interest)),
        weight_mask: spec.weight_mask.unwrap_or_default(),
        quantization_aware: spec.quantization_aware,
    }
}

fn plane(plane: ImagePlane) -> optimize_hologram::ImagePlane {
    let ImagePlane { distance, target, weight } = plane;
    optimize_hologram::ImagePlane { distance_m: distance.m(), target, weight }
}

/// Text for the version in the field `kernel`. It is empty for several versions; the message of the job lists them.
fn kernel(versions: &[Vec<Option<u32>>]) -> String {
    match versions.concat()[..] {
        [version] => kernel_text(version),
        _ => String::new(),
    }
}

/// The method and its learning rate.
fn method(method: HologramMethod) -> (v1::HologramMethod, f64) {
    match method {
        HologramMethod::Adam { learning_rate } => (v1::HologramMethod::Adam, learning_rate),
        HologramMethod::Lbfgs => (v1::HologramMethod::Lbfgs, 0.0),
        HologramMethod::GerchbergSaxton => (v1::HologramMethod::GerchbergSaxton, 0.0),
        HologramMethod::WeightedGerchbergSaxton => (v1::HologramMethod::WeightedGerchbergSaxton, 0.0),
        HologramMethod::DoublePhase => (v1::HologramMethod::DoublePhase, 0.0),
    }
}

fn initial_phase(initial: InitialPhase<Vec<String>>) -> optimize_hologram::InitialPhase {
    let random = |range_rad| Random { range_rad: Some(range_rad) };
    let kind = match initial {
        InitialPhase::Random { range_rad } => Kind::Random(random(range_rad)),
        InitialPhase::BackPropagated { range_rad } => Kind::BackPropagated(random(range_rad)),
        InitialPhase::Quadratic { focal_length_m } => {
            Kind::Quadratic(Lens { focal_length_m: focal_length_m.unwrap_or(0.0) })
        }
        InitialPhase::Constant { phase_rad } => Kind::Constant(Constant { phase_rad }),
        InitialPhase::Given(phases) => Kind::Given(Given { phases }),
    };
    optimize_hologram::InitialPhase { kind: Some(kind) }
}

fn loss(loss: Loss) -> optimize_hologram::Loss {
    let Loss { quantity, total_variation, speckle, speckle_block_px } = loss;
    let (quantity, speckle_block_px) = (quantity.to_wire(), speckle_block_px as u32);
    optimize_hologram::Loss { quantity, total_variation, speckle, speckle_block_px }
}

/// Converts the result into its message.
pub(crate) fn result(result: HologramResult) -> v1::HologramResult {
    v1::HologramResult {
        wavelengths: result.wavelengths.into_iter().map(wavelength_result).collect(),
        colour_reconstructions: result.colour_reconstructions,
        iterations: result.iterations,
        iteration_ms: result.iteration_ms,
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
        propagation: Some(validity_report(plane.propagation)),
        other_orders_psnr_db: plane.other_orders_psnr_db,
        second_opinion: plane.second_opinion.map(second_opinion),
    }
}
