//! Checks of fields that are valid separately, but may contradict each other.

use crate::error::Result;
use crate::field::Field;
use crate::propagation::{check_distance, check_method};
use crate::wrong_fields::collect_all;
use lightpath_domain::display::Display;
use lightpath_domain::job::OptimizeHologram;
use lightpath_optics::hologram::Loss;

/// Limit on the pixels of all subframes together: L-BFGS needs about 60 bytes for each.
const FRAME_PIXELS_MAX: u64 = 100_000_000;
/// Limit on the pixels of all planes together: a transfer function needs 32 bytes for each.
const PLANE_PIXELS_MAX: u64 = 100_000_000;

/// Refuses a distance or method that gives no correct image for one of the wavelengths.
pub(super) fn propagation(field: &Field, spec: &OptimizeHologram, display: &Display) -> Result<()> {
    let mut checks = Vec::new();
    for (&wavelength, versions) in spec.wavelengths.iter().zip(&spec.kernel_versions) {
        for (p, (plane, &version)) in spec.planes.iter().zip(versions).enumerate() {
            let Some(method) = spec.propagation else {
                let at = field.at("planes").index(p).at("place").at("distance_m");
                checks.push(check_distance(&at, display, wavelength, plane.distance));
                continue;
            };
            let at = field.at("propagation");
            checks.push(match version {
                Some(version) => Err(at.invalid(
                    format!("is given, but kernel version {version} has the method with which it was learned"),
                    "leave it unspecified, or use the kernel `ideal`",
                )),
                None => check_method(&at, display, wavelength, plane.distance, method),
            });
        }
    }
    collect_all(checks).map(drop)
}

/// Refuses fields that a method without a gradient ignores.
pub(super) fn method(field: &Field, spec: &OptimizeHologram) -> Result<()> {
    if spec.method.follows_gradient() {
        return Ok(());
    }
    let rule = "only the methods adam and lbfgs support it";
    if spec.loss != (Loss { speckle_block_px: spec.loss.speckle_block_px, ..Loss::default() }) {
        return Err(field.at("loss").but("is given", rule));
    }
    if spec.quantization_aware {
        return Err(field.at("quantization_aware").but("is given", rule));
    }
    Ok(())
}

/// Refuses subframes or planes that do not fit into memory.
pub(super) fn size(field: &Field, spec: &OptimizeHologram, display: &Display) -> Result<()> {
    let pixels = u64::from(display.width_px) * u64::from(display.height_px);
    let planes = spec.planes.len() as u64;
    for (name, count, most) in
        [("subframes", u64::from(spec.subframes), FRAME_PIXELS_MAX), ("planes", planes, PLANE_PIXELS_MAX)]
    {
        if count > 1 && count * pixels > most {
            let (display, fits) = (&spec.display, (most / pixels).max(1));
            let allowed = format!("at most {fits} fit into memory on displays/{display}");
            return Err(field.at(name).but(format!("are {count}"), allowed));
        }
    }
    Ok(())
}
