//! Assigns whole-number coordinates to spots that form a grid, seen in perspective.
//!
//! The coordinates spread from neighbour to neighbour, starting at a spot with two nearest neighbours at about a right
//! angle. Each neighbour is expected one step further, so the step can change gradually over the photograph.

use super::homography::{Point, distance};
use std::collections::HashMap;

/// Largest distance of a neighbour from its expected position, as a part of a step.
const TOLERANCE: f64 = 0.28;
/// Number of spots from which the growth of a grid is tried.
const SEEDS_MAX: usize = 24;

/// Column and row of each spot of the largest grid found, by the spot's index.
pub(super) fn grow(points: &[Point]) -> HashMap<usize, (i32, i32)> {
    let centre = mean(points);
    let mut seeds: Vec<usize> = (0..points.len()).collect();
    seeds.sort_by(|&a, &b| distance(points[a], centre).total_cmp(&distance(points[b], centre)));
    let grids =
        seeds.into_iter().take(SEEDS_MAX).filter_map(|seed| Some(grow_from(points, seed, steps_at(points, seed)?)));
    // Of grids of the same size, the first is kept.
    grids.fold(HashMap::new(), |best, grid| if grid.len() > best.len() { grid } else { best })
}

/// The steps of the grid at a spot: to its nearest neighbour, and to the nearest one at about a right angle to that.
fn steps_at(points: &[Point], seed: usize) -> Option<[Point; 2]> {
    let from = points[seed];
    let mut others: Vec<Point> =
        points.iter().enumerate().filter(|(i, _)| *i != seed).map(|(_, p)| [p[0] - from[0], p[1] - from[1]]).collect();
    others.sort_by(|a, b| a[0].hypot(a[1]).total_cmp(&b[0].hypot(b[1])));
    let first = *others.first()?;
    let length = first[0].hypot(first[1]);
    let second = others.iter().copied().take(8).find(|step| {
        let other = step[0].hypot(step[1]);
        let cosine = (first[0] * step[0] + first[1] * step[1]) / (length * other);
        cosine.abs() < 0.4 && other < 1.8 * length
    })?;
    Some([first, second])
}

fn grow_from(points: &[Point], seed: usize, steps: [Point; 2]) -> HashMap<usize, (i32, i32)> {
    let mut positions = HashMap::from([(seed, (0, 0))]);
    let mut taken = HashMap::from([((0, 0), seed)]);
    let mut queue = std::collections::VecDeque::from([(seed, steps)]);
    while let Some((from, steps)) = queue.pop_front() {
        let (column, row) = positions[&from];
        for (axis, sign) in [(0, 1), (0, -1), (1, 1), (1, -1)] {
            let position = if axis == 0 { (column + sign, row) } else { (column, row + sign) };
            if taken.contains_key(&position) {
                continue;
            }
            let step = steps[axis].map(|value| f64::from(sign) * value);
            let expected = [points[from][0] + step[0], points[from][1] + step[1]];
            let Some(found) = nearest(points, expected) else { continue };
            if positions.contains_key(&found) || distance(points[found], expected) > TOLERANCE * step[0].hypot(step[1])
            {
                continue;
            }
            let mut next = steps;
            let measured = [points[found][0] - points[from][0], points[found][1] - points[from][1]];
            // Mean of the old and the new step, so that one noisy spot does not turn the whole row.
            next[axis] = std::array::from_fn(|k| 0.5 * (steps[axis][k] + f64::from(sign) * measured[k]));
            positions.insert(found, position);
            taken.insert(position, found);
            queue.push_back((found, next));
        }
    }
    positions
}

fn nearest(points: &[Point], to: Point) -> Option<usize> {
    (0..points.len()).min_by(|&a, &b| distance(points[a], to).total_cmp(&distance(points[b], to)))
}

fn mean(points: &[Point]) -> Point {
    let count = points.len().max(1) as f64;
    points.iter().fold([0.0; 2], |sum, p| [sum[0] + p[0] / count, sum[1] + p[1] / count])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::alignment::homography::Homography;

    #[test]
    fn perspective_grid_with_gaps_and_stray_spot_is_numbered() {
        let tilt = Homography::try_new([1.4, 0.3, 50.0, -0.2, 1.3, 120.0, 4e-4, -2e-4, 1.0]).unwrap();
        let mut points: Vec<Point> = Vec::new();
        let mut truth = Vec::new();
        for (row, column) in (0..9_i32).flat_map(|row| (0..14_i32).map(move |column| (row, column))) {
            if (row * 14 + column) % 23 == 5 {
                continue;
            }
            points.push(tilt.apply([40.0 * f64::from(column), 40.0 * f64::from(row)]));
            truth.push((column, row));
        }
        points.push([points[30][0] + 19.0, points[30][1] + 17.0]);
        let positions = grow(&points);
        assert_eq!(positions.len(), truth.len(), "all spots but the stray one");
        // Coordinates are unique up to a shift and a turn of the axes, so distances between neighbours are compared.
        let (&a, &(ca, ra)) = positions.iter().next().unwrap();
        for (&b, &(cb, rb)) in &positions {
            let steps = (cb - ca).abs() + (rb - ra).abs();
            assert_eq!(steps, (truth[b].0 - truth[a].0).abs() + (truth[b].1 - truth[a].1).abs());
        }
    }
}
