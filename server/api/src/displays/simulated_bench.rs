//! Conversion of simulated benches from and to messages.

use lightpath_bench::SimulatedBench;
use lightpath_proto::v1;
use lightpath_service::{Field, Result, collect_all};

/// Copies all properties of a bench into the other type: the simulated bench and the message have the same properties.
/// Those that a message may leave out are given separately.
macro_rules! with_all_properties {
    ($bench:expr, $other:path { $($optional:ident: $value:expr),* $(,)? }) => {{
        let bench = $bench;
        $other {
            seed: bench.seed,
            misalignment_px: bench.misalignment_px,
            rotation_rad: bench.rotation_rad,
            blur_px: bench.blur_px,
            speckle_contrast: bench.speckle_contrast,
            crosstalk_px: bench.crosstalk_px,
            flicker: bench.flicker,
            drift_px_per_hour: bench.drift_px_per_hour,
            dimming_per_hour: bench.dimming_per_hour,
            rail_tilt_rad: bench.rail_tilt_rad,
            field_aberration_rad: bench.field_aberration_rad,
            crosstalk_y_px: bench.crosstalk_y_px,
            surface_waves: bench.surface_waves,
            response_variation: bench.response_variation,
            dust_contrast: bench.dust_contrast,
            ghost_share: bench.ghost_share,
            source_angle_rad: bench.source_angle_rad,
            bandwidth: bench.bandwidth,
            distortion: bench.distortion,
            vignetting: bench.vignetting,
            camera_nonlinearity: bench.camera_nonlinearity,
            $($optional: $value),*
        }
    }};
}

/// Checks a bench from a client and converts it.
pub(super) fn from_wire(message: v1::SimulatedBench, field: &Field) -> Result<SimulatedBench> {
    let v1::SimulatedBench { strength, camera_noise, full_well_electrons, aberrations_at_m, .. } = message;
    let bench = with_all_properties!(
        message,
        SimulatedBench {
            strength: strength.unwrap_or(SimulatedBench::FAIR.strength),
            camera_noise: camera_noise.unwrap_or(SimulatedBench::FAIR.camera_noise),
            full_well_electrons: full_well_electrons.unwrap_or(0.0),
            aberrations_at_m: aberrations_at_m.unwrap_or(0.0),
        }
    );
    collect_all(bench.ranges().into_iter().map(|(name, value, least, most, _)| {
        let field = field.at(name);
        match name {
            "strength" => field.number_or(strength, SimulatedBench::FAIR.strength, least..=most),
            "camera_noise" => field.number_or(camera_noise, SimulatedBench::FAIR.camera_noise, least..=most),
            "full_well_electrons" => positive(&field, full_well_electrons, most, "shot noise like the read noise"),
            "aberrations_at_m" => positive(&field, aberrations_at_m, most, "the same aberrations at all distances"),
            _ => field.number(value, least..=most),
        }
    }))?;
    Ok(bench)
}

/// Checks a number that is not 0 if it is given.
fn positive(field: &Field, value: Option<f64>, most: f64, unset: &str) -> Result<f64> {
    Ok(field.if_set(value, unset, |value| field.positive(value, most))?.unwrap_or(0.0))
}

/// Converts a bench into its message.
pub(super) fn to_wire(bench: SimulatedBench) -> v1::SimulatedBench {
    let given = |value: f64| (value > 0.0).then_some(value);
    with_all_properties!(
        bench,
        v1::SimulatedBench {
            strength: Some(bench.strength),
            camera_noise: Some(bench.camera_noise),
            full_well_electrons: given(bench.full_well_electrons),
            aberrations_at_m: given(bench.aberrations_at_m),
        }
    )
}
