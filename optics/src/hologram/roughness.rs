//! Total variation and speckle: measures of the light's roughness that do not depend on its brightness.
//!
//! ```text
//! q = p / μ,  μ = Σ w p / Σ w
//! total variation:  V = Σ w ( √(|∇q|² + ε²) − ε ) / Σ w           ∇ by forward differences, 0 across the region's border
//! speckle:          S = Σ_b ω_b ( C_b(p) − C_b(t) )²,  C_b = √(σ_b²/m_b² + ε²)
//! ```
//!
//! p is the light, w the weights in the region of interest, m_b and σ_b² the mean and variance over a block b, t the
//! target, and ω_b the block's share of the target's light. V and S are the same for p and any multiple of p, so they
//! do not depend on the gain. Sources: for total variation, L. Rudin, S. Osher and E. Fatemi, Physica D 60, 259 (1992).
//! For the speckle contrast σ/m, J. Goodman, Speckle Phenomena in Optics (2007).

use crate::engine::Real;
use crate::interrupt;
use crate::numerics::{Plane, RegionOfInterest};
use rayon::prelude::*;

/// ε of both terms, relative to the mean light. Smaller differences count as noise.
pub(super) const EPSILON: f64 = 1e-2;

/// Region and weights in which the loss measures the light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WeightedRegion<'a, T> {
    pub(crate) region: RegionOfInterest,
    pub(crate) weight: Option<&'a Plane<T>>,
    /// Σ w over the region.
    pub(crate) weight_sum: f64,
}

impl<T: Real> WeightedRegion<'_, T> {
    #[inline(always)]
    fn weight_at(&self, y: usize, x: usize) -> T {
        self.weight.map_or(T::one(), |weight| weight.at(y, x))
    }
}

/// Position of one light plane among the light planes of a detector.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightPlane {
    pub(crate) index: usize,
    pub(crate) count: usize,
    pub(crate) width_px: usize,
}

impl LightPlane {
    #[inline(always)]
    fn row<'a, T>(&self, lights: &'a [T], y: usize) -> &'a [T] {
        &lights[(y * self.count + self.index) * self.width_px..][..self.width_px]
    }

    fn row_in<'a, T>(&self, row: &'a mut [T]) -> &'a mut [T] {
        &mut row[self.index * self.width_px..][..self.width_px]
    }
}

/// Returns V of one light plane and adds `scale` · ∂V/∂p to `slopes`.
pub(crate) fn total_variation<T: Real>(
    extent: &WeightedRegion<'_, T>,
    plane: LightPlane,
    lights: &[T],
    scale: f64,
    slopes: &mut [T],
) -> f64 {
    let region = extent.region;
    let sums = per_row(region, |y| mean_terms(extent, plane.row(lights, y), y));
    let mean = sums.iter().sum::<f64>() / extent.weight_sum;
    if mean <= 0.0 {
        return 0.0;
    }
    let field = Gradient { extent, plane, lights, inverse_mean: T::of(1.0 / mean) };
    // V and Σ q ∂V/∂q, row by row.
    let parts = per_row(region, |y| field.row_parts(y));
    let (value, along) = parts.iter().fold((0.0, 0.0), |sum, part| (sum.0 + part.0, sum.1 + part.1));
    // q = p/μ, so a pixel that raises μ lowers every q.
    let (scale, mean_slope) = (scale / (mean * extent.weight_sum), T::of(along / extent.weight_sum));
    let (scale, columns) = (T::of(scale), region.x_px()..region.x_px() + region.width_px());
    slopes.par_chunks_mut(plane.count * plane.width_px).enumerate().for_each(|(y, row)| {
        interrupt::check();
        if region.columns(y).is_some() {
            for (x, slope) in columns.clone().zip(&mut plane.row_in(row)[columns.clone()]) {
                *slope = *slope + scale * (field.slope(y, x) - mean_slope * extent.weight_at(y, x));
            }
        }
    });
    value / extent.weight_sum
}

/// Σ w p along a row.
fn mean_terms<T: Real>(extent: &WeightedRegion<'_, T>, light: &[T], y: usize) -> f64 {
    let columns = extent.region.x_px()..extent.region.x_px() + extent.region.width_px();
    columns.map(|x| (extent.weight_at(y, x) * light[x]).wide()).sum()
}

fn per_row<R: Send>(region: RegionOfInterest, of: impl Fn(usize) -> R + Sync + Send) -> Vec<R> {
    (region.y_px()..region.y_px() + region.height_px())
        .into_par_iter()
        .map(|y| {
            interrupt::check();
            of(y)
        })
        .collect()
}

/// Forward differences of q = p/μ in one light plane.
struct Gradient<'a, T> {
    extent: &'a WeightedRegion<'a, T>,
    plane: LightPlane,
    lights: &'a [T],
    inverse_mean: T,
}

impl<T: Real> Gradient<'_, T> {
    /// Forward differences of q along x and y, and √(|∇q|² + ε²).
    #[inline(always)]
    fn at(&self, y: usize, x: usize) -> (T, T, T) {
        let region = self.extent.region;
        let row = self.plane.row(self.lights, y);
        let right = x + 1 < region.x_px() + region.width_px();
        let below = y + 1 < region.y_px() + region.height_px();
        let dx = if right { (row[x + 1] - row[x]) * self.inverse_mean } else { T::zero() };
        let dy = if below { (self.plane.row(self.lights, y + 1)[x] - row[x]) * self.inverse_mean } else { T::zero() };
        (dx, dy, (dx * dx + dy * dy + T::of(EPSILON * EPSILON)).sqrt())
    }

    /// Σ w (√… − ε) and Σ q ∂(Σ w √…)/∂q = Σ w |∇q|²/√… along a row.
    fn row_parts(&self, y: usize) -> (f64, f64) {
        let region = self.extent.region;
        let mut sums = (0.0, 0.0);
        for x in region.x_px()..region.x_px() + region.width_px() {
            let (dx, dy, root) = self.at(y, x);
            let w = self.extent.weight_at(y, x);
            sums.0 += (w * (root - T::of(EPSILON))).wide();
            sums.1 += (w * (dx * dx + dy * dy) / root).wide();
        }
        sums
    }

    /// ∂(Σ w √…)/∂q at a pixel: the sum of its own term and the terms of its left and upper neighbours.
    #[inline(always)]
    fn slope(&self, y: usize, x: usize) -> T {
        let (dx, dy, root) = self.at(y, x);
        let mut slope = -self.extent.weight_at(y, x) * (dx + dy) / root;
        if x > self.extent.region.x_px() {
            let (dx, _, root) = self.at(y, x - 1);
            slope = slope + self.extent.weight_at(y, x - 1) * dx / root;
        }
        if y > self.extent.region.y_px() {
            let (_, dy, root) = self.at(y - 1, x);
            slope = slope + self.extent.weight_at(y - 1, x) * dy / root;
        }
        slope
    }
}

/// Blocks in which speckle is measured, with the target's contrast in each block.
#[derive(Clone, Debug)]
pub(crate) struct SpeckleBlocks {
    side_px: usize,
    columns: usize,
    /// C_b(t) and ω_b of each block, row by row.
    wanted: Vec<[f64; 2]>,
}

impl SpeckleBlocks {
    /// Divides the region into blocks of `side_px` from its upper left corner. Incomplete blocks at its right and lower
    /// border are omitted. `target` is intensity.
    pub(crate) fn new<T: Real>(extent: &WeightedRegion<'_, T>, target: &Plane<T>, side_px: usize) -> Self {
        let (rows, columns) = (extent.region.height_px() / side_px, extent.region.width_px() / side_px);
        let mut blocks = Self { side_px, columns, wanted: vec![[0.0; 2]; rows * columns] };
        let plane = LightPlane { index: 0, count: 1, width_px: target.width_px() };
        let of_block = |i: usize| {
            let block = blocks.block(extent, plane, target.values(), i);
            [block.contrast(), block.weight * block.mean]
        };
        let mut wanted: Vec<[f64; 2]> = (0..rows * columns).map(of_block).collect();
        let light: f64 = wanted.iter().map(|[_, light]| light).sum();
        wanted.iter_mut().for_each(|[_, share]| *share = if light > 0.0 { *share / light } else { 0.0 });
        blocks.wanted = wanted;
        blocks
    }

    /// Returns S of one light plane and adds `scale` · ∂S/∂p to `slopes`.
    pub(crate) fn evaluate<T: Real>(
        &self,
        extent: &WeightedRegion<'_, T>,
        plane: LightPlane,
        lights: &[T],
        scale: f64,
        slopes: &mut [T],
    ) -> f64 {
        let row_len = plane.count * plane.width_px;
        let (first, rows) = (extent.region.y_px() * row_len, self.wanted.len() / self.columns.max(1));
        let bands = slopes[first..].par_chunks_mut(self.side_px * row_len).enumerate().take(rows);
        let values = bands.map(|(band, slopes)| {
            let mut value = 0.0;
            for i in band * self.columns..(band + 1) * self.columns {
                let [wanted, share] = self.wanted[i];
                let block = self.block(extent, plane, lights, i);
                if block.mean <= 0.0 || share == 0.0 {
                    continue;
                }
                let excess = block.contrast() - wanted;
                value += share * excess * excess;
                let slope = BlockSlope::new(block, 2.0 * scale * share * excess);
                slope.add(extent, plane, lights, (self.corner(extent, i), self.side_px), slopes);
            }
            value
        });
        values.collect::<Vec<_>>().iter().sum()
    }

    fn corner<T>(&self, extent: &WeightedRegion<'_, T>, i: usize) -> (usize, usize) {
        let (row, column) = (i / self.columns, i % self.columns);
        (extent.region.y_px() + row * self.side_px, extent.region.x_px() + column * self.side_px)
    }

    fn block<T: Real>(&self, extent: &WeightedRegion<'_, T>, plane: LightPlane, lights: &[T], i: usize) -> Block {
        interrupt::check();
        let (y0, x0) = self.corner(extent, i);
        let pixels = || (y0..y0 + self.side_px).flat_map(|y| (x0..x0 + self.side_px).map(move |x| (y, x)));
        let at = |(y, x): (usize, usize)| (extent.weight_at(y, x).wide(), plane.row(lights, y)[x].wide());
        let (weight, sum) = pixels().map(at).fold((0.0, 0.0), |sum, (w, p)| (sum.0 + w, sum.1 + w * p));
        if weight == 0.0 {
            return Block { weight, mean: 0.0, variance: 0.0 };
        }
        let mean = sum / weight;
        let variance = pixels().map(at).map(|(w, p)| w * (p - mean) * (p - mean)).sum::<f64>() / weight;
        Block { weight, mean, variance }
    }
}

/// Derivative of a block's contrast by the light of a pixel: `scale` · w · (p − mean − drop).
#[derive(Clone, Copy)]
struct BlockSlope {
    scale: f64,
    mean: f64,
    drop: f64,
}

impl BlockSlope {
    /// Derivative `scale` · ∂C/∂p for one block.
    fn new(block: Block, scale: f64) -> Self {
        let scale = scale / (block.contrast() * block.weight * block.mean * block.mean);
        Self { scale, mean: block.mean, drop: block.variance / block.mean }
    }

    /// Adds the derivative to `slopes`, which hold the band of rows in which the block lies. The block is given by its
    /// upper left corner and its side.
    fn add<T: Real>(
        self,
        extent: &WeightedRegion<'_, T>,
        plane: LightPlane,
        lights: &[T],
        ((y0, x0), side_px): ((usize, usize), usize),
        slopes: &mut [T],
    ) {
        for (k, row) in slopes.chunks_exact_mut(plane.count * plane.width_px).enumerate() {
            let light = plane.row(lights, y0 + k);
            let row = &mut plane.row_in(row)[x0..x0 + side_px];
            for (x, slope) in (x0..).zip(row) {
                let w = extent.weight_at(y0 + k, x).wide();
                *slope = *slope + T::of(self.scale * w * (light[x].wide() - self.mean - self.drop));
            }
        }
    }
}

/// Weight, mean and variance of the light in a block.
#[derive(Clone, Copy)]
struct Block {
    weight: f64,
    mean: f64,
    variance: f64,
}

impl Block {
    fn contrast(self) -> f64 {
        let relative = if self.mean > 0.0 { self.variance / (self.mean * self.mean) } else { 0.0 };
        (relative + EPSILON * EPSILON).sqrt()
    }
}
