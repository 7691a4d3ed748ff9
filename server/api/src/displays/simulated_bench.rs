//! Conversion of simulated benches from and to messages.

use lightpath_bench::SimulatedBench;
use lightpath_proto::v1;
use lightpath_service::{Field, Result, collect_all};

/// Copies all properties of a bench into the other type: the simulated bench and the message have the same
/// properties.
macro_rules! with_all_properties {
    ($bench:expr, $other:path) => {{
        let bench = $bench;
        $other {
            seed: bench.seed,
            strength: bench.strength,
            camera_noise: bench.camera_noise,
            misalignment_px: bench.misalignment_px,
            rotation_deg: bench.rotation_deg,
            blur_px: bench.blur_px,
            full_well_electrons: bench.full_well_electrons,
            speckle_contrast: bench.speckle_contrast,
            crosstalk_px: bench.crosstalk_px,
            flicker: bench.flicker,
            drift_px_per_hour: bench.drift_px_per_hour,
            dimming_per_hour: bench.dimming_per_hour,
            rail_tilt_deg: bench.rail_tilt_deg,
            aberrations_at_m: bench.aberrations_at_m,
            field_aberration_rad: bench.field_aberration_rad,
            crosstalk_y_px: bench.crosstalk_y_px,
            surface_waves: bench.surface_waves,
            response_variation: bench.response_variation,
            dust_contrast: bench.dust_contrast,
            ghost_share: bench.ghost_share,
            source_angle_mrad: bench.source_angle_mrad,
            bandwidth: bench.bandwidth,
            distortion: bench.distortion,
            vignetting: bench.vignetting,
            camera_nonlinearity: bench.camera_nonlinearity,
        }
    }};
}

/// Checks a bench from a client and converts it. A strength or camera noise of 0 stands for the default.
pub(super) fn from_wire(message: v1::SimulatedBench, field: &Field) -> Result<SimulatedBench> {
    let mut bench = with_all_properties!(message, SimulatedBench);
    for (value, default) in [
        (&mut bench.strength, SimulatedBench::FAIR.strength),
        (&mut bench.camera_noise, SimulatedBench::FAIR.camera_noise),
    ] {
        if *value == 0.0 {
            *value = default;
        }
    }
    let ranges = bench.ranges().into_iter();
    collect_all(ranges.map(|(name, value, least, most, _)| field.at(name).number(value, least..=most)))?;
    Ok(bench)
}

/// Converts a bench into its message.
pub(super) fn to_wire(bench: SimulatedBench) -> v1::SimulatedBench {
    with_all_properties!(bench, v1::SimulatedBench)
}
