//! Checks of wavelengths, planes and depth maps.

use crate::optics::from_wire::distance;
use lightpath_domain::display::Display;
use lightpath_domain::job::ImagePlane;
use lightpath_domain::units::Wavelength;
use lightpath_proto::v1::{self, optimize_hologram};
use lightpath_service::{Field, Result, check_all, collect_all};

/// Limit on the planes: the light of one hologram does not suffice for more.
const PLANES_MAX: usize = 16;
/// Limit on the wavelengths: displays have fewer.
const WAVELENGTHS_MAX: usize = 8;
const PLANE_WEIGHT_MAX: f64 = 1000.0;

/// Checks the wavelengths, no two equal. An empty list stands for the only wavelength of the display.
pub(super) fn wavelengths(field: &Field, message: &v1::OptimizeHologram, display: &Display) -> Result<Vec<Wavelength>> {
    let list = field.at("wavelengths_m");
    if message.wavelengths_m.is_empty() {
        return Ok(vec![list.wavelength_of(None, display)?]);
    }
    at_most(&list, message.wavelengths_m.len(), WAVELENGTHS_MAX)?;
    let checked = collect_all(message.wavelengths_m.iter().enumerate().map(|(i, &value)| {
        let field = list.index(i);
        if value == 0.0 {
            return Err(field.but("is 0", "must be one of the display's wavelengths"));
        }
        field.wavelength_of(Some(value), display)
    }))?;
    let again = |(i, wavelength): (usize, &Wavelength)| match checked[..i].contains(wavelength) {
        true => Err(list.index(i).but(format!("is {wavelength} again"), "no two may be equal")),
        false => Ok(()),
    };
    collect_all(checked.iter().enumerate().map(again))?;
    Ok(checked)
}

/// Checks the planes, no two at the same place.
pub(super) fn planes(field: &Field, planes: &[optimize_hologram::ImagePlane]) -> Result<Vec<ImagePlane>> {
    if planes.is_empty() {
        return Err(field.but("is empty", "must have a plane with a place and a target"));
    }
    at_most(field, planes.len(), PLANES_MAX)?;
    let found = collect_all(planes.iter().enumerate().map(|(i, plane)| {
        let field = field.index(i);
        check_all! {
            distance = distance(&field.at("place"), plane.place.as_ref());
            target = field.at("target").digest(&plane.target);
            weight = weight(&field.at("weight"), plane.weight);
        }
        Ok(ImagePlane { distance, target, weight })
    }))?;
    let again = |(i, plane): (usize, &ImagePlane)| {
        if found[..i].iter().all(|other| other.distance != plane.distance) {
            return Ok(());
        }
        let problem = format!("is {} again", plane.distance);
        Err(field.index(i).at("place").but(problem, "no two planes may be at the same place"))
    };
    collect_all(found.iter().enumerate().map(again))?;
    Ok(found)
}

fn weight(field: &Field, value: Option<f64>) -> Result<f64> {
    let checked = field.if_set(value, "the default 1", |value| field.positive(value, PLANE_WEIGHT_MAX))?;
    Ok(checked.unwrap_or(1.0))
}

/// Checks the digest of the depth map, which needs at least two planes.
pub(super) fn depth_map(field: &Field, digest: &str, planes: usize) -> Result<Option<String>> {
    match (optional_digest(field, digest)?, planes) {
        (Some(_), 1) => Err(field.invalid("is given, but there is one plane", "a depth map needs at least two")),
        (map, _) => Ok(map),
    }
}

/// Checks the digest of an optional picture; `None` if it is empty.
pub(super) fn optional_digest(field: &Field, digest: &str) -> Result<Option<String>> {
    if digest.is_empty() { Ok(None) } else { field.digest(digest).map(Some) }
}

/// Refuses a list with too many entries.
fn at_most(list: &Field, count: usize, most: usize) -> Result<()> {
    if count <= most {
        return Ok(());
    }
    Err(list.but(format!("has {count} entries"), format!("at most {most} are accepted")))
}
