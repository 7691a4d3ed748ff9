//! Generated photographs with a known place of the target.

use super::*;
use crate::alignment::camera_map::{Frame, PARAMETERS};
use crate::alignment::homography::Point;
use crate::alignment::warp::warp;
use lightpath_bench::TestCard;
use lightpath_optics::{Grid, RegionOfInterest};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const PHOTO: (usize, usize) = (400, 600);

/// Cards with details everywhere.
const CARDS: [TestCard; 3] = [TestCard::City, TestCard::EyeChart, TestCard::Spheres];

fn card(seed: u64) -> Plane<f32> {
    CARDS[seed as usize % CARDS.len()].render(270, 480, seed).unwrap()
}

/// A camera's map onto a photograph of [`PHOTO`] pixels, with the perspective and the distortion of `step`.
fn truth(target: &Plane<f32>, matrix: [[f64; 2]; 2], place: Point, step: [f64; PARAMETERS]) -> CameraMap {
    let camera = Frame::of(&Plane::filled(PHOTO.0, PHOTO.1, 0.0));
    CameraMap::affine(Frame::of(target), camera, matrix, place).moved(&step)
}

/// The target's point at a place of the photograph, by Newton's method.
fn point_at(map: &CameraMap, place: Point, start: Point) -> Point {
    let mut point = start;
    for _ in 0..8 {
        let [x, y] = point;
        let [here, right, below] = [[x, y], [x + 1e-3, y], [x, y + 1e-3]].map(|p| map.apply(p));
        let by = |there: Point| [(there[0] - here[0]) * 1e3, (there[1] - here[1]) * 1e3];
        let (u, v, off) = (by(right), by(below), [place[0] - here[0], place[1] - here[1]]);
        let determinant = u[0] * v[1] - u[1] * v[0];
        point = [x + (off[0] * v[1] - off[1] * v[0]) / determinant, y + (u[0] * off[1] - u[1] * off[0]) / determinant];
    }
    point
}

/// The target as a camera sees it: blurred, unevenly lit, with speckle, a black level, noise and a dark surrounding.
fn photo_of(target: &Plane<f32>, map: &CameraMap, seed: u64) -> Plane<f32> {
    let (picture, mut random) = (Pyramid::of(target), ChaCha8Rng::seed_from_u64(seed));
    let centre = [target.width_px() as f64 / 2.0, target.height_px() as f64 / 2.0];
    Plane::from_fn(PHOTO.0, PHOTO.1, |y, x| {
        let [u, v] = point_at(map, [x as f64, y as f64], centre);
        let around = [[-0.4, -0.4], [0.4, -0.4], [-0.4, 0.4], [0.4, 0.4]];
        let light: f32 = around.iter().map(|[a, b]| picture.value(0, [u + a, v + b]).unwrap_or(0.0) / 4.0).sum();
        let lamp = 1.0 - 0.6 * (x as f32 / PHOTO.1 as f32 - 0.3).powi(2);
        // The mean of four intensities of fully developed speckle has a contrast of 1/2.
        let speckle = (0..4).map(|_| -(1.0 - random.random::<f32>()).ln() / 4.0).sum::<f32>();
        0.04 + 0.5 * lamp * light * speckle + 0.02 * (random.random::<f32>() - 0.5)
    })
}

/// Largest distance of two maps over the middle of the target \[camera px\].
fn largest_error(target: &Plane<f32>, a: &CameraMap, b: &CameraMap) -> f64 {
    let at = |part: f64, side: usize| part * (side as f64 - 1.0);
    let points = (1..10).flat_map(|i| (1..10).map(move |j| (f64::from(i) / 10.0, f64::from(j) / 10.0)));
    let error = |(i, j): (f64, f64)| {
        let point = [at(i, target.width_px()), at(j, target.height_px())];
        let (a, b) = (a.apply(point), b.apply(point));
        (a[0] - b[0]).hypot(a[1] - b[1])
    };
    points.map(error).fold(0.0, f64::max)
}

fn turned(scale: f64, angle_deg: f64) -> [[f64; 2]; 2] {
    let (sine, cosine) = f64::to_radians(angle_deg).sin_cos();
    [[scale * cosine, -scale * sine], [scale * sine, scale * cosine]]
}

#[test]
fn perspective_and_distortion_are_found_within_a_third_of_a_pixel() {
    let distorted = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.04, -0.03, 0.05, -0.02, 0.0, 0.0];
    let decentred = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.02, 0.05, -0.03, 0.0, 0.004, -0.003];
    for (seed, matrix, place, step) in [
        (0, turned(1.1, 2.0), [305.0, 190.5], distorted),
        (1, turned(0.6, -8.0), [220.0, 240.0], decentred),
        (3, turned(1.22, 0.3), [299.0, 203.0], [0.0; PARAMETERS]),
    ] {
        let target = card(seed);
        let truth = truth(&target, matrix, place, step);
        let found = find_target(&photo_of(&target, &truth, seed), &target).unwrap();
        let error = largest_error(&target, &found.map, &truth);
        assert!(error < 0.3, "card {seed}: {error} px, correlation {}", found.correlation);
        assert!(!found.map.is_mirrored());
    }
}

#[test]
fn mirror_images_and_half_turns_are_found() {
    let target = card(1);
    for (signs, mirrored) in [([-1.0, 1.0], true), ([-1.0, -1.0], false), ([1.0, -1.0], true)] {
        let matrix = [[0.9 * signs[0], 0.0], [0.0, 0.9 * signs[1]]];
        let truth = truth(&target, matrix, [310.0, 200.0], [0.0; PARAMETERS]);
        let found = find_target(&photo_of(&target, &truth, 7), &target).unwrap();
        let error = largest_error(&target, &found.map, &truth);
        assert!(error < 0.3, "{signs:?}: {error} px");
        assert_eq!(found.map.is_mirrored(), mirrored);
    }
}

#[test]
fn a_part_of_what_the_photograph_shows_is_found() {
    let whole = card(0);
    let truth = truth(&whole, turned(1.2, 0.5), [300.0, 200.0], [0.0; PARAMETERS]);
    let photo = photo_of(&whole, &truth, 5);
    let part = Plane::from_fn(200, 210, |y, x| whole.at(y + 30, x + 140));
    let found = find_target(&photo, &part).unwrap();
    for point in [[25.0, 25.0], [185.0, 25.0], [105.0, 100.0], [25.0, 175.0], [185.0, 175.0]] {
        let (a, b) = (found.map.apply(point), truth.apply([point[0] + 140.0, point[1] + 30.0]));
        assert!((a[0] - b[0]).hypot(a[1] - b[1]) < 0.3, "{a:?} {b:?}");
    }
}

#[test]
fn unrelated_and_tiny_pictures_are_refused() {
    let (target, other) = (card(0), card(1));
    let truth = truth(&other, turned(1.1, 0.0), [300.0, 200.0], [0.0; PARAMETERS]);
    let photo = photo_of(&other, &truth, 1);
    let refusal = find_target(&photo, &target).unwrap_err();
    assert!(matches!(refusal, AlignmentError::TargetNotFound { correlation } if correlation < 0.12), "{refusal}");
    let black = Plane::filled(100, 100, 0.0);
    assert!(matches!(find_target(&black, &target), Err(AlignmentError::TargetNotFound { .. })));
    assert!(matches!(find_target(&photo, &black), Err(AlignmentError::TargetNotFound { .. })));
    let tiny = Plane::filled(31, 400, 0.5);
    assert!(matches!(find_target(&tiny, &target), Err(AlignmentError::PictureTooSmall { name: "photograph", .. })));
}

#[test]
fn displacements_of_blocks_are_measured() {
    let target = card(1);
    let region = RegionOfInterest::middle(&Grid::try_new(270, 480, 8e-6).unwrap());
    let shift = crate::alignment::Homography::similarity([0.0; 2], 0.0, 1.0, [1.5, -0.8]);
    // The photograph's light lies 1.5 px further to the right and 0.8 px further up.
    let aligned = warp(&target, &shift.inverse(), 270, 480, f32::INFINITY, 0.0);
    let found = block_displacements(&target, &aligned, region);
    assert!(found.len() > 10, "{}", found.len());
    for block in &found {
        let [x, y] = block.shift;
        assert!((x - 1.5).abs() < 0.15 && (y + 0.8).abs() < 0.15, "{block:?}");
    }
    let flat = Plane::filled(270, 480, 0.5);
    assert!(block_displacements(&flat, &aligned, region).is_empty());
}
