//! What the rig says of the bench, and whether that is the bench of the display.

use crate::Problem;
use crate::bench::Bench;
use crate::settings::{Adapter, Settings};
use lightpath::v1::{self, Place, Rig, rig};

/// Checks that the SLM and the light are those of the server's display.
///
/// # Errors
///
/// [`Problem::Refused`], with both numbers.
pub fn check_display(display: &v1::Display, settings: &Settings, bench: &Bench) -> Result<(), Problem> {
    let modulator = display.modulator.clone().unwrap_or_default();
    let bit_depth = modulator.bit_depth.unwrap_or(8);
    let (name, slm) = (&display.name, bench.slm());
    if (modulator.width_px, modulator.height_px) != (slm.width_px, slm.height_px) {
        let (theirs, ours) = ((modulator.width_px, modulator.height_px), (slm.width_px, slm.height_px));
        return Err(Problem::Refused(format!(
            "{name} has {}×{} px, but the SLM {}×{} px: correct slm.width_px and slm.height_px, or `display`",
            theirs.0, theirs.1, ours.0, ours.1
        )));
    }
    if bit_depth != slm.bit_depth {
        let ours = slm.bit_depth;
        return Err(Problem::Refused(format!(
            "levels of {name} have {bit_depth} bits, but those of the SLM {ours}: correct slm.bit_depth, or `display`"
        )));
    }
    for wavelength_m in settings.wavelengths_m().map_err(Problem::Setting)? {
        // The server counts in whole picometres.
        if !display.wavelengths_m.iter().any(|theirs| (theirs - wavelength_m).abs() < 1e-12) {
            let theirs: Vec<String> = display.wavelengths_m.iter().map(|m| format!("{:.3} nm", m * 1e9)).collect();
            return Err(Problem::Refused(format!(
                "{name} has no light of {:.3} nm, but of {}: correct wavelengths",
                wavelength_m * 1e9,
                theirs.join(", ")
            )));
        }
    }
    Ok(())
}

/// The description of the bench.
pub(super) fn of(display: &v1::Display, settings: &Settings, bench: &Bench) -> Result<Rig, Problem> {
    let (slm, camera) = (bench.slm(), bench.camera());
    let devices = match settings.adapter {
        Adapter::Simulated => "a simulated bench",
        Adapter::Folder => "folders",
        Adapter::Command => "commands",
    };
    Ok(Rig {
        name: format!("{}/rig", display.name),
        program: format!("lightpath-rig {}, {devices}", env!("CARGO_PKG_VERSION")),
        slm: Some(rig::Slm {
            width_px: slm.width_px,
            height_px: slm.height_px,
            bit_depth: slm.bit_depth,
            settling_time_s: slm.settling.as_secs_f64(),
            reads_back: slm.reads_back,
        }),
        camera: Some(rig::Camera {
            width_px: camera.width_px,
            height_px: camera.height_px,
            bit_depth: camera.bit_depth,
            exposure_min_s: camera.exposure_min_s,
            exposure_max_s: camera.exposure_max_s.min(settings.bench_limits().exposure_max_s),
            exposure_delay_frames: camera.exposure_delay_frames,
        }),
        has_shutter: bench.has_shutter(),
        wavelengths_m: settings.wavelengths_m().map_err(Problem::Setting)?,
        place: Some(Place::at_m(settings.distance_m().map_err(Problem::Setting)?)),
    })
}
