//! Comparison of light with a photograph at one size of details.
//!
//! ```text
//! L = min over s of  ‖A (s p − t)‖² / ‖A t‖²,     A = (G_n − G_b) C M,     ∂L/∂p = 2s Aᵀ A (s p − t) / ‖A t‖²
//! ```
//!
//! p is the light, t the photograph, s the gain. M takes the mean over the pixels that count away, and sets all others
//! to 0. C takes means over square cells. G_n and G_b are a narrow and a broad Gaussian, which their difference makes a
//! band pass. s has its best value, so that its derivative is 0 and the gradient is exact.

use super::pair::Example;
use crate::engine::Real;
use crate::interrupt;
use crate::numerics::RegionOfInterest;
use rayon::prelude::*;

/// Standard deviation of the narrow Gaussian \[cells\].
const NARROW: f64 = 2.0;
/// Standard deviation of the broad Gaussian \[cells\].
const BROAD: f64 = 8.0;
/// Radius of a Gaussian, in standard deviations.
const REACH: f64 = 3.0;

/// The operator A for photographs of a region.
#[derive(Clone, Debug)]
pub(super) struct BandPass {
    region: RegionOfInterest,
    cell_px: usize,
    rows: usize,
    columns: usize,
    narrow: Vec<f64>,
    broad: Vec<f64>,
}

/// A photograph A t.
#[derive(Clone, Debug)]
pub(super) struct FilteredPhoto {
    details: Vec<f64>,
    power: f64,
}

impl BandPass {
    /// Lets details pass that measure about 2 to 8 cells of `cell_px` pixels.
    pub(super) fn new(region: RegionOfInterest, cell_px: usize) -> Self {
        Self {
            region,
            cell_px,
            rows: region.height_px().div_ceil(cell_px),
            columns: region.width_px().div_ceil(cell_px),
            narrow: gaussian(NARROW),
            broad: gaussian(BROAD),
        }
    }

    /// The photograph of an example.
    pub(super) fn photo<T: Real>(&self, example: &Example<T>) -> FilteredPhoto {
        let details = self.filtered(example, example.photo.values());
        FilteredPhoto { power: dot(&details, &details), details }
    }

    /// L of the light of an example. Writes its derivative by the light at each pixel to `slopes`.
    pub(super) fn compare<T: Real>(
        &self,
        example: &Example<T>,
        photo: &FilteredPhoto,
        light: &[T],
        slopes: &mut [T],
    ) -> f64 {
        slopes.fill(T::zero());
        let details = self.filtered(example, light);
        let (power, product) = (dot(&details, &details), dot(&details, &photo.details));
        // Light that does not correlate with the photograph says nothing.
        if !(product > 0.0 && power > 0.0 && photo.power > 0.0) {
            return 1.0;
        }
        let gain = product / power;
        let factor = 2.0 * gain / photo.power;
        let rest: Vec<f64> = details.iter().zip(&photo.details).map(|(p, t)| factor * (gain * p - t)).collect();
        self.spread(example, &self.passed(&rest), slopes);
        1.0 - product * gain / photo.power
    }

    /// A v
    fn filtered<T: Real>(&self, example: &Example<T>, values: &[T]) -> Vec<f64> {
        let mean = self.mean(example, |y, x| values[y * example.photo.width_px() + x].wide());
        let mut cells = vec![0.0; self.rows * self.columns];
        let area = (self.cell_px * self.cell_px) as f64;
        cells.par_chunks_mut(self.columns).enumerate().for_each(|(row, cells)| {
            interrupt::check();
            for y in self.rows_of(row) {
                let columns = self.columns();
                let values = &values[y * example.photo.width_px()..][columns.clone()];
                let weights = &example.weight.row(y)[columns];
                let pixels = values.chunks(self.cell_px).zip(weights.chunks(self.cell_px));
                for (cell, (values, weights)) in cells.iter_mut().zip(pixels) {
                    *cell += values.iter().zip(weights).map(|(v, w)| w.wide() * (v.wide() - mean)).sum::<f64>() / area;
                }
            }
        });
        self.passed(&cells)
    }

    /// Mᵀ Cᵀ of the cells.
    fn spread<T: Real>(&self, example: &Example<T>, cells: &[f64], slopes: &mut [T]) {
        let area = (self.cell_px * self.cell_px) as f64;
        let (left, top) = (self.region.x_px(), self.region.y_px());
        let at = |y: usize, x: usize| cells[(y - top) / self.cell_px * self.columns + (x - left) / self.cell_px] / area;
        let mean = self.mean(example, at);
        slopes.par_chunks_mut(example.photo.width_px()).enumerate().for_each(|(y, slopes)| {
            let Some(columns) = self.region.columns(y) else { return };
            let weights = &example.weight.row(y)[columns.clone()];
            for ((x, slope), w) in columns.clone().zip(&mut slopes[columns]).zip(weights) {
                *slope = T::of(w.wide() * (at(y, x) - mean));
            }
        });
    }

    /// Mean over the pixels that count.
    fn mean<T: Real>(&self, example: &Example<T>, value: impl Fn(usize, usize) -> f64 + Sync) -> f64 {
        let of_row = |y: usize| {
            let columns = self.columns();
            let weights = columns.clone().zip(&example.weight.row(y)[columns]);
            weights.fold((0.0, 0.0), |(sum, weight), (x, w)| (sum + w.wide() * value(y, x), weight + w.wide()))
        };
        let top = self.region.y_px();
        // The rows are added in their order, so that the sum does not depend on the number of threads.
        let rows: Vec<(f64, f64)> = (top..top + self.region.height_px()).into_par_iter().map(of_row).collect();
        let (sum, weight) = rows.iter().fold((0.0, 0.0), |(a, b), (sum, weight)| (a + sum, b + weight));
        sum / weight
    }

    fn columns(&self) -> std::ops::Range<usize> {
        self.region.x_px()..self.region.x_px() + self.region.width_px()
    }

    /// Rows of pixels in a row of cells.
    fn rows_of(&self, row: usize) -> std::ops::Range<usize> {
        let (top, first) = (self.region.y_px(), row * self.cell_px);
        top + first..top + (first + self.cell_px).min(self.region.height_px())
    }

    /// (G_n − G_b) of the cells, which are 0 outside the region. The matrix is symmetric.
    fn passed(&self, cells: &[f64]) -> Vec<f64> {
        let narrow = self.blurred(cells, &self.narrow);
        let broad = self.blurred(cells, &self.broad);
        narrow.iter().zip(&broad).map(|(narrow, broad)| narrow - broad).collect()
    }

    fn blurred(&self, cells: &[f64], gaussian: &[f64]) -> Vec<f64> {
        let (mut along_x, mut both) = (vec![0.0; cells.len()], vec![0.0; cells.len()]);
        along_x.par_chunks_mut(self.columns).zip(cells.par_chunks(self.columns)).for_each(|(out, row)| {
            interrupt::check();
            add_scaled(out, row, gaussian[0]);
            for (distance, &weight) in gaussian.iter().enumerate().skip(1).take_while(|(k, _)| *k < self.columns) {
                let end = self.columns - distance;
                add_scaled(&mut out[..end], &row[distance..], weight);
                add_scaled(&mut out[distance..], &row[..end], weight);
            }
        });
        both.par_chunks_mut(self.columns).enumerate().for_each(|(y, out)| {
            interrupt::check();
            let reach = gaussian.len() - 1;
            for from in y.saturating_sub(reach)..(y + reach + 1).min(self.rows) {
                add_scaled(out, &along_x[from * self.columns..][..self.columns], gaussian[y.abs_diff(from)]);
            }
        });
        both
    }
}

/// Weights at the distances 0, 1, … to either side; all weights add up to 1.
fn gaussian(sigma: f64) -> Vec<f64> {
    let reach = (REACH * sigma).ceil() as usize;
    let weights: Vec<f64> = (0..=reach).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect();
    let sum = 2.0 * weights.iter().sum::<f64>() - weights[0];
    weights.iter().map(|weight| weight / sum).collect()
}

fn add_scaled(out: &mut [f64], values: &[f64], weight: f64) {
    out.iter_mut().zip(values).for_each(|(out, value)| *out += weight * value);
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::Detector;
    use crate::display::parts::Block;
    use crate::display::parts::blocks::Blocks;
    use crate::display::{DisplayModel, OpticalSetup};
    use crate::engine::Engine;
    use crate::hologram::initial_phase;
    use crate::learning::fit::Fit;
    use crate::learning::layout::Layout;
    use crate::learning::options::KernelModel;
    use crate::learning::pair::Pair;
    use crate::numerics::{Grid, Plane};

    /// A pair with some saturated pixels and with uneven light, in a region whose sides are not whole cells.
    fn example(fit: &Fit<f64>, grid: &Grid) -> Example<f64> {
        let phase = initial_phase(30, 41, 6.0, 3).unwrap();
        let light = Engine::new(&DisplayModel::ideal(fit.setups[0]), Detector::Point, None).unwrap().light(&phase);
        let light = light.unwrap();
        let photo = Plane::from_fn(30, 41, |y, x| 0.3 * light.at(y, x) + 0.1 * (x as f32 * 0.3).sin());
        let pair = Pair { phase, photo };
        Example::new(&pair, &fit.engine, RegionOfInterest::try_new(grid, 3, 2, 35, 26).unwrap()).unwrap()
    }

    #[test]
    fn gradient_matches_central_differences() {
        let grid = Grid::try_new(30, 41, 8e-6).unwrap();
        let setup = OpticalSetup::try_new(grid, 515e-9, 2e-3).unwrap();
        let layout = Layout::of(KernelModel::Display, 2, Blocks::NONE.with(Block::FineSource));
        let mut fit = Fit::<f64>::new(vec![setup], layout, Detector::Point, None).unwrap();
        let example = example(&fit, &grid);
        let theta: Vec<f64> = (0..layout.len()).map(|i| 0.02 * (i as f64 * 1.3 + 0.5).sin()).collect();
        for cell_px in [1, 3] {
            let band = BandPass::new(example.region, cell_px);
            let photo = band.photo(&example);
            let mut evaluate = |theta: &[f64]| {
                fit.set(0, theta);
                fit.evaluate_light(&example, |light, slopes| band.compare(&example, &photo, light, slopes))
            };
            let (loss, gradient) = evaluate(&theta);
            assert!(loss > 0.01 && loss < 0.99, "{loss}");
            let scale = gradient.iter().fold(0.0_f64, |largest, g| largest.max(g.abs()));
            assert!(scale > 1e-3);
            for i in 0..theta.len() {
                let mut at = |step: f64| {
                    let mut moved = theta.clone();
                    moved[i] += step;
                    evaluate(&moved).0
                };
                // The error of the difference is some 1e-5² of the gradient, and rounding 1e-16 / 1e-5.
                let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
                assert!((gradient[i] - difference).abs() < 1e-6 * scale, "{i}: {} against {difference}", gradient[i]);
            }
        }
    }

    #[test]
    fn loss_ignores_gain_offset_and_fine_details() {
        let grid = Grid::try_new(30, 41, 8e-6).unwrap();
        let setup = OpticalSetup::try_new(grid, 515e-9, 2e-3).unwrap();
        let layout = Layout::of(KernelModel::Display, 2, Blocks::NONE);
        let fit = Fit::<f64>::new(vec![setup], layout, Detector::Point, None).unwrap();
        let example = example(&fit, &grid);
        let loss = |cell_px: usize, change: &dyn Fn(usize, f64) -> f64| {
            let band = BandPass::new(example.region, cell_px);
            let light: Vec<f64> = example.photo.values().iter().enumerate().map(|(i, &t)| change(i, t)).collect();
            band.compare(&example, &band.photo(&example), &light, &mut vec![0.0; light.len()])
        };
        assert!(loss(1, &|_, t| 3.0 * t - 0.7).abs() < 1e-12);
        let chequered = |i: usize, t: f64| t + if (i / 41 + i % 41).is_multiple_of(2) { 0.2 } else { -0.2 };
        assert!(loss(1, &chequered) < 0.02, "{}", loss(1, &chequered));
        assert!(loss(1, &|i, _| ((i * 7919) % 101) as f64) > 0.5);
    }
}
