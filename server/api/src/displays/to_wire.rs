//! Displays as messages.

use crate::time::timestamp;
use lightpath_domain::display::{Carrier, Display};
use lightpath_proto::v1;

/// The display as clients see it.
pub(crate) fn display(display: Display, create_time_ms: i64) -> v1::Display {
    v1::Display {
        name: format!("displays/{}", display.id),
        width_px: display.width_px,
        height_px: display.height_px,
        pixel_pitch_m: display.pixel_pitch_m,
        bit_depth: display.bit_depth,
        wavelengths_m: display.wavelengths.iter().map(|wavelength| wavelength.m()).collect(),
        phase_response: display.phase_response_rad.map(|phase_rad| v1::PhaseResponse { phase_rad }),
        carrier: match display.carrier {
            None => v1::Carrier::Unspecified,
            Some(Carrier::HalfOrderX) => v1::Carrier::HalfOrderX,
            Some(Carrier::HalfOrderY) => v1::Carrier::HalfOrderY,
        }
        .into(),
        notes: display.notes,
        simulated_bench: display.simulated_bench.map(|bench| v1::SimulatedBench {
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
        }),
        create_time: Some(timestamp(create_time_ms)),
    }
}
