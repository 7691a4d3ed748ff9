//! How the camera stands: the photograph's grid is compared with the predicted one in each of eight orientations, at
//! each shift.
//!
//! ```text
//! c = ln( light of the dot / usual light of a dot at its place ), from −0.2 to 0.8
//! r = correlation of c with 1 at large dots and 0 at others
//! ```
//!
//! Light that falls off, speckle and blur hardly change c. Stray light that is brighter than dots
//! decides nothing, and else counts as one large dot at most. Only places that predicted and seen grid share are compared, if they share most. The orientation is known if r is
//! large and clearly larger than for all others: by more standard deviations of what it leaves unexplained than chance gives.

use super::dot_cells::{Cell, SeenGrid};
use super::dot_pattern::{Orientation, PATTERNS, Place};
use super::error::{LEAD_MIN, MATCH_MIN};
use std::collections::BTreeMap;

/// The place of the seen grid in the displayed one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pose {
    orientation: Orientation,
    shift: Place,
}

/// The best pose, and how well poses match.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct DotMatch {
    pub(super) pose: Pose,
    /// r of the best pose.
    pub(super) best: f64,
    /// Largest r of the other poses.
    pub(super) second: f64,
    /// Number of compared places.
    places: usize,
}

/// Largest contrast that counts. Large dots reach half of it and more.
const CONTRAST_MAX: f64 = 0.8;
/// Least contrast that counts. Dots are not darker than others by what is displayed, only at the rim of the light.
const CONTRAST_MIN: f64 = -0.2;
/// Least light of a dot, as a part of that of the brighter dots around it.
const DOT_LIGHT_MIN: f64 = 0.3;
/// Least light of the dots around a place, as a part of the median of all. Faint spots beside the grid are no dots.
const SURROUNDINGS_MIN: f64 = 0.25;
/// Largest brightness of a dot, as a part of that of the brighter dots around it. Large dots are wider, hardly brighter:
/// beyond it is stray light.
const BRIGHTNESS_MAX: f64 = 2.2;
/// Least brightness of stray light that reaches into a square, as a part of that of the brighter dots around it.
const STRAY_BRIGHTNESS_MIN: f64 = 0.5;
/// Least part of the seen dots that lies in the predicted grid, and of the predicted dots in the photograph that is seen.
const SHARED_MIN: f64 = 0.7;
/// Reach of the dots around a place, in squares.
const REACH: i32 = 2;
/// Fewest pairs of dots on opposite sides of a dot that tell how much light it would usually have.
const PAIRS_MIN: usize = 2;

impl Pose {
    /// Column and row in the displayed grid, counted from its middle.
    pub(super) fn displayed(&self, place: Place) -> Place {
        let (column, row) = self.orientation.apply(place);
        (column + self.shift.0, row + self.shift.1)
    }
}

impl DotMatch {
    pub(super) fn is_clear(&self) -> bool {
        self.best >= MATCH_MIN && self.lead() >= LEAD_MIN
    }

    /// √(n (r₁² − r₂²) / (1 − r₁²)): how much more the second-best pose leaves unexplained.
    pub(super) fn lead(&self) -> f64 {
        let [best, second] = [self.best, self.second].map(|r| r * r);
        (self.places as f64 * (best - second) / (1.0 - best).max(1e-9)).sqrt()
    }
}

/// What a place shows, if it shows anything.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Seen {
    /// A dot with this contrast c.
    Dot(f64),
    /// Stray light, which may hide a dot of any size.
    Stray,
}

/// What each place shows.
pub(super) fn seen_places(cells: &BTreeMap<Place, Cell>) -> BTreeMap<Place, Seen> {
    let of_all = median(cells.values().map(|cell| cell.light).filter(|&light| light > 0.0).collect()).unwrap_or(0.0);
    let (mut dots, mut stray) = (BTreeMap::new(), Vec::new());
    for (&place, cell) in cells {
        let around = |of| brighter_around(cells, place, of);
        let (Some(light), Some(brightness)) = (around(|cell| cell.light), around(|cell| cell.brightness)) else {
            continue;
        };
        let is_bright = cell.light >= DOT_LIGHT_MIN * light.max(SURROUNDINGS_MIN * of_all);
        match cell.brightness / brightness {
            times if times > BRIGHTNESS_MAX => stray.push(place),
            times if !cell.is_compact() && times > STRAY_BRIGHTNESS_MIN => stray.push(place),
            _ if is_bright && cell.is_compact() => drop(dots.insert(place, cell.light)),
            _ => (),
        }
    }
    let contrast = |(&place, &light): (&Place, &f64)| {
        let usual = usual_light(&dots, place).or_else(|| brighter_around(&dots, place, |&light| light))?;
        Some((place, Seen::Dot((light / usual).ln().clamp(CONTRAST_MIN, CONTRAST_MAX))))
    };
    dots.iter().filter_map(contrast).chain(stray.into_iter().map(|place| (place, Seen::Stray))).collect()
}

/// Steps to the places around a place, without those that are opposite to another.
fn steps() -> impl Iterator<Item = Place> {
    (-REACH..=REACH).flat_map(|dy| (-REACH..=REACH).map(move |dx| (dx, dy))).filter(|&step| step > (0, 0))
}

/// Median of the brighter half of the places around one. Beside the rim of the grid are no dots.
fn brighter_around<T>(cells: &BTreeMap<Place, T>, (x, y): Place, of: fn(&T) -> f64) -> Option<f64> {
    let around = steps().flat_map(|(dx, dy)| [(x + dx, y + dy), (x - dx, y - dy)]);
    let mut around: Vec<f64> = around.filter_map(|place| cells.get(&place).map(of)).collect();
    around.sort_by(f64::total_cmp);
    median(around.split_off(around.len() / 2))
}

/// Median of the geometric means of dots on opposite sides: the light of a dot where light falls off to one side.
fn usual_light(dots: &BTreeMap<Place, f64>, (x, y): Place) -> Option<f64> {
    let light = |place| dots.get(&place);
    let means = steps().filter_map(|(dx, dy)| Some((light((x + dx, y + dy))? * light((x - dx, y - dy))?).sqrt()));
    let means: Vec<f64> = means.collect();
    if means.len() >= PAIRS_MIN { median(means) } else { None }
}

/// Compares the seen grid with the displayed one of `columns` × `rows` dots. `None`: no pose shares enough dots.
pub(super) fn compare(seen: &SeenGrid, columns: usize, rows: usize) -> Option<DotMatch> {
    let shown = seen_places(&seen.cells);
    let mut scores: Vec<(f64, Pose)> = Vec::new();
    for orientation in Orientation::all() {
        for shift in shifts(&shown, orientation, columns, rows) {
            let pose = Pose { orientation, shift };
            if shares_enough(seen, &shown, pose, columns, rows) {
                let score = |marks: &&[Place]| correlation(&shown, pose, marks, columns, rows);
                scores.push((PATTERNS.iter().map(score).fold(0.0, f64::max), pose));
            }
        }
    }
    scores.sort_by(|a, b| b.0.total_cmp(&a.0));
    let &(best, pose) = scores.first()?;
    Some(DotMatch { pose, best, second: scores.get(1).map_or(0.0, |(score, _)| *score), places: shown.len() })
}

/// Column and row of a place in the displayed grid from its corner, if it is in the grid.
pub(super) fn inside((column, row): Place, columns: usize, rows: usize) -> Option<(usize, usize)> {
    let (column, row) = (column + (columns as i32 - 1) / 2, row + (rows as i32 - 1) / 2);
    let is_inside = (0..columns as i32).contains(&column) && (0..rows as i32).contains(&row);
    is_inside.then_some((column as usize, row as usize))
}

/// The shifts at which the middles of both grids are at most half a displayed grid apart.
fn shifts(
    shown: &BTreeMap<Place, Seen>,
    orientation: Orientation,
    columns: usize,
    rows: usize,
) -> impl Iterator<Item = Place> + use<> {
    let count = shown.len().max(1) as i32;
    let sum = shown.keys().map(|&place| orientation.apply(place)).fold((0, 0), |s, p| (s.0 + p.0, s.1 + p.1));
    let middle = (sum.0 / count, sum.1 / count);
    let (x, y) = (columns as i32 / 2, rows as i32 / 2);
    (-y..=y).flat_map(move |dy| (-x..=x).map(move |dx| (dx - middle.0, dy - middle.1)))
}

fn shares_enough(seen: &SeenGrid, shown: &BTreeMap<Place, Seen>, pose: Pose, columns: usize, rows: usize) -> bool {
    let shared = shown.keys().filter(|&&place| inside(pose.displayed(place), columns, rows).is_some()).count();
    if (shared as f64) < SHARED_MIN * shown.len() as f64 {
        return false;
    }
    let missing = missing(seen, shown, pose, columns, rows);
    shared as f64 >= SHARED_MIN * (shared + missing) as f64
}

/// Number of dots that the photograph should show and does not.
fn missing(seen: &SeenGrid, shown: &BTreeMap<Place, Seen>, pose: Pose, columns: usize, rows: usize) -> usize {
    let span = (columns.max(rows) + 1) as i32;
    let near = |of: fn(&Place) -> i32| {
        let middle = shown.keys().map(of).sum::<i32>() / shown.len().max(1) as i32;
        middle - span..=middle + span
    };
    let (columns_near, rows_near) = (near(|place| place.0), near(|place| place.1));
    rows_near
        .flat_map(|row| columns_near.clone().map(move |column| (column, row)))
        .filter(|&place| inside(pose.displayed(place), columns, rows).is_some())
        .filter(|place| !shown.contains_key(place) && seen.is_in_photo(*place))
        .count()
}

/// Correlation of the contrasts with large dots at these places. A large dot that stray light may hide counts as seen, so
/// that no pose leads only because others cannot be judged.
fn correlation(shown: &BTreeMap<Place, Seen>, pose: Pose, marks: &[Place], columns: usize, rows: usize) -> f64 {
    let (mut n, mut c, mut cc, mut m, mut cm) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (&place, &shown) in shown {
        let there = pose.displayed(place);
        let is_large = marks.contains(&there);
        let contrast = match shown {
            Seen::Dot(contrast) => contrast,
            Seen::Stray if is_large => CONTRAST_MAX,
            Seen::Stray => continue,
        };
        if inside(there, columns, rows).is_some() {
            let mark = f64::from(u8::from(is_large));
            n += 1.0;
            c += contrast;
            cc += contrast * contrast;
            m += mark;
            cm += contrast * mark;
        }
    }
    let variances = (n * cc - c * c) * (n * m - m * m);
    if variances > 0.0 { (n * cm - c * m) / variances.sqrt() } else { 0.0 }
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
