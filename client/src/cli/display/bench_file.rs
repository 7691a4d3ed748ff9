//! A simulated bench from a TOML file.

use crate::cli::failure::Failure;
use lightpath::v1::SimulatedBench;
use serde::Deserialize;
use std::path::Path;

/// The file: everything may be left out.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct BenchFile {
    seed: u64,
    /// 0 would mean the default.
    strength: Option<f64>,
    misalignment_px: f64,
    field_aberration_rad: f64,
    modulator: Modulator,
    camera: Camera,
    rail: Rail,
    drift: Drift,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Modulator {
    crosstalk_px: f64,
    flicker: f64,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Camera {
    noise: Option<f64>,
    full_well_electrons: f64,
    rotation_deg: f64,
    blur_px: f64,
    speckle_contrast: f64,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Rail {
    tilt_deg: f64,
    aberrations_at_m: f64,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Drift {
    shift_px_per_hour: f64,
    dimming_per_hour: f64,
}

/// The bench that a file describes.
pub(super) fn read(path: &Path) -> Result<SimulatedBench, Failure> {
    let text = std::fs::read_to_string(path).map_err(|source| lightpath::Error::File {
        action: "read",
        path: path.to_owned(),
        source,
    })?;
    parse(&text).map_err(|problem| Failure::Usage(format!("{}: {problem}", path.display())))
}

fn parse(text: &str) -> Result<SimulatedBench, String> {
    let file: BenchFile = toml::from_str(text).map_err(|error| error.to_string())?;
    let BenchFile { seed, strength, misalignment_px, field_aberration_rad, modulator, camera, rail, drift } = file;
    for (name, value) in [("strength", strength), ("camera.noise", camera.noise)] {
        if value == Some(0.0) {
            return Err(format!(
                "{name} is 0, which would mean its default; give a small number, such as 1e-6, instead"
            ));
        }
    }
    Ok(SimulatedBench {
        seed,
        strength: strength.unwrap_or(0.0),
        camera_noise: camera.noise.unwrap_or(0.0),
        misalignment_px,
        rotation_deg: camera.rotation_deg,
        blur_px: camera.blur_px,
        full_well_electrons: camera.full_well_electrons,
        speckle_contrast: camera.speckle_contrast,
        crosstalk_px: modulator.crosstalk_px,
        flicker: modulator.flicker,
        drift_px_per_hour: drift.shift_px_per_hour,
        dimming_per_hour: drift.dimming_per_hour,
        rail_tilt_deg: rail.tilt_deg,
        aberrations_at_m: rail.aberrations_at_m,
        field_aberration_rad,
    })
}

/// What a bench has beside the properties that every one has, as the file names it.
pub(super) fn further(bench: &SimulatedBench) -> impl Iterator<Item = (&'static str, f64)> {
    [
        ("crosstalk_px", bench.crosstalk_px),
        ("flicker", bench.flicker),
        ("full_well_electrons", bench.full_well_electrons),
        ("rotation_deg", bench.rotation_deg),
        ("blur_px", bench.blur_px),
        ("speckle_contrast", bench.speckle_contrast),
        ("shift_px_per_hour", bench.drift_px_per_hour),
        ("dimming_per_hour", bench.dimming_per_hour),
        ("tilt_deg", bench.rail_tilt_deg),
        ("aberrations_at_m", bench.aberrations_at_m),
        ("field_aberration_rad", bench.field_aberration_rad),
    ]
    .into_iter()
    .filter(|(_, value)| *value != 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::tests::{DAMAGED, damaged};

    const DOCUMENTED: &str = include_str!("../../../../docs/bench.toml");

    #[test]
    fn the_documented_file_has_every_property() {
        let bench = parse(DOCUMENTED).unwrap();
        assert_eq!(further(&bench).count(), 11, "each of them is other than 0");
        assert!(bench.seed > 0 && bench.strength > 0.0 && bench.camera_noise > 0.0 && bench.misalignment_px > 0.0);
    }

    #[test]
    fn damaged_files_are_read_or_refused() {
        let read = damaged(DOCUMENTED).filter(|text| parse(text).is_ok()).count();
        assert!((1..DAMAGED).contains(&read), "{read} were read");
    }

    #[test]
    fn everything_may_be_left_out() {
        assert_eq!(parse("").unwrap(), SimulatedBench::default());
        let bench = parse("seed = 7\n[camera]\nblur_px = 0.5").unwrap();
        assert_eq!(bench, SimulatedBench { seed: 7, blur_px: 0.5, ..Default::default() });
    }

    #[test]
    fn misspelt_properties_are_refused_with_those_there_are() {
        let error = parse("[camera]\nblurr_px = 1.0").unwrap_err();
        assert!(error.contains("blurr_px") && error.contains("blur_px"), "{error}");
        assert!(parse("strength = 0.0").unwrap_err().contains("strength is 0"));
        assert!(parse("strength = \"much\"").is_err());
    }
}
