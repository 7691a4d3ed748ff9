//! Which wavelengths, and which pictures at which distances.

use crate::error::ApiError;
use crate::field::Field;
use lightpath_domain::display::Display;
use lightpath_domain::job::ImagePlane;
use lightpath_domain::units::{Distance, Wavelength};
use lightpath_proto::v1::{self, optimize_hologram};

/// Most planes: the light of one hologram does not suffice for more.
const PLANES_MAX: usize = 16;
/// Most wavelengths: displays are lit with fewer.
const WAVELENGTHS_MAX: usize = 8;
const PLANE_WEIGHT_MAX: f64 = 1000.0;

pub(super) fn wavelengths(
    field: &Field,
    message: &v1::OptimizeHologram,
    display: &Display,
) -> Result<Vec<Wavelength>, ApiError> {
    let list = field.at("wavelengths_m");
    if message.wavelengths_m.is_empty() {
        return Ok(vec![field.at("wavelength_m").wavelength_of(message.wavelength_m, display)?]);
    }
    if message.wavelength_m != 0.0 {
        return Err(field.at("wavelength_m").invalid("is given beside wavelengths_m; give one of them"));
    }
    at_most(&list, message.wavelengths_m.len(), WAVELENGTHS_MAX)?;
    let mut found = Vec::new();
    for (i, &value) in message.wavelengths_m.iter().enumerate() {
        let field = list.index(i);
        if value == 0.0 {
            return Err(field.invalid("is 0, but must be one of the display's wavelengths"));
        }
        let wavelength = field.wavelength_of(value, display)?;
        if found.contains(&wavelength) {
            return Err(field.invalid(format!("is {wavelength} again; no two may be equal")));
        }
        found.push(wavelength);
    }
    Ok(found)
}

/// The planes, and the depth map that cuts them out of one picture.
pub(super) fn planes(
    field: &Field,
    message: &v1::OptimizeHologram,
) -> Result<(Vec<ImagePlane>, Option<String>), ApiError> {
    let at = |name| field.at(name);
    match (&message.depth_map, message.planes.as_slice()) {
        (Some(_), [_, ..]) => Err(at("depth_map").invalid("is given beside planes; give one of them")),
        (None, []) => {
            let distance = at("distance_m").distance(message.distance_m)?;
            let target = at("target").digest(&message.target)?;
            Ok((vec![ImagePlane { distance, target, weight: 1.0 }], None))
        }
        (Some(map), []) => {
            no_distance(field, message, "depth_map")?;
            let list = at("depth_map").at("distances_m");
            if map.distances_m.len() < 2 {
                return Err(list.invalid(format!("has {} distances, but must have 2 or more", map.distances_m.len())));
            }
            let target = at("target").digest(&message.target)?;
            let distances = distances(&list, map.distances_m.iter().enumerate().map(|(i, &z)| (list.index(i), z)))?;
            let plane = |distance| ImagePlane { distance, target: target.clone(), weight: 1.0 };
            let digest = at("depth_map").at("map").digest(&map.map)?;
            Ok((distances.into_iter().map(plane).collect(), Some(digest)))
        }
        (None, planes) => {
            no_distance(field, message, "planes")?;
            if !message.target.is_empty() {
                return Err(at("target").invalid("is given beside planes, which have targets of their own"));
            }
            let list = at("planes");
            let given = planes.iter().enumerate().map(|(i, plane)| (list.index(i).at("distance_m"), plane.distance_m));
            let distances = distances(&list, given)?;
            let plane = |(i, (plane, distance)): (usize, (&optimize_hologram::ImagePlane, Distance))| {
                let field = list.index(i);
                let target = field.at("target").digest(&plane.target)?;
                let weight = field.at("weight").number_or(plane.weight, 1.0, f64::MIN_POSITIVE..=PLANE_WEIGHT_MAX)?;
                Ok(ImagePlane { distance, target, weight })
            };
            Ok((planes.iter().zip(distances).enumerate().map(plane).collect::<Result<_, ApiError>>()?, None))
        }
    }
}

fn no_distance(field: &Field, message: &v1::OptimizeHologram, beside: &str) -> Result<(), ApiError> {
    if message.distance_m == 0.0 {
        return Ok(());
    }
    Err(field.at("distance_m").invalid(format!("is given beside {beside}, which has distances of its own")))
}

fn distances(list: &Field, given: impl ExactSizeIterator<Item = (Field, f64)>) -> Result<Vec<Distance>, ApiError> {
    at_most(list, given.len(), PLANES_MAX)?;
    let mut found = Vec::new();
    for (field, value) in given {
        let distance = field.distance(value)?;
        if found.contains(&distance) {
            return Err(field.invalid(format!("is {distance} again; no two planes may be at one distance")));
        }
        found.push(distance);
    }
    Ok(found)
}

fn at_most(list: &Field, count: usize, most: usize) -> Result<(), ApiError> {
    if count <= most {
        return Ok(());
    }
    Err(list.invalid(format!("has {count} entries, but at most {most} are accepted")))
}
