//! A grid of dots that is displayed, photographed, and found in the photograph.
//!
//! The dots lie on the corners of squares in the middle of the image. Some of them are [larger](super::dot_pattern), so
//! that the photograph tells how the camera stands.
//!
//! Bright [spots](super::spots) are searched at several scales, since neither the camera's scale nor the blur is known. At
//! each scale the spots that form a [lattice](super::lattice) give a grid, the light at each of its places is
//! [measured](super::dot_cells), and the whole is [compared](super::dot_match) with the displayed pattern.

use super::dot_cells::{Cell, SeenGrid};
use super::dot_match::{self, DotMatch, Seen};
use super::dot_pattern::{LARGE, MARKS};
use super::dot_sighting::{DAZZLING, DotSighting};
use super::error::AlignmentError;
use super::homography::{Homography, Point, PointFit, PointPair};
use super::{lattice, spots};
use lightpath_optics::Plane;

/// The grid of dots for a display of a given size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DotGrid {
    height_px: usize,
    width_px: usize,
    columns: usize,
    rows: usize,
    /// Side of a square \[px\].
    spacing_px: f64,
}

/// The dots found in a photograph.
#[derive(Clone, Debug, PartialEq)]
pub struct DotGridMatch {
    /// Map from the display's pixels to the camera's, fitted to the dots.
    pub fit: PointFit,
    /// All dots that were recognized.
    pub dots: Vec<PointPair>,
}

/// Number of squares along the shorter side of the display.
const SQUARES: f64 = 12.0;
/// Standard deviation of a dot's Gaussian profile, in squares.
const DOT_WIDTH: f64 = 0.1;
/// Part of each side of the image that the dots cover: the part where holograms need to be accurate.
const USED_PART: f64 = 0.8;
const DOTS_MIN: usize = 16;
/// Level from which a pixel is saturated.
const SATURATED: f32 = 0.999;
/// Radii of spots that are searched, in pixels of the camera.
const SPOT_RADII_PX: [usize; 8] = [1, 2, 3, 5, 8, 12, 18, 27];
/// Largest radius of a spot, as a part of the photograph's shorter side: that of dots that fill the photograph.
const SPOT_PART_MAX: f64 = 1.0 / 40.0;

impl DotGrid {
    /// Shortest allowed side of a display \[px\].
    pub const SIDE_PX_MIN: usize = 96;

    /// The grid of dots for a display of the given size.
    ///
    /// # Errors
    ///
    /// [`AlignmentError::DisplayTooSmall`] for a side below [`Self::SIDE_PX_MIN`].
    pub fn of_display(height_px: usize, width_px: usize) -> Result<Self, AlignmentError> {
        let side = height_px.min(width_px);
        if side < Self::SIDE_PX_MIN {
            return Err(AlignmentError::DisplayTooSmall { width_px, height_px, min_px: Self::SIDE_PX_MIN });
        }
        let spacing_px = side as f64 / SQUARES;
        let count = |side: usize| (USED_PART * side as f64 / spacing_px).floor() as usize;
        Ok(Self { height_px, width_px, columns: count(width_px), rows: count(height_px), spacing_px })
    }

    /// Number of dots along x and along y.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        (self.columns, self.rows)
    }

    /// The target image to display: linear light, 1 in the middle of a dot.
    #[must_use]
    pub fn target(&self) -> Plane<f32> {
        let mut target = Plane::filled(self.height_px, self.width_px, 0.0_f32);
        for (column, row) in self.dots() {
            let [x, y] = self.dot(column, row);
            let size_px = DOT_WIDTH * self.spacing_px * if self.is_large(column, row) { LARGE } else { 1.0 };
            let reach = 4.0 * size_px;
            let range = |centre: f64, side: usize| {
                (centre - reach).max(0.0) as usize..((centre + reach).ceil() as usize + 1).min(side)
            };
            for py in range(y, self.height_px) {
                for px in range(x, self.width_px) {
                    let squared = ((px as f64 - x).powi(2) + (py as f64 - y).powi(2)) / (size_px * size_px);
                    let light = &mut target.values_mut()[py * self.width_px + px];
                    *light = light.max((-0.5 * squared).exp() as f32);
                }
            }
        }
        target
    }

    /// Finds the dots in a photograph of the displayed grid. The photograph may be turned, mirrored, in perspective,
    /// and of any scale.
    ///
    /// # Errors
    ///
    /// [`AlignmentError::DotsNotFound`] for too few dots, [`AlignmentError::OrientationUnclear`] for dots that match the
    /// displayed ones in no orientation clearly, and the errors of the fit of a homography to the dots.
    pub fn find(&self, photo: &Plane<f32>) -> Result<DotGridMatch, AlignmentError> {
        let calm = spots::without_hot_pixels(photo);
        let radius_max = SPOT_PART_MAX * calm.height_px().min(calm.width_px()) as f64;
        let radii = SPOT_RADII_PX.into_iter().filter(|&radius| radius == 1 || radius as f64 <= radius_max);
        let mut best: Option<Sight> = None;
        for radius in radii {
            let sight = self.look(&calm, radius);
            if let Some(dots) = sight.dots(self) {
                return Ok(DotGridMatch { fit: Homography::from_points(&dots)?, dots });
            }
            if best.as_ref().is_none_or(|best| sight.rank() > best.rank()) {
                best = Some(sight);
            }
        }
        Err(best.map_or(AlignmentError::Degenerate, |sight| sight.refusal(self, photo)))
    }

    /// Looks for spots of a size that form a grid.
    fn look(&self, photo: &Plane<f32>, radius_px: usize) -> Sight {
        let points = spots::find(photo, radius_px);
        let mut positions: Vec<_> =
            lattice::grow(&points).into_iter().map(|(index, place)| (place, points[index])).collect();
        positions.sort_unstable_by_key(|(place, _)| *place);
        let grid = SeenGrid::of(photo, &positions).filter(|_| positions.len() >= self.needed());
        let compared = grid.as_ref().and_then(|grid| dot_match::compare(grid, self.columns, self.rows));
        Sight { spots: points, in_grid: positions.len(), grid, compared }
    }

    /// Fewest dots of a grid.
    fn needed(&self) -> usize {
        DOTS_MIN.min(self.columns * self.rows / 2)
    }

    /// Column and row of each dot.
    fn dots(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let columns = self.columns;
        (0..self.rows).flat_map(move |row| (0..columns).map(move |column| (column, row)))
    }

    /// Centre of a dot \[px\].
    fn dot(&self, column: usize, row: usize) -> Point {
        let along = |i: usize, count: usize, side: usize| {
            (side as f64 - 1.0) / 2.0 + (i as f64 - (count as f64 - 1.0) / 2.0) * self.spacing_px
        };
        [along(column, self.columns, self.width_px), along(row, self.rows, self.height_px)]
    }

    /// Whether a dot is large.
    fn is_large(&self, column: usize, row: usize) -> bool {
        let middle = ((self.columns as i32 - 1) / 2, (self.rows as i32 - 1) / 2);
        MARKS.contains(&(column as i32 - middle.0, row as i32 - middle.1))
    }
}

/// What a search at one scale saw.
struct Sight {
    spots: Vec<Point>,
    /// Number of spots that form a grid.
    in_grid: usize,
    grid: Option<SeenGrid>,
    compared: Option<DotMatch>,
}

impl Sight {
    /// The dots, if it is clear which is which.
    fn dots(&self, displayed: &DotGrid) -> Option<Vec<PointPair>> {
        let (grid, found) = (self.grid.as_ref()?, self.compared.filter(DotMatch::is_clear)?);
        let dot = |(place, seen)| {
            let Seen::Dot(_) = seen else { return None };
            let (column, row) = dot_match::inside(found.pose.displayed(place), displayed.columns, displayed.rows)?;
            Some(PointPair { display: displayed.dot(column, row), camera: grid.cells[&place].centre })
        };
        let mut dots: Vec<PointPair> = dot_match::seen_places(&grid.cells).into_iter().filter_map(dot).collect();
        dots.sort_by(|a, b| a.display[1].total_cmp(&b.display[1]).then(a.display[0].total_cmp(&b.display[0])));
        Some(dots)
    }

    /// How near the search came to a result.
    fn rank(&self) -> (f64, usize) {
        (self.compared.map_or(0.0, |found| found.best), self.in_grid)
    }

    fn refusal(self, displayed: &DotGrid, photo: &Plane<f32>) -> AlignmentError {
        let (found, needed) = (self.in_grid, displayed.needed());
        let seen = sighting(photo, &self.spots, self.grid.as_ref());
        match (self.grid, self.compared) {
            (Some(_), Some(compared)) => {
                let (best, second, lead) = (compared.best, compared.second, compared.lead());
                AlignmentError::OrientationUnclear { found, best, second, lead, seen }
            }
            _ => AlignmentError::DotsNotFound { found, needed, seen },
        }
    }
}

/// What was seen in a photograph with these spots, and with this grid if one was found.
fn sighting(photo: &Plane<f32>, spots: &[Point], grid: Option<&SeenGrid>) -> DotSighting {
    let values = photo.values();
    let saturated = values.iter().filter(|&&level| level >= SATURATED).count() as f64 / values.len() as f64;
    let brightest = values.iter().copied().fold(0.0, f32::max);
    let cells = || grid.iter().flat_map(|grid| grid.cells.values()).filter(|cell| cell.light > 0.0);
    let typical = |of: fn(&Cell) -> f64| {
        let mut values: Vec<f64> = cells().map(of).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    };
    let dot = typical(|cell| cell.light);
    let dazzling = cells().max_by(|a, b| a.light.total_cmp(&b.light)).zip(dot);
    let dazzling = dazzling.map(|(cell, dot)| (cell.centre, cell.light / dot)).filter(|(_, dots)| *dots >= DAZZLING);
    let dot_width = typical(|cell| cell.width).map(|width| width / DOT_WIDTH);
    DotSighting { spots: spots.len(), saturated, brightest: f64::from(brightest), dazzling, dot_width }
}

#[cfg(test)]
mod tests {
    use super::super::homography::distance;
    use super::*;

    /// Simulates a photograph of the grid with noise, a black level, and light that falls off towards the rim.
    fn photograph(grid: &DotGrid, map: &Homography, height_px: usize, width_px: usize) -> Plane<f32> {
        let (target, back) = (grid.target(), map.inverse());
        let mut state = 1_u64;
        let mut noise = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / (1 << 24) as f32 - 0.5
        };
        Plane::from_fn(height_px, width_px, |y, x| {
            let [u, v] = back.apply([x as f64, y as f64]);
            let inside =
                u >= 0.0 && v >= 0.0 && u < target.width_px() as f64 - 1.0 && v < target.height_px() as f64 - 1.0;
            let light = if inside { bilinear(&target, u, v) } else { 0.0 };
            let r = (x as f32 / width_px as f32 - 0.4).hypot(y as f32 / height_px as f32 - 0.6);
            (0.05 + 0.7 * light * (1.0 - r * r) + 0.06 * noise()).clamp(0.0, 1.0)
        })
    }

    fn bilinear(plane: &Plane<f32>, x: f64, y: f64) -> f32 {
        let (i, j) = (x as usize, y as usize);
        let (a, b) = ((x - x.floor()) as f32, (y - y.floor()) as f32);
        (1.0 - b) * ((1.0 - a) * plane.at(j, i) + a * plane.at(j, i + 1))
            + b * ((1.0 - a) * plane.at(j + 1, i) + a * plane.at(j + 1, i + 1))
    }

    #[test]
    fn dots_are_found_within_tenth_of_pixel_for_any_camera_pose() {
        let grid = DotGrid::of_display(360, 640).unwrap();
        let centre = [319.5, 179.5];
        let shifted = Homography::similarity(centre, 0.0, 1.0, [2.0, -2.0]);
        let turned = Homography::similarity(centre, 1.0_f64.to_radians(), 1.0, [2.0, 0.0]);
        let tilted = Homography::try_new([1.5, 0.05, 90.0, -0.03, 1.6, 60.0, 8e-5, -6e-5, 1.0]).unwrap();
        let mirrored = Homography::try_new([-1.2, 0.0, 820.0, 0.02, 1.2, 30.0, 0.0, 0.0, 1.0]).unwrap();
        let upside_down = Homography::similarity([450.0, 300.0], 3.1, 1.1, [0.0, 20.0]);
        let sideways = Homography::similarity(centre, 1.58, 1.0, [60.0, 160.0]);
        for (name, map, height, width) in [
            ("shifted", shifted, 360, 640),
            ("turned", turned, 360, 640),
            ("tilted", tilted, 700, 1100),
            ("mirrored", mirrored, 520, 900),
            ("upside down", upside_down, 700, 900),
            ("sideways", sideways, 680, 760),
        ] {
            let photo = photograph(&grid, &map, height, width);
            let found = grid.find(&photo).unwrap_or_else(|error| panic!("{name}: {error}"));
            for point in [[40.0, 30.0], [600.0, 30.0], [319.5, 179.5], [40.0, 330.0], [600.0, 330.0]] {
                let back = found.fit.homography.inverse().apply(map.apply(point));
                assert!(distance(back, point) < 0.1, "{name} at {point:?}: {back:?}");
            }
            assert!(
                found.dots.len() > 100 && found.fit.residual_px < 0.2,
                "{name}: {} {}",
                found.dots.len(),
                found.fit.residual_px
            );
        }
    }

    #[test]
    fn photographs_without_grid_and_small_displays_are_refused() {
        let grid = DotGrid::of_display(360, 640).unwrap();
        let dark = Plane::filled(300, 400, 0.0);
        assert!(matches!(grid.find(&dark), Err(AlignmentError::DotsNotFound { found: 0, .. })));
        let waves = Plane::from_fn(300, 400, |y, x| (0.5 + 0.5 * ((x * x + 3 * y) as f32 / 900.0).sin()).max(0.0));
        assert!(grid.find(&waves).is_err());
        assert!(DotGrid::of_display(64, 640).is_err());
    }

    #[test]
    fn grid_with_two_orientations_alike_is_refused_with_what_was_seen() {
        let grid = DotGrid::of_display(360, 640).unwrap();
        // Every dot is of the same size, and a spot outshines them.
        let photo = Plane::from_fn(360, 640, |y, x| {
            let dots = (0..grid.columns).flat_map(|c| (0..grid.rows).map(move |r| (c, r)));
            let light = |[u, v]: Point, size: f64| {
                (-0.5 * ((x as f64 - u).powi(2) + (y as f64 - v).powi(2)) / (size * size)).exp()
            };
            let all: f64 = dots.map(|(c, r)| light(grid.dot(c, r), 3.0)).sum();
            (0.2 * all + 2.0 * light([320.0, 180.0], 4.0)).min(1.0) as f32
        });
        let error = grid.find(&photo).unwrap_err();
        assert!(matches!(error, AlignmentError::OrientationUnclear { .. }), "{error}");
        let text = error.to_string();
        assert!(text.contains("dots form a grid") && text.contains("the best orientation matches by"), "{text}");
        assert!(text.contains("a spot as bright as") && text.contains("dots at (320, 180) px"), "{text}");
    }

    #[test]
    fn older_large_dots_are_recognized() {
        let grid = DotGrid::of_display(360, 640).unwrap();
        let middle = ((grid.columns as i32 - 1) / 2, (grid.rows as i32 - 1) / 2);
        let older = [(-1, 0), (1, 0), (-1, 1)].map(|(c, r)| ((middle.0 + c) as usize, (middle.1 + r) as usize));
        let camera = Homography::similarity([319.5, 179.5], 3.2, 1.0, [4.0, 3.0]);
        let back = camera.inverse();
        let photo = Plane::from_fn(360, 640, |y, x| {
            let [u, v] = back.apply([x as f64, y as f64]);
            let dots = (0..grid.columns).flat_map(|c| (0..grid.rows).map(move |r| (c, r)));
            let light = |(c, r): (usize, usize)| {
                let ([a, b], size) = (grid.dot(c, r), if older.contains(&(c, r)) { 5.1 } else { 3.0 });
                (-0.5 * ((u - a).powi(2) + (v - b).powi(2)) / (size * size)).exp()
            };
            (0.6 * dots.map(light).sum::<f64>()).min(1.0) as f32
        });
        let found = grid.find(&photo).unwrap().fit.homography;
        for point in [[40.0, 30.0], [600.0, 30.0], [40.0, 330.0]] {
            assert!(distance(found.apply(point), camera.apply(point)) < 0.1, "{point:?}");
        }
    }
}
