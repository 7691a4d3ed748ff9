//! Refusing fields of a request that are right each by itself, but not together.

use crate::error::ApiError;
use crate::field::Field;
use crate::optics::propagation_checks::{check_distance, check_method};
use lightpath_domain::display::Display;
use lightpath_domain::job::OptimizeHologram;
use lightpath_optics::hologram::Loss;

/// All frames' pixels: L-BFGS keeps some 60 bytes for each.
const FRAME_PIXELS_MAX: u64 = 100_000_000;
/// All planes' pixels: a transfer function takes 32 bytes for each.
const PLANE_PIXELS_MAX: u64 = 100_000_000;

/// Refuses propagation of any wavelength to any plane that cannot give a right image.
pub(super) fn propagation(field: &Field, spec: &OptimizeHologram, display: &Display) -> Result<(), ApiError> {
    for (&wavelength, versions) in spec.wavelengths.iter().zip(&spec.kernel_versions) {
        for (p, (plane, version)) in spec.planes.iter().zip(versions).enumerate() {
            let Some(method) = spec.propagation else {
                let at = field.at("planes").index(p).at("distance_m");
                check_distance(&at, display, wavelength, plane.distance)?;
                continue;
            };
            let at = field.at("propagation");
            if let Some(version) = version {
                let fix = "leave it unspecified, or optimize through the kernel `ideal`";
                let problem = format!("is given, but version {version} brings what it was learned with; {fix}");
                return Err(at.invalid(problem));
            }
            check_method(&at, display, wavelength, plane.distance, method)?;
        }
    }
    Ok(())
}

/// Refuses fields that only methods with a gradient follow.
pub(super) fn method(field: &Field, spec: &OptimizeHologram) -> Result<(), ApiError> {
    if spec.method.follows_gradient() {
        return Ok(());
    }
    let fix = "is given, but only the methods adam and lbfgs can follow it";
    if spec.loss != (Loss { speckle_block_px: spec.loss.speckle_block_px, ..Loss::default() }) {
        return Err(field.at("loss").invalid(fix));
    }
    if spec.quantization_aware {
        return Err(field.at("quantization_aware").invalid(fix));
    }
    Ok(())
}

/// Refuses more frames or planes than fit into memory.
pub(super) fn size(field: &Field, spec: &OptimizeHologram, display: &Display) -> Result<(), ApiError> {
    let pixels = u64::from(display.width_px) * u64::from(display.height_px);
    let planes = spec.planes.len() as u64;
    for (name, count, most) in
        [("frames", u64::from(spec.frames), FRAME_PIXELS_MAX), ("planes", planes, PLANE_PIXELS_MAX)]
    {
        if count > 1 && count * pixels > most {
            let (display, fits) = (&spec.display, (most / pixels).max(1));
            let problem = format!("are {count}, but on displays/{display} at most {fits} fit into memory");
            return Err(field.at(name).invalid(problem));
        }
    }
    Ok(())
}
