//! Displacements of blocks of an aligned photograph from the target.
//!
//! ```text
//! t(p) ≈ α + β [ w(p + d) + ∇w · δ ],   Σ = s² (Aᵀ A)⁻¹
//! ```
//!
//! t and w are the details of target and photograph. For each block, d is the whole displacement with the highest
//! normalized correlation. A linear fit refines it by δ between pixels. Its covariance Σ shows whether the block has a
//! clear place: the details of a block may be lines in one direction only, along which it has none. Blocks with two
//! places that correlate nearly as well have none, either.

use super::pyramid::{Details, Pyramid, last_step};
use crate::alignment::homography::Point;
use lightpath_optics::interrupt;
use lightpath_optics::numerics::least_squares::NormalEquations;
use lightpath_optics::{Plane, RegionOfInterest};
use rayon::prelude::*;

/// Displacement of the photograph's light in a block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlockDisplacement {
    /// Centre of the block \[target px\].
    pub centre: Point,
    /// Displacement in x and y \[target px\].
    pub shift: Point,
    /// Normalized correlation of the details at this displacement.
    pub correlation: f64,
}

/// Side of a block, in values of the details.
const SIDE: usize = 56;
/// Largest displacement that is found, in values of the details.
const REACH: i64 = 6;
/// Distance from the best place beyond which another place is a rival, in values of the details.
const RIVAL: i64 = 2;
/// Largest correlation of a rival, as a part of the best.
const RIVAL_MAX: f64 = 0.8;
/// Least correlation of a clear place.
const CORRELATION_MIN: f64 = 0.3;
/// Largest standard deviation of a clear place, for independent errors of all values \[values of the details\]. Speckle
/// covers several values, so the true one is a few times as large.
const DEVIATION_MAX: f64 = 0.1;
const STEPS: usize = 4;

/// The displacements of the blocks of a region that have a clear place. Both planes have the target's size.
#[must_use]
pub fn block_displacements(
    target: &Plane<f32>,
    aligned: &Plane<f32>,
    region: RegionOfInterest,
) -> Vec<BlockDisplacement> {
    let step = last_step(target.height_px().max(target.width_px()));
    let [target, aligned] = [target, aligned].map(|plane| {
        let pyramid = Pyramid::of(plane);
        pyramid.details(pyramid.step_near((1_usize << step) as f64))
    });
    let px = target.px();
    let along = |start: usize, length: usize, side: usize| {
        let first = ((start as f64 / px).ceil() as usize).max(REACH as usize);
        let end = (((start + length) as f64 / px) as usize).min(side.saturating_sub(REACH as usize));
        // Blocks overlap by a half.
        (first..).step_by(SIDE / 2).take_while(move |at| at + SIDE <= end)
    };
    let rows = along(region.y_px(), region.height_px(), target.values.height_px());
    let columns: Vec<usize> = along(region.x_px(), region.width_px(), target.values.width_px()).collect();
    let corners: Vec<(usize, usize)> = rows.flat_map(|y| columns.iter().map(move |&x| (y, x))).collect();
    let block = |corner: (usize, usize)| {
        interrupt::check();
        Block { target: &target, aligned: &aligned, corner }.displacement()
    };
    corners.into_par_iter().filter_map(block).collect()
}

/// A block of the details.
struct Block<'a> {
    target: &'a Details,
    aligned: &'a Details,
    /// First row and column.
    corner: (usize, usize),
}

impl Block<'_> {
    fn displacement(&self) -> Option<BlockDisplacement> {
        let ([dy, dx], correlation) = self.best_place()?;
        let px = self.target.px();
        let mut shift = [px * dx as f64, px * dy as f64];
        let mut deviation = f64::INFINITY;
        for _ in 0..STEPS {
            let (change, spread) = self.fit(shift)?;
            shift = [shift[0] + change[0], shift[1] + change[1]];
            deviation = spread / px;
        }
        let far = |axis: usize, whole: i64| (shift[axis] / px - whole as f64).abs() > 1.0;
        if deviation.is_nan() || deviation > DEVIATION_MAX || far(0, dx) || far(1, dy) {
            return None;
        }
        let half = (SIDE - 1) as f64 / 2.0;
        let [x, y] = self.target.point(self.corner.0, self.corner.1);
        Some(BlockDisplacement { centre: [x + px * half, y + px * half], shift, correlation })
    }

    /// The whole displacement, y and x, with the highest correlation. `None` if it is not clear.
    fn best_place(&self) -> Option<([i64; 2], f64)> {
        let places = (-REACH..=REACH).flat_map(|dy| (-REACH..=REACH).map(move |dx| [dy, dx]));
        let all: Vec<([i64; 2], f64)> = places.map(|place| (place, self.correlation(place))).collect();
        let &(best, correlation) = all.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        let is_rival = |place: [i64; 2]| (0..2).any(|axis| (place[axis] - best[axis]).abs() > RIVAL);
        let rival = all.iter().filter(|(place, _)| is_rival(*place)).fold(0.0, |most: f64, (_, c)| most.max(*c));
        let clear = correlation >= CORRELATION_MIN && rival <= RIVAL_MAX * correlation;
        (clear && best.iter().all(|d| d.abs() < REACH)).then_some((best, correlation))
    }

    fn correlation(&self, [dy, dx]: [i64; 2]) -> f64 {
        let (mut sums, mut squares, mut product) = ([0.0_f64; 2], [0.0_f64; 2], 0.0_f64);
        let (top, left) = self.corner;
        for y in top..top + SIDE {
            let target = &self.target.values.row(y)[left..left + SIDE];
            let shifted = &self.aligned.values.row((y as i64 + dy) as usize)[(left as i64 + dx) as usize..][..SIDE];
            for (&t, &w) in target.iter().zip(shifted) {
                let (t, w) = (f64::from(t), f64::from(w));
                sums = [sums[0] + t, sums[1] + w];
                squares = [squares[0] + t * t, squares[1] + w * w];
                product += t * w;
            }
        }
        let count = (SIDE * SIDE) as f64;
        let variance = |i: usize| squares[i] - sums[i] * sums[i] / count;
        let both = variance(0).max(0.0) * variance(1).max(0.0);
        if both > 0.0 { (product - sums[0] * sums[1] / count) / both.sqrt() } else { 0.0 }
    }

    /// The change of a displacement that fits best \[px\], and the standard deviation of its less certain direction
    /// \[px\].
    fn fit(&self, shift: Point) -> Option<(Point, f64)> {
        let mut equations = NormalEquations::<4>::none();
        let mut rows = Vec::with_capacity(SIDE * SIDE);
        let (top, left) = self.corner;
        for (y, x) in (top..top + SIDE).flat_map(|y| (left..left + SIDE).map(move |x| (y, x))) {
            let [px, py] = self.target.point(y, x);
            let sample = self.aligned.sample([px + shift[0], py + shift[1]])?;
            let [gx, gy] = sample.slope.map(f64::from);
            let row = ([gx, gy, f64::from(sample.value), 1.0], f64::from(self.target.values.at(y, x)));
            equations.add(&row.0, row.1, 1.0);
            rows.push(row);
        }
        let solution = equations.solve()?;
        let error = |(row, t): &([f64; 4], f64)| t - row.iter().zip(solution).map(|(a, b)| a * b).sum::<f64>();
        let variance = rows.iter().map(|row| error(row).powi(2)).sum::<f64>() / rows.len() as f64;
        let sum = |i: usize, j: usize| rows.iter().map(|(row, _)| row[i] * row[j]).sum::<f64>();
        let (xx, xy, yy) = (sum(0, 0), sum(0, 1), sum(1, 1));
        let least = (xx + yy) / 2.0 - ((xx - yy) / 2.0).hypot(xy);
        let gain = solution[2];
        (gain > 0.0 && least > 0.0)
            .then(|| ([solution[0] / gain, solution[1] / gain], (variance / least).sqrt() / gain))
    }
}
