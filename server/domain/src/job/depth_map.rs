//! Depth maps: which pixels of a picture belong to which image plane.

use super::ImagePlane;
use lightpath_optics::{Plane, RegionOfInterest};

/// Index of the plane nearest to each pixel's depth. White (1) is at the distance of the first plane, black (0) at that
/// of the last.
#[must_use]
pub fn nearest_planes(depth: &Plane<f32>, planes: &[ImagePlane]) -> Plane<u8> {
    let distance = |p: usize| planes[p].distance.m();
    let (white, black) = (distance(0), distance(planes.len() - 1));
    depth.map(|value| {
        let z = black + f64::from(value) * (white - black);
        let off = |p: &usize| (distance(*p) - z).abs();
        (0..planes.len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0) as u8
    })
}

/// Weight of each pixel in plane `p`, with the weights of a mask, and the share of the region's weight that belongs to
/// the plane. Without a depth map all pixels belong to every plane.
#[must_use]
pub fn weight_in_plane(
    p: usize,
    mask: Option<&Plane<f32>>,
    nearest: Option<&Plane<u8>>,
    region: RegionOfInterest,
) -> (Option<Plane<f32>>, f64) {
    let Some(nearest) = nearest else { return (mask.cloned(), 1.0) };
    let weight = Plane::from_fn(nearest.height_px(), nearest.width_px(), |y, x| {
        let counts = mask.map_or(1.0, |mask| mask.at(y, x));
        if usize::from(nearest.at(y, x)) == p { counts } else { 0.0 }
    });
    let in_row = |y: usize| region.columns(y).map_or(0.0, |columns| weight.row(y)[columns].iter().sum::<f32>());
    let sum: f64 = (0..weight.height_px()).map(|y| f64::from(in_row(y))).sum();
    (Some(weight), sum / region.pixels() as f64)
}

/// Number of the region's pixels that belong to each of `planes` planes.
#[must_use]
pub fn pixels_of_planes(nearest: &Plane<u8>, planes: usize, region: RegionOfInterest) -> Vec<usize> {
    let mut pixels = vec![0; planes];
    for (y, columns) in (0..nearest.height_px()).filter_map(|y| Some((y, region.columns(y)?))) {
        nearest.row(y)[columns].iter().for_each(|&plane| pixels[usize::from(plane)] += 1);
    }
    pixels
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Distance;
    use lightpath_optics::Grid;

    #[test]
    fn every_pixel_belongs_to_the_plane_nearest_to_its_depth() {
        let plane =
            |mm: f64| ImagePlane { distance: Distance::from_m(mm * 1e-3).unwrap(), target: String::new(), weight: 1.0 };
        let depth = Plane::try_from_vec(1, 5, vec![1.0, 0.8, 0.5, 0.2, 0.0]).unwrap();
        let found = nearest_planes(&depth, &[plane(100.0), plane(150.0), plane(200.0)]);
        assert_eq!(found.values(), [0, 0, 1, 2, 2]);
        let region = RegionOfInterest::full(&Grid::try_new(1, 5, 8e-6).unwrap());
        assert_eq!(pixels_of_planes(&found, 3, region), [2, 1, 2]);
        let away = nearest_planes(&depth, &[plane(200.0), plane(100.0)]);
        assert_eq!(away.values(), [0, 0, 0, 1, 1]);
    }

    #[test]
    fn pixels_of_other_planes_have_no_weight() {
        let found = Plane::try_from_vec(1, 5, vec![0_u8, 0, 1, 2, 2]).unwrap();
        let region = RegionOfInterest::full(&Grid::try_new(1, 5, 8e-6).unwrap());
        let mask = Plane::filled(1, 5, 0.5);
        let (weight, share) = weight_in_plane(2, Some(&mask), Some(&found), region);
        assert_eq!(weight.unwrap().values(), [0.0, 0.0, 0.0, 0.5, 0.5]);
        assert!((share - 0.2).abs() < 1e-12);
    }
}
