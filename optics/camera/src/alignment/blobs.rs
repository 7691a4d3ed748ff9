//! Detection of bright spots in a photograph, at any exposure and under uneven light.

use super::box_blur::box_blur;
use super::homography::Point;
use lightpath_optics::Plane;

/// A bright spot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Blob {
    /// Centre of the spot's light \[px\].
    pub(super) centre: Point,
    /// Light of the spot above the background, relative to the brightness of its neighbourhood.
    pub(super) flux: f64,
    /// Number of pixels of the spot.
    pub(super) area_px: usize,
}

/// The side of the square over which the background is averaged is the photograph's shorter side divided by this.
const BACKGROUND_PART: usize = 10;
/// Threshold of a spot, as a part of the brightest light nearby.
const THRESHOLD: f32 = 0.4;
/// Least brightness by which a neighbourhood is scaled, as a part of the brightest light in the photograph. It keeps
/// the noise of dark areas from becoming spots.
const DARK: f32 = 0.04;
const AREA_PX_MIN: usize = 4;
/// Least number of a spot's pixels, as a part of a typical spot's. Smaller spots are noise.
const AREA_PART_MIN: f64 = 0.2;

/// Finds the spots, after all neighbourhoods are scaled to the same brightness.
pub(super) fn find(photo: &Plane<f32>) -> Vec<Blob> {
    let side = photo.height_px().min(photo.width_px());
    let smooth = box_blur(photo, (side / 700).max(1), 2);
    let radius = (side / BACKGROUND_PART / 2).max(4);
    let background = box_blur(&smooth, radius, 2);
    let rise =
        Plane::from_fn(photo.height_px(), photo.width_px(), |y, x| (smooth.at(y, x) - background.at(y, x)).max(0.0));
    let brightest = rise.values().iter().copied().fold(0.0, f32::max);
    if brightest <= 0.0 || !brightest.is_finite() {
        return Vec::new();
    }
    let nearby = box_blur(&maximum(&rise, radius), radius, 1).map(|level| level.max(DARK * brightest));
    let level = Plane::from_fn(photo.height_px(), photo.width_px(), |y, x| rise.at(y, x) / nearby.at(y, x));
    let mut blobs = components(&level);
    let mut areas: Vec<usize> = blobs.iter().map(|blob| blob.area_px).collect();
    areas.sort_unstable();
    // With much noise the median spot is noise itself, so the upper quartile is taken as typical.
    let typical = areas.get(areas.len() * 3 / 4).copied().unwrap_or(0) as f64;
    blobs.retain(|blob| blob.area_px >= AREA_PX_MIN && blob.area_px as f64 >= AREA_PART_MIN * typical);
    blobs
}

/// The largest value within about `radius_px` along both axes: the maximum over a pixel's block and its neighbours.
fn maximum(plane: &Plane<f32>, radius_px: usize) -> Plane<f32> {
    let (rows, columns) = (plane.height_px().div_ceil(radius_px), plane.width_px().div_ceil(radius_px));
    let mut blocks = Plane::filled(rows, columns, 0.0_f32);
    for y in 0..plane.height_px() {
        for (x, &value) in plane.row(y).iter().enumerate() {
            let block = &mut blocks.values_mut()[y / radius_px * columns + x / radius_px];
            *block = block.max(value);
        }
    }
    let around = Plane::from_fn(rows, columns, |j, i| {
        let near = |k: usize, most: usize| k.saturating_sub(1)..(k + 2).min(most);
        near(j, rows)
            .flat_map(|j| near(i, columns).map(move |i| (j, i)))
            .fold(0.0, |most, (j, i)| blocks.at(j, i).max(most))
    });
    Plane::from_fn(plane.height_px(), plane.width_px(), |y, x| around.at(y / radius_px, x / radius_px))
}

/// Finds connected sets of pixels above the threshold.
fn components(level: &Plane<f32>) -> Vec<Blob> {
    let (height, width) = (level.height_px(), level.width_px());
    let mut visited = vec![false; height * width];
    let (mut blobs, mut stack) = (Vec::new(), Vec::new());
    for start in 0..height * width {
        if visited[start] || level.values()[start] < THRESHOLD {
            continue;
        }
        visited[start] = true;
        stack.push(start);
        let mut pixels = Vec::new();
        while let Some(i) = stack.pop() {
            pixels.push(i);
            let (y, x) = (i / width, i % width);
            for ny in y.saturating_sub(1)..(y + 2).min(height) {
                for nx in x.saturating_sub(1)..(x + 2).min(width) {
                    let next = ny * width + nx;
                    if !visited[next] && level.values()[next] >= THRESHOLD {
                        visited[next] = true;
                        stack.push(next);
                    }
                }
            }
        }
        blobs.push(blob(level, &pixels));
    }
    blobs
}

fn blob(level: &Plane<f32>, pixels: &[usize]) -> Blob {
    let width = level.width_px();
    let (mut flux, mut sum) = (0.0, [0.0; 2]);
    for &i in pixels {
        // Weights are counted from the threshold, so a pixel that comes or goes at the rim hardly moves the centre.
        let light = f64::from(level.values()[i] - THRESHOLD) + 1e-6;
        flux += light;
        sum[0] += light * (i % width) as f64;
        sum[1] += light * (i / width) as f64;
    }
    Blob {
        centre: sum.map(|value| value / flux),
        flux: flux + f64::from(THRESHOLD) * pixels.len() as f64,
        area_px: pixels.len(),
    }
}
