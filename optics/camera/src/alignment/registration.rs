//! The affine map that the tiles of photographs agree on, and what of it is certainly the camera's.
//!
//! The affine map M of the displacements is split into parts, because a camera can make all of them, and the display
//! only some:
//!
//! ```text
//! M p = m + t + R S (p − m)
//! ```
//!
//! m middle of the region, t the shift, R the turn, S the stretch (scale and shear). A turn is certainly the camera's:
//! the surface of a modulator displaces light by a gradient, which has no curl (`camera_turn`). Shift and stretch can
//! be the camera's, or the surface's.

use super::camera_turn::{CameraTurn, HUBER_PX, OUTLIER_PX};
use super::homography::{Homography, Point, distance};
use lightpath_optics::RegionOfInterest;
use lightpath_optics::numerics::least_squares::NormalEquations;
use lightpath_optics::numerics::tiles::Tiles;

/// Result of the registration: an affine correction, its parts, and its quality.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Registration {
    /// Affine map from a point of the display to the place where its light was found, both in pixels of the display.
    pub correction: Homography,
    /// The shift and the turn of the correction, without its stretch.
    pub rigid: Homography,
    /// Root mean square of the correction's displacement over the region \[px\].
    pub misalignment_px: f64,
    /// Length of the displacement of the region's middle \[px\].
    pub shift_px: f64,
    /// Root mean square, over the region, of the displacement by the turn about its middle \[px\]; negative for a turn
    /// from y towards x.
    pub turn_px: f64,
    /// Uncertainty of `turn_px`, from the scatter of the tiles.
    pub turn_uncertainty_px: f64,
    /// Root mean square, over the region, of the displacement by scale and shear \[px\].
    pub stretch_px: f64,
    /// Number of tiles used.
    pub tiles: usize,
}

/// Fewest tiles that a correction is fitted to.
const TILES_MIN: usize = 6;

impl Registration {
    /// The correction that most tiles agree on. `None` when too few tiles have a clear peak.
    #[must_use]
    pub fn of(tiles: &Tiles, region: RegionOfInterest) -> Option<Self> {
        let repeats = (tiles.count() * tiles.pixels_of_one()) as f64 / region.pixels() as f64;
        fit(&tiles.displacements(), region, repeats)
    }
}

/// Fits an affine displacement by iteratively reweighted least squares. Each pixel is in `repeats` tiles.
fn fit(displacements: &[(Point, Point)], region: RegionOfInterest, repeats: f64) -> Option<Registration> {
    if displacements.len() < TILES_MIN {
        return None;
    }
    let frame = Frame::of(region);
    let parameters = frame.parameters(displacements)?;
    let off = |&(p, shift): &(Point, Point)| distance(frame.predicted(&parameters, p), shift);
    let used: Vec<(Point, Point)> = displacements.iter().filter(|at| off(at) <= OUTLIER_PX).copied().collect();
    if used.len() < TILES_MIN || 2 * used.len() < displacements.len() {
        return None;
    }
    let Frame { centre, half } = frame;
    let turn = CameraTurn::of(displacements, centre, half[0].max(half[1]), repeats)?;
    let shift = parameters.map(|row| row[0]);
    // The derivatives of the displacement, per pixel along both axes.
    let slopes = parameters.map(|row| [row[1] / half[0], row[2] / half[1]]);
    let parts = Parts::of(slopes, turn.rad);
    Some(Registration {
        correction: frame.about_middle(slopes, shift)?,
        rigid: Homography::similarity(centre, parts.turn_rad, 1.0, shift),
        misalignment_px: (shift[0].powi(2) + shift[1].powi(2) + frame.rms(slopes).powi(2)).sqrt(),
        shift_px: shift[0].hypot(shift[1]),
        turn_px: frame.rms(parts.turn).copysign(parts.turn_rad),
        turn_uncertainty_px: frame.rms([[0.0, -turn.uncertainty_rad], [turn.uncertainty_rad, 0.0]]),
        stretch_px: frame.rms(parts.stretch),
        tiles: used.len(),
    })
}

/// The turn and the stretch of an affine map 1 + slopes = R S. Each is the map's derivatives minus those of the
/// identity.
struct Parts {
    turn_rad: f64,
    turn: [[f64; 2]; 2],
    stretch: [[f64; 2]; 2],
}

impl Parts {
    /// Splits the derivatives of a displacement whose curl is twice `half_curl`. For a displacement that is exactly
    /// affine this is the polar decomposition, and the stretch is symmetric.
    fn of([[xx, xy], [yx, yy]]: [[f64; 2]; 2], half_curl: f64) -> Self {
        let turn_rad = (2.0 * half_curl).atan2(2.0 + xx + yy);
        let (sine, cosine) = turn_rad.sin_cos();
        // S = Rᵀ (1 + slopes).
        let stretch = [
            [cosine * (1.0 + xx) + sine * yx - 1.0, cosine * xy + sine * (1.0 + yy)],
            [cosine * yx - sine * (1.0 + xx), cosine * (1.0 + yy) - sine * xy - 1.0],
        ];
        Self { turn_rad, turn: [[cosine - 1.0, -sine], [sine, cosine - 1.0]], stretch }
    }
}

/// Centre and half sides of a region. Displacements are linear in the position relative to them.
struct Frame {
    centre: Point,
    half: Point,
}

impl Frame {
    fn of(region: RegionOfInterest) -> Self {
        Self {
            centre: [
                region.x_px() as f64 + (region.width_px() as f64 - 1.0) / 2.0,
                region.y_px() as f64 + (region.height_px() as f64 - 1.0) / 2.0,
            ],
            half: [region.width_px() as f64 / 2.0, region.height_px() as f64 / 2.0],
        }
    }

    /// The affine map whose displacement has these derivatives, and is `shift` in the middle.
    fn about_middle(&self, [[xx, xy], [yx, yy]]: [[f64; 2]; 2], shift: Point) -> Option<Homography> {
        let [x, y] = self.centre;
        let (to_x, to_y) = (shift[0] - xx * x - xy * y, shift[1] - yx * x - yy * y);
        Homography::try_new([1.0 + xx, xy, to_x, yx, 1.0 + yy, to_y, 0.0, 0.0, 1.0]).ok()
    }

    /// Root mean square over the region of a displacement with these derivatives, which is 0 in the middle \[px\].
    fn rms(&self, slopes: [[f64; 2]; 2]) -> f64 {
        // The mean square of a linear function over [−1, 1] is a third of the square of its value at the end.
        let squares = slopes.as_flattened().iter().zip(self.half.iter().cycle());
        (squares.map(|(slope, half)| (slope * half).powi(2)).sum::<f64>() / 3.0).sqrt()
    }

    fn at(&self, p: Point) -> [f64; 3] {
        [1.0, (p[0] - self.centre[0]) / self.half[0], (p[1] - self.centre[1]) / self.half[1]]
    }

    fn predicted(&self, parameters: &[[f64; 3]; 2], p: Point) -> Point {
        parameters.map(|row| row.iter().zip(self.at(p)).map(|(a, b)| a * b).sum())
    }

    /// The linear functions that fit the displacements in x and y of most tiles.
    fn parameters(&self, displacements: &[(Point, Point)]) -> Option<[[f64; 3]; 2]> {
        // A start at the medians is robust even when a third of the tiles are wrong.
        let mut parameters = [[0.0; 3]; 2];
        for (axis, parameters) in parameters.iter_mut().enumerate() {
            let mut shifts: Vec<f64> = displacements.iter().map(|(_, shift)| shift[axis]).collect();
            shifts.sort_by(f64::total_cmp);
            parameters[0] = shifts[shifts.len() / 2];
        }
        let mut outlier_px = f64::INFINITY;
        for round in 0..30 {
            let mut equations = [NormalEquations::<3>::none(), NormalEquations::<3>::none()];
            for &(p, shift) in displacements {
                let off = distance(self.predicted(&parameters, p), shift);
                if off > outlier_px {
                    continue;
                }
                let weight = if off > HUBER_PX { HUBER_PX / off } else { 1.0 };
                for (axis, equations) in equations.iter_mut().enumerate() {
                    equations.add(&self.at(p), shift[axis], weight);
                }
            }
            let [x, y] = equations;
            parameters = [x.solve()?, y.solve()?];
            if round == 9 {
                outlier_px = OUTLIER_PX;
            }
        }
        Some(parameters)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::alignment::warp::warp;
    use lightpath_bench::TestCard;
    use lightpath_optics::{Grid, Plane};

    fn region(height_px: usize, width_px: usize) -> RegionOfInterest {
        RegionOfInterest::middle(&Grid::try_new(height_px, width_px, 8e-6).unwrap())
    }

    /// A card, and its photograph by a camera at `map`, unevenly lit and with noise.
    fn pair(seed: u64, map: &Homography) -> (Plane<f32>, Plane<f32>) {
        let card = TestCard::ALL[seed as usize % TestCard::ALL.len()].render(360, 640, seed).unwrap();
        let mut state = seed;
        let photo = warp(&card, &map.inverse(), 360, 640, 9.0, 0.0);
        let photo = Plane::from_fn(360, 640, |y, x| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let noise = (state >> 40) as f32 / (1 << 24) as f32 - 0.5;
            let r = (x as f32 / 640.0 - 0.4).hypot(y as f32 / 360.0 - 0.5);
            0.03 + 0.6 * photo.at(y, x) * (1.0 - 0.8 * r * r) + 0.05 * noise
        });
        (card, photo)
    }

    /// Repeats the registration as a caller does, until the correction vanishes.
    fn aligned(map: &Homography) -> Homography {
        let region = region(360, 640);
        let pairs: Vec<_> = (0..4).map(|seed| pair(seed, map)).collect();
        let mut found = Homography::IDENTITY;
        for _ in 0..4 {
            let mut tiles = Tiles::cover(region).unwrap();
            for (card, photo) in &pairs {
                tiles.add(card, &warp(photo, &found, 360, 640, 0.999, 1.0), 0.999);
            }
            found = found.after(&Registration::of(&tiles, region).unwrap().correction);
        }
        found
    }

    #[test]
    fn shifts_and_rotations_are_found_within_tenth_of_pixel() {
        for (angle_deg, scale, shift) in
            [(0.0, 1.0, [2.0, 0.0]), (1.0, 1.0, [1.4, -1.4]), (-0.6, 1.01, [-3.3, 0.7_f64])]
        {
            let map = Homography::similarity([319.5, 179.5], f64::to_radians(angle_deg), scale, shift);
            let found = aligned(&map);
            for point in [[64.0, 36.0], [575.0, 36.0], [319.5, 179.5], [64.0, 323.0], [575.0, 323.0]] {
                let error = distance(found.apply(point), map.apply(point));
                assert!(error < 0.1, "{angle_deg}°, {scale}, {shift:?} at {point:?}: {error} px");
            }
        }
    }

    #[test]
    fn misalignment_and_distortion_are_measured() {
        let region = region(360, 640);
        let measure = |map: &Homography| {
            let mut tiles = Tiles::cover(region).unwrap();
            (0..4).for_each(|seed| {
                let (card, photo) = pair(seed, map);
                tiles.add(&card, &photo, 0.999);
            });
            Registration::of(&tiles, region).unwrap()
        };
        let shifted = measure(&Homography::similarity([319.5, 179.5], 0.0, 1.0, [2.0, 0.0]));
        assert!((shifted.misalignment_px - 2.0).abs() < 0.1 && (shifted.shift_px - 2.0).abs() < 0.1, "{shifted:?}");
        assert!(shifted.turn_px.abs() < 0.1 && shifted.stretch_px < 0.1, "{shifted:?}");
        let turned = measure(&Homography::similarity([319.5, 179.5], 1.0_f64.to_radians(), 1.0, [0.0, 0.0]));
        let expected = 1.0_f64.to_radians() * (256.0_f64.powi(2) / 3.0 + 144.0_f64.powi(2) / 3.0).sqrt();
        assert!((turned.turn_px - expected).abs() < 0.15, "{turned:?}, expected {expected}");
        assert!(turned.turn_uncertainty_px < 0.3 && turned.stretch_px < 0.15, "{turned:?}");
    }

    /// Registration of tiles in `rows` rows and twice as many columns, whose displacements are exactly these.
    fn registered(region: RegionOfInterest, rows: usize, displacement: impl Fn(Point) -> Point) -> Registration {
        let at = |i: usize, count: usize, start: usize, length: usize| {
            start as f64 + length as f64 * (i as f64 + 0.5) / count as f64
        };
        let columns = 2 * rows;
        let places = (0..rows * columns).map(|i| {
            let x = at(i % columns, columns, region.x_px(), region.width_px());
            [x, at(i / columns, rows, region.y_px(), region.height_px())]
        });
        let displacements: Vec<(Point, Point)> = places.map(|p| (p, displacement(p))).collect();
        fit(&displacements, region, 1.0).unwrap()
    }

    #[test]
    fn affine_map_is_split_into_shift_turn_and_stretch() {
        // A region that is much wider than high.
        let region = region(300, 800);
        let Frame { centre, half } = Frame::of(region);
        let (along_x, along_y) = (half[0] / 3.0_f64.sqrt(), half[1] / 3.0_f64.sqrt());
        // Turn, scales along x and y, shear, shift.
        for (degrees, [scale_x, scale_y, shear], shift) in [
            (0.7_f64, [0.0, 0.0, 0.0], [0.0, 0.0]),
            (8.0, [0.0, 0.0, 0.0], [1.0, -2.0]),
            (0.0, [0.01, 0.01, 0.0], [0.0, 0.0]),
            (0.0, [0.01, -0.003, 0.0], [0.0, 3.0]),
            (0.0, [0.0, 0.0, 0.004], [0.0, 0.0]),
            (-0.4, [0.006, -0.002, 0.003], [-1.5, 0.25]),
        ] {
            let (sine, cosine) = degrees.to_radians().sin_cos();
            let displacement = |[x, y]: Point| {
                let (x, y) = (x - centre[0], y - centre[1]);
                let (sx, sy) = ((1.0 + scale_x) * x + shear * y, shear * x + (1.0 + scale_y) * y);
                [cosine * sx - sine * sy - x + shift[0], sine * sx + cosine * sy - y + shift[1]]
            };
            let found = registered(region, 5, displacement);
            let turn_px = 2.0 * (degrees.to_radians() / 2.0).sin() * along_x.hypot(along_y);
            let stretch_px = ((scale_x * along_x).powi(2)
                + (scale_y * along_y).powi(2)
                + shear * shear * (along_x.powi(2) + along_y.powi(2)))
            .sqrt();
            let shift_px = shift[0].hypot(shift[1]);
            for (found, truth) in [(found.turn_px, turn_px), (found.stretch_px, stretch_px), (found.shift_px, shift_px)]
            {
                assert!((found - truth).abs() < 2e-3, "{degrees}°, {scale_x} {scale_y} {shear}: {found}, not {truth}");
            }
            assert!(found.turn_uncertainty_px < 0.01, "{found:?}");
            let rigid = Homography::similarity(centre, degrees.to_radians(), 1.0, shift);
            assert!(distance(found.rigid.apply([40.0, 30.0]), rigid.apply([40.0, 30.0])) < 5e-3, "{found:?}");
        }
    }

    #[test]
    fn bend_of_modulator_is_no_turn() {
        let region = region(300, 800);
        let Frame { centre, half } = Frame::of(region);
        let unit = |[x, y]: Point| [(x - centre[0]) / half[0], (y - centre[1]) / half[0]];
        // The gradient of x³y, of which the best affine map is turned, and that of a wave, which is no polynomial.
        let cubic = |p: Point| {
            let [x, y] = unit(p);
            [6.0 * 3.0 * x * x * y, 6.0 * x.powi(3)]
        };
        let wave = |p: Point| {
            let [x, y] = unit(p);
            let slope = 1.5 * (2.0 * x + 3.0 * y + 0.4).cos();
            [2.0 * slope, 3.0 * slope]
        };
        for rows in [3, 5] {
            for (bend, degrees) in
                [(&cubic as &dyn Fn(Point) -> Point, 0.0), (&cubic, 0.5), (&wave, 0.0), (&wave, -0.5)]
            {
                let turn = Homography::similarity(centre, f64::to_radians(degrees), 1.0, [0.0, 0.0]);
                let displacement = |p: Point| {
                    let [x, y] = bend(p);
                    let seen = turn.apply([p[0] + x, p[1] + y]);
                    [seen[0] - p[0], seen[1] - p[1]]
                };
                let found = registered(region, rows, displacement);
                let truth = 2.0 * (f64::to_radians(degrees) / 2.0).sin() * half[0].hypot(half[1]) / 3.0_f64.sqrt();
                let error = (found.turn_px - truth).abs();
                assert!(error < 0.05 && error <= found.turn_uncertainty_px + 0.01, "{rows} {degrees}°: {found:?}");
            }
        }
    }

    #[test]
    fn unrelated_photographs_give_no_registration() {
        let region = region(360, 640);
        let mut tiles = Tiles::cover(region).unwrap();
        let (card, _) = pair(0, &Homography::IDENTITY);
        let (_, other) = pair(5, &Homography::IDENTITY);
        tiles.add(&card, &other, 0.999);
        assert_eq!(Registration::of(&tiles, region), None);
        assert!(Tiles::cover(self::region(48, 64)).is_none());
    }
}
