//! A grid of dots that is displayed, photographed, and found in the photograph.
//!
//! The dots lie on the corners of squares in the middle of the image. Three of them are larger and form an L with legs
//! of one and two squares. No turn and no mirror image of the L coincides with it, so it identifies every dot.
//!
//! ```text
//! · · · · · · ·
//! · · A · B · ·      A → B two squares towards +x,
//! · · C · · · ·      A → C one square towards +y
//! · · · · · · ·
//! ```

use super::blobs::{self, Blob};
use super::error::AlignmentError;
use super::homography::{Homography, Point, PointFit, PointPair};
use super::lattice;
use lightpath_optics::Plane;
use std::collections::HashMap;

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
/// Size of a large dot relative to the other dots.
const LARGE: f64 = 1.7;
/// Least light of a large dot relative to the dots around it. The expected ratio is 1.7² = 2.9.
const LARGE_FLUX_MIN: f64 = 1.6;
/// Part of each side of the image that the dots cover: the part where holograms need to be accurate.
const USED_PART: f64 = 0.8;
const DOTS_MIN: usize = 16;

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
            let size_px =
                DOT_WIDTH * self.spacing_px * if self.markers().contains(&(column, row)) { LARGE } else { 1.0 };
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
    /// [`AlignmentError::DotsNotFound`] for too few dots, [`AlignmentError::MarkersNotFound`] without the three large
    /// dots, and the errors of the fit of a homography to the dots.
    pub fn find(&self, photo: &Plane<f32>) -> Result<DotGridMatch, AlignmentError> {
        let blobs = blobs::find(photo);
        let points: Vec<Point> = blobs.iter().map(|blob| blob.centre).collect();
        let positions = lattice::grow(&points);
        let needed = DOTS_MIN.min(self.columns * self.rows / 2);
        if positions.len() < needed {
            let hint = match blobs.len() {
                0 => "the photograph shows no bright spots; expose it longer",
                _ => "photograph the whole calibration hologram, in focus and without stray light",
            };
            return Err(AlignmentError::DotsNotFound { found: positions.len(), needed, hint });
        }
        let frame =
            find_markers(&blobs, &positions).ok_or(AlignmentError::MarkersNotFound { found: positions.len() })?;
        let (marker_column, marker_row) = self.marker();
        let mut dots = Vec::new();
        for (&index, &position) in &positions {
            let (along_x, along_y) = frame.coordinates(position);
            let (column, row) = (marker_column as i32 + along_x, marker_row as i32 + along_y);
            let inside = (0..self.columns as i32).contains(&column) && (0..self.rows as i32).contains(&row);
            if inside {
                dots.push(PointPair { display: self.dot(column as usize, row as usize), camera: points[index] });
            }
        }
        if dots.len() < needed {
            let hint = "most dots lie outside the displayed grid; photograph the calibration hologram of this display";
            return Err(AlignmentError::DotsNotFound { found: dots.len(), needed, hint });
        }
        dots.sort_by(|a, b| a.display[1].total_cmp(&b.display[1]).then(a.display[0].total_cmp(&b.display[0])));
        Ok(DotGridMatch { fit: Homography::from_points(&dots)?, dots })
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

    /// Column and row of the dot at the corner of the L.
    fn marker(&self) -> (usize, usize) {
        ((self.columns - 1) / 2 - 1, (self.rows - 1) / 2)
    }

    fn markers(&self) -> [(usize, usize); 3] {
        let (column, row) = self.marker();
        [(column, row), (column + 2, row), (column, row + 1)]
    }
}

/// Position and orientation of the L in the coordinates that were assigned to the spots.
struct Frame {
    corner: (i32, i32),
    along_x: (i32, i32),
    along_y: (i32, i32),
}

impl Frame {
    /// Number of squares from the corner of the L towards the display's +x and +y.
    fn coordinates(&self, position: (i32, i32)) -> (i32, i32) {
        let step = (position.0 - self.corner.0, position.1 - self.corner.1);
        let dot = |axis: (i32, i32)| axis.0 * step.0 + axis.1 * step.1;
        (dot(self.along_x), dot(self.along_y))
    }
}

/// Finds the L whose faintest dot exceeds its surroundings most.
fn find_markers(blobs: &[Blob], positions: &HashMap<usize, (i32, i32)>) -> Option<Frame> {
    let by_position: HashMap<(i32, i32), usize> =
        positions.iter().map(|(&index, &position)| (position, index)).collect();
    let ratios: HashMap<(i32, i32), f64> = by_position
        .iter()
        .filter_map(|(&position, &index)| Some((position, relative_flux(blobs, &by_position, position, index)?)))
        .collect();
    let mut corners: Vec<_> = ratios.keys().copied().collect();
    corners.sort_unstable();
    let mut best: Option<(f64, Frame)> = None;
    for corner in corners {
        for (along_x, along_y) in
            [(1, 0), (-1, 0), (0, 1), (0, -1)].into_iter().flat_map(|(a, b)| [((a, b), (b, a)), ((a, b), (-b, -a))])
        {
            let at = |steps: i32, axis: (i32, i32)| ratios.get(&(corner.0 + steps * axis.0, corner.1 + steps * axis.1));
            let (Some(far), Some(near)) = (at(2, along_x), at(1, along_y)) else { continue };
            let faintest = ratios[&corner].min(*far).min(*near);
            if faintest >= LARGE_FLUX_MIN && best.as_ref().is_none_or(|(most, _)| faintest > *most) {
                best = Some((faintest, Frame { corner, along_x, along_y }));
            }
        }
    }
    Some(best?.1)
}

/// Light of a spot relative to the median of the spots around it.
fn relative_flux(
    blobs: &[Blob],
    by_position: &HashMap<(i32, i32), usize>,
    position: (i32, i32),
    index: usize,
) -> Option<f64> {
    const REACH: i32 = 2;
    let mut around: Vec<f64> = (-REACH..=REACH)
        .flat_map(|dy| (-REACH..=REACH).map(move |dx| (dx, dy)))
        .filter(|step| *step != (0, 0))
        .filter_map(|(dx, dy)| by_position.get(&(position.0 + dx, position.1 + dy)))
        .map(|&i| blobs[i].flux)
        .collect();
    around.sort_by(f64::total_cmp);
    let median = *around.get(around.len() / 2)?;
    (around.len() >= 5).then(|| blobs[index].flux / median)
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
    fn grid_without_three_large_dots_is_refused() {
        let grid = DotGrid::of_display(360, 640).unwrap();
        let mut target = grid.target();
        let [x, y] = grid.dot(grid.marker().0 + 2, grid.marker().1);
        for (py, px) in (0..360).flat_map(|y| (0..640).map(move |x| (y, x))) {
            if distance([px as f64, py as f64], [x, y]) < 12.0 {
                let squared = distance([px as f64, py as f64], [x, y]).powi(2) / 9.0;
                target.values_mut()[py * 640 + px] = (-0.5 * squared).exp() as f32;
            }
        }
        assert!(matches!(grid.find(&target), Err(AlignmentError::MarkersNotFound { .. })));
    }
}
