//! The light at each place of a grid of dots in a photograph.

use super::dot_pattern::Place;
use super::homography::{Homography, Point, PointPair};
use lightpath_optics::{Plane, interrupt};
use std::collections::BTreeMap;

/// The light in the square around a place of the grid.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    /// Middle of the light \[camera px\].
    pub(super) centre: Point,
    /// Light above the square's rim, in pixels of full scale.
    pub(super) light: f64,
    /// Light of the brightest patch, per pixel.
    pub(super) brightness: f64,
    /// Light of the brightest patch at the rim of the square, per pixel.
    rim_brightness: f64,
    /// Root mean square distance of the light from its middle along an axis, in squares.
    pub(super) width: f64,
}

impl Cell {
    /// Whether the light is a dot's, and not that of something that reaches into the square.
    pub(super) fn is_compact(&self) -> bool {
        self.rim_brightness < RIM_BRIGHTNESS_MAX * self.brightness
    }
}

/// The grid of dots as a photograph shows it, in columns and rows that begin anywhere.
#[derive(Clone, Debug)]
pub(super) struct SeenGrid {
    /// Map from columns and rows to the camera's pixels.
    map: Homography,
    photo_px: [usize; 2],
    pub(super) cells: BTreeMap<Place, Cell>,
}

/// Radius of the disk whose light counts, in squares. A large dot has 97 % of its light within it.
const DISK: f64 = 0.45;
/// Radius of the disk in which the middle of the light is searched, in squares: two and a half times that of a dot's
/// profile.
const CORE: f64 = 0.25;
/// Light less than this from the rim of its square tells how bright the surroundings are, in squares.
const RIM: f64 = 0.06;
/// Rounds of the search for the middle of the light.
const ROUNDS: usize = 5;
/// Patches along the side of a square. One is as wide as a dot, so that grains of speckle do not matter.
const PATCHES: usize = 5;
/// Largest brightness of a patch at the rim, as a part of the brightest one. It is 0.06 for large dots in focus.
const RIM_BRIGHTNESS_MAX: f64 = 0.5;
/// Fewest pixels of the camera in a square.
const PIXELS_MIN: usize = 16;

impl SeenGrid {
    /// The grid through spots with these columns and rows. `None`: they lie on a line.
    pub(super) fn of(photo: &Plane<f32>, spots: &[(Place, Point)]) -> Option<Self> {
        let pairs = spots
            .iter()
            .map(|&((column, row), camera)| PointPair { display: [f64::from(column), f64::from(row)], camera });
        let map = Homography::from_points(&pairs.collect::<Vec<_>>()).ok()?.homography;
        let mut grid = Self { map, photo_px: [photo.height_px(), photo.width_px()], cells: BTreeMap::new() };
        for &(place, spot) in spots {
            if let Some(cell) = grid.measured(photo, place, spot) {
                grid.cells.insert(place, cell);
            }
        }
        for place in places_around(spots) {
            if !grid.cells.contains_key(&place)
                && let Some(cell) = grid.measured(photo, place, grid.expected(place))
            {
                grid.cells.insert(place, cell);
            }
        }
        Some(grid)
    }

    /// Where the photograph should show a place \[camera px\].
    pub(super) fn expected(&self, (column, row): Place) -> Point {
        self.map.apply([f64::from(column), f64::from(row)])
    }

    /// Whether the photograph shows the whole square of a place.
    pub(super) fn is_in_photo(&self, (column, row): Place) -> bool {
        let [height, width] = self.photo_px.map(|side| side as f64 - 1.0);
        [[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]].iter().all(|[dx, dy]| {
            let [x, y] = self.map.apply([f64::from(column) + dx, f64::from(row) + dy]);
            (0.0..=width).contains(&x) && (0.0..=height).contains(&y)
        })
    }

    /// The light of a dot that is near `centre`.
    fn measured(&self, photo: &Plane<f32>, place: Place, centre: Point) -> Option<Cell> {
        interrupt::check();
        let pixels = self.square(photo, place, centre);
        if pixels.len() < PIXELS_MIN {
            return None;
        }
        let mut rim: Vec<f64> = pixels.iter().filter(|p| p.is_at_rim()).map(|p| p.value).collect();
        rim.sort_by(f64::total_cmp);
        let dark = *rim.get(rim.len() / 2)?;
        let above = |p: &&Pixel| p.value - dark;
        let middle = middle_of_light(&pixels, dark);
        let disk = || pixels.iter().filter(|p| p.off(middle) < DISK);
        let light: f64 = disk().map(|p| above(&p)).sum();
        let squares: f64 = disk().map(|p| above(&p).max(0.0) * p.off(middle).powi(2)).sum();
        let positive: f64 = disk().map(|p| above(&p).max(0.0)).sum();
        let width = if positive > 0.0 { (squares / positive / 2.0).sqrt() } else { 0.0 };
        let there = self.moved(place, centre, middle);
        let [brightness, rim_brightness] = brightest_patches(&pixels).map(|brightest| brightest - dark);
        Some(Cell { centre: there, light, brightness, rim_brightness, width })
    }

    /// The point of the photograph `step` squares from `centre`, which stands for the place.
    fn moved(&self, (column, row): Place, centre: Point, step: Point) -> Point {
        let at = [f64::from(column), f64::from(row)];
        let (from, to) = (self.map.apply(at), self.map.apply([at[0] + step[0], at[1] + step[1]]));
        [centre[0] + to[0] - from[0], centre[1] + to[1] - from[1]]
    }

    /// The pixels of the square around a dot at `centre`.
    fn square(&self, photo: &Plane<f32>, place: Place, centre: Point) -> Vec<Pixel> {
        let at = [f64::from(place.0), f64::from(place.1)];
        let (expected, back) = (self.map.apply(at), self.map.inverse());
        let reach = 1.5 * self.map.magnification(at);
        let range = |centre: f64, side: usize| {
            (centre - reach).max(0.0) as usize..((centre + reach).max(0.0) as usize + 1).min(side)
        };
        let mut pixels = Vec::new();
        for y in range(centre[1], photo.height_px()) {
            for x in range(centre[0], photo.width_px()) {
                let [column, row] =
                    back.apply([x as f64 - centre[0] + expected[0], y as f64 - centre[1] + expected[1]]);
                let (dx, dy) = (column - at[0], row - at[1]);
                if dx.abs() <= 0.5 && dy.abs() <= 0.5 {
                    pixels.push(Pixel { dx, dy, value: f64::from(photo.at(y, x)) });
                }
            }
        }
        pixels
    }
}

/// A pixel, by its distance from the middle of its square in squares.
struct Pixel {
    dx: f64,
    dy: f64,
    value: f64,
}

impl Pixel {
    fn is_at_rim(&self) -> bool {
        self.dx.abs().max(self.dy.abs()) > 0.5 - RIM
    }

    fn off(&self, [x, y]: Point) -> f64 {
        (self.dx - x).hypot(self.dy - y)
    }
}

/// The means of the brightest of the [`PATCHES`]² patches of a square, and of the brightest of those at its rim.
fn brightest_patches(pixels: &[Pixel]) -> [f64; 2] {
    let mut patches = [(0.0, 0_u32); PATCHES * PATCHES];
    let index = |off: f64| (((off + 0.5) * PATCHES as f64) as usize).min(PATCHES - 1);
    for pixel in pixels {
        let (sum, count) = &mut patches[index(pixel.dy) * PATCHES + index(pixel.dx)];
        *sum += pixel.value;
        *count += 1;
    }
    let is_end = |i: usize| i == 0 || i == PATCHES - 1;
    let mut brightest = [f64::MIN; 2];
    for (i, (sum, count)) in patches.into_iter().enumerate().filter(|(_, (_, count))| *count > 0) {
        let mean = sum / f64::from(count);
        brightest[0] = brightest[0].max(mean);
        if is_end(i % PATCHES) || is_end(i / PATCHES) {
            brightest[1] = brightest[1].max(mean);
        }
    }
    brightest
}

/// The middle of the light within [`CORE`] of itself.
fn middle_of_light(pixels: &[Pixel], dark: f64) -> Point {
    let mut middle = [0.0; 2];
    for _ in 0..ROUNDS {
        let (mut sum, mut weights) = ([0.0; 2], 0.0);
        for pixel in pixels.iter().filter(|pixel| pixel.off(middle) < CORE) {
            let weight = (pixel.value - dark).max(0.0);
            weights += weight;
            sum[0] += weight * pixel.dx;
            sum[1] += weight * pixel.dy;
        }
        if weights <= 0.0 {
            break;
        }
        middle = sum.map(|value| value / weights);
    }
    middle
}

/// All places of the rectangle around the spots, and one more on each side.
fn places_around(spots: &[(Place, Point)]) -> impl Iterator<Item = Place> + use<> {
    let span = |of: fn(&Place) -> i32| {
        let values = || spots.iter().map(|(place, _)| of(place));
        values().min().unwrap_or(0) - 1..=values().max().unwrap_or(0) + 1
    };
    let (columns, rows) = (span(|place| place.0), span(|place| place.1));
    rows.flat_map(move |row| columns.clone().map(move |column| (column, row)))
}
