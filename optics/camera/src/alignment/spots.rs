//! Detection of bright spots in a photograph: local maxima of the light above its surroundings, at one scale.
//!
//! Spots are judged by the spots around them, so light may fall off, and one that outshines all others hides none. Light
//! is averaged over a spot first: the dots of a hologram have speckle, whose grains would else be spots of their own.

use super::box_blur::box_blur;
use super::homography::Point;
use lightpath_optics::{Plane, interrupt};
use std::collections::VecDeque;

/// Radius of the surroundings, in radii of a spot.
const SURROUNDINGS: usize = 4;
/// Radius of the neighbourhood whose spots a spot is compared with, in radii of a spot.
const NEIGHBOURHOOD: usize = 12;
/// Least brightness of a spot, as a part of the brightest one in the neighbourhood.
const BRIGHTNESS_MIN: f32 = 0.3;
/// Rank of the spot whose brightness is taken as typical. A grid has more dots, and stray light makes fewer spots.
const TYPICAL_RANK: usize = 50;
/// Largest brightness that counts, in typical ones. The neighbours of a brighter spot are not lost for it.
const BRIGHTNESS_MAX: f32 = 1.5;
/// Least brightness by which a neighbourhood is scaled, in typical ones. It keeps the noise of dark areas from becoming
/// spots.
const DARK: f32 = 0.08;
/// Most spots that are used: the brightest. The largest grid of dots, of a display thirty times as wide as high, has 300.
const SPOTS_MAX: usize = 1500;

/// The photograph without pixels that are brighter than all around them, as defects of a camera are.
pub(super) fn without_hot_pixels(photo: &Plane<f32>) -> Plane<f32> {
    let (height, width) = (photo.height_px(), photo.width_px());
    Plane::from_fn(height, width, |y, x| {
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        let around = rows.flat_map(|j| (x.saturating_sub(1)..(x + 2).min(width)).map(move |i| (j, i)));
        let others = around.filter(|&place| place != (y, x)).map(|(j, i)| photo.at(j, i));
        photo.at(y, x).min(others.fold(f32::MIN, f32::max))
    })
}

/// Finds the centres of spots of about this radius.
pub(super) fn find(photo: &Plane<f32>, radius_px: usize) -> Vec<Point> {
    let (height, width) = (photo.height_px(), photo.width_px());
    let smooth = box_blur(photo, radius_px, 2);
    let background = box_blur(&smooth, SURROUNDINGS * radius_px, 2);
    let rise = Plane::from_fn(height, width, |y, x| (smooth.at(y, x) - background.at(y, x)).max(0.0));
    let nearby = largest_within(&rise, 2 * radius_px);
    let mut peaks: Vec<usize> =
        (0..height * width).filter(|&i| rise.values()[i] > 0.0 && rise.values()[i] >= nearby.values()[i]).collect();
    peaks.sort_by(|&a, &b| rise.values()[b].total_cmp(&rise.values()[a]));
    let Some(&typical) = peaks.get(TYPICAL_RANK.min(peaks.len() / 2)) else { return Vec::new() };
    let typical = rise.values()[typical];
    let capped = rise.map(|light| light.min(BRIGHTNESS_MAX * typical));
    let neighbourhood = largest_within(&capped, NEIGHBOURHOOD * radius_px);
    let is_bright =
        |i: usize| rise.values()[i] >= BRIGHTNESS_MIN * neighbourhood.values()[i].max(DARK / BRIGHTNESS_MIN * typical);
    let bright = peaks.into_iter().filter(|&i| is_bright(i)).take(SPOTS_MAX);
    bright.map(|i| [(i % width) as f64, (i / width) as f64]).collect()
}

/// The largest value in the (2·radius + 1)² square around each pixel, as far as that lies inside the plane.
fn largest_within(plane: &Plane<f32>, radius_px: usize) -> Plane<f32> {
    transposed_largest(&transposed_largest(plane, radius_px), radius_px)
}

/// The largest values along the rows, transposed. A queue holds the values that may still become the largest.
fn transposed_largest(plane: &Plane<f32>, radius_px: usize) -> Plane<f32> {
    let (height_px, width_px) = (plane.height_px(), plane.width_px());
    let mut out = Plane::filled(width_px, height_px, 0.0_f32);
    let mut queue: VecDeque<usize> = VecDeque::new();
    for y in 0..height_px {
        interrupt::check();
        let row = plane.row(y);
        queue.clear();
        for x in 0..width_px + radius_px {
            if let Some(&value) = row.get(x) {
                while queue.back().is_some_and(|&last| row[last] <= value) {
                    queue.pop_back();
                }
                queue.push_back(x);
            }
            let Some(centre) = x.checked_sub(radius_px) else { continue };
            while queue.front().is_some_and(|&first| first + radius_px < centre) {
                queue.pop_front();
            }
            out.values_mut()[centre * height_px + y] = queue.front().map_or(0.0, |&first| row[first]);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn largest_value_is_that_of_the_square() {
        let plane = Plane::from_fn(9, 13, |y, x| ((y * 31 + x * 17) % 23) as f32);
        let largest = largest_within(&plane, 2);
        for (y, x) in (0..9_usize).flat_map(|y| (0..13_usize).map(move |x| (y, x))) {
            let square = (y.saturating_sub(2)..(y + 3).min(9))
                .flat_map(|j| (x.saturating_sub(2)..(x + 3).min(13)).map(move |i| (j, i)));
            assert_eq!(largest.at(y, x), square.map(|(j, i)| plane.at(j, i)).fold(0.0, f32::max));
        }
    }

    #[test]
    fn spots_beside_a_dazzling_one_are_found_and_hot_pixels_are_not() {
        let spot = |p: [f64; 2], at: [f64; 2], size: f64| {
            (-0.5 * ((p[0] - at[0]).powi(2) + (p[1] - at[1]).powi(2)) / (size * size)).exp()
        };
        let places: Vec<Point> =
            (0..63).map(|i| [20.0 + 20.0 * f64::from(i % 9), 20.0 + 20.0 * f64::from(i / 9)]).collect();
        let mut photo = Plane::from_fn(160, 200, |y, x| {
            let p = [x as f64, y as f64];
            let dots: f64 = places.iter().map(|&place| spot(p, place, 2.0)).sum();
            (0.2 * dots + 5.0 * spot(p, [90.0, 70.0], 1.5)).min(1.0) as f32
        });
        photo.values_mut()[30 * 200 + 151] = 1.0;
        let found = find(&without_hot_pixels(&photo), 2);
        let is_found = |place: &Point| found.iter().any(|spot| (spot[0] - place[0]).hypot(spot[1] - place[1]) < 2.0);
        assert!(places.iter().all(is_found) && is_found(&[90.0, 70.0]), "{found:?}");
        assert_eq!(found.len(), 64);
    }
}
