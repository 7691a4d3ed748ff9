//! Approximation of a kernel that varies over the SLM by a grid of local kernels.
//!
//! ```text
//! H(f; x, y) ≈ Σ_ij ℓ_i(x) ℓ_j(y) H(f; x_i, y_j),   ℓ_i(x) = Π_{k ≠ i} (x − x_k) / (x_i − x_k)
//! ```
//!
//! x_i are the n Chebyshev nodes −cos(π(2i + 1)/2n) of each axis. The windows ℓ add up to one everywhere, so a kernel
//! that does not vary is reproduced exactly. For a kernel that varies, the error falls quickly with n (L. N. Trefethen,
//! *Approximation Theory and Approximation Practice*, 2013), so a larger variation needs a larger grid. A convolution
//! takes n² kernels and their memory.

use super::SpatialVariation;
use crate::numerics::chebyshev::position;
use crate::numerics::real::Number;
use std::f64::consts::PI;

/// Sides of grids, each with the largest [change](change) of a kernel for which at most about 0.5 % of the field is
/// lost.
const SIDES: [(usize, f64); 3] = [(3, 0.45), (4, 0.75), (PER_SIDE_MAX, f64::INFINITY)];

/// Side of the largest grid.
pub(crate) const PER_SIDE_MAX: usize = 5;

/// Number of frequencies along each axis of the band at which a change is sampled.
const BAND_SAMPLES: usize = 9;

/// Side of the grid that approximates a variation.
#[must_use]
pub fn per_side(variation: &SpatialVariation) -> usize {
    let change = change(variation);
    SIDES.into_iter().find(|&(_, bound)| change <= bound).map_or(SIDES[0].0, |(side, _)| side)
}

/// Change of the kernel from the middle to the corner where it changes most: root mean square of |α + iψ| over the
/// band.
#[must_use]
pub fn change(variation: &SpatialVariation) -> f64 {
    let at = |i: usize| (2 * i + 1) as f64 / BAND_SAMPLES as f64 - 1.0;
    let at_corner = |(x, y)| {
        let squares = (0..BAND_SAMPLES * BAND_SAMPLES)
            .map(|k| variation.exponent(x, y, at(k % BAND_SAMPLES), at(k / BAND_SAMPLES)).norm_sqr());
        (squares.sum::<f64>() / (BAND_SAMPLES * BAND_SAMPLES) as f64).sqrt()
    };
    [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)].map(at_corner).into_iter().fold(0.0, f64::max)
}

/// Position of node `i` of the `n` nodes of an axis, between −1 and 1.
fn node(i: usize, n: usize) -> f64 {
    -(PI * (2 * i + 1) as f64 / (2 * n) as f64).cos()
}

/// Positions (x, y) of the n×n nodes, row after row.
pub fn nodes(n: usize) -> impl Iterator<Item = (f64, f64)> {
    (0..n * n).map(move |k| (node(k % n, n), node(k / n, n)))
}

/// Value of the window of node `i` of `n` at a position on its axis.
#[must_use]
pub fn window(i: usize, n: usize, at: f64) -> f64 {
    let others = (0..n).filter(|&k| k != i);
    others.map(|k| (at - node(k, n)) / (node(i, n) - node(k, n))).product()
}

/// Values of the `n` windows at each pixel of an axis with `side_px` pixels.
pub(crate) fn windows<T: Number>(n: usize, side_px: usize) -> Vec<Vec<T>> {
    let along = |i| (0..side_px).map(|px| T::of(window(i, n, position(px, side_px)))).collect();
    (0..n).map(along).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::Detector;
    use crate::display::parts::spatial_variation::SpatialVariation;
    use crate::display::setup::OpticalSetup;
    use crate::display::{DisplayModel, KernelShape};
    use crate::engine::EngineCore;
    use crate::hologram::initial_phase;
    use crate::numerics::{Grid, Plane, SmoothField};
    use crate::reference;
    use num_complex::Complex64;

    const SIZE: (usize, usize) = (14, 19);

    /// A display whose kernel has the given change.
    fn varying(change: f64) -> DisplayModel {
        let grid = Grid::try_new(SIZE.0, SIZE.1, 8e-6).unwrap();
        let mut model = DisplayModel::ideal(OpticalSetup::try_new(grid, 515e-9, 2e-3).unwrap());
        let wave = |terms: usize, shift: f64| (0..terms).map(|i| 0.1 * (i as f64 * 1.3 + shift).sin()).collect();
        let mut kernel = SmoothField::flat(3);
        (kernel.log_amplitude, kernel.phase) = (wave(9, 0.5), wave(9, 1.5));
        model.kernel = KernelShape::Smooth(kernel);
        let mut fields = [2.0, 3.0, 4.0, 5.0, 6.0].map(|shift| {
            let mut field = SmoothField::flat(2);
            (field.log_amplitude, field.phase) = (wave(5, shift), wave(5, shift + 0.5));
            field
        });
        let factor = change / super::change(&SpatialVariation::new(fields.clone()));
        for field in &mut fields {
            field.log_amplitude.iter_mut().chain(&mut field.phase).for_each(|c| *c *= factor);
        }
        model.variation = SpatialVariation::new(fields);
        model
    }

    /// Sum over the pixels of the SLM, each propagated alone through the kernel of its position.
    fn pixel_by_pixel(model: &DisplayModel, field: &Plane<Complex64>) -> Plane<Complex64> {
        let KernelShape::Smooth(kernel) = &model.kernel else { panic!("smooth by construction") };
        let mut sum = Plane::filled(SIZE.0, SIZE.1, Complex64::ZERO);
        for (y, x) in (0..SIZE.0).flat_map(|y| (0..SIZE.1).map(move |x| (y, x))) {
            let alone =
                Plane::from_fn(SIZE.0, SIZE.1, |v, u| if (v, u) == (y, x) { field.at(y, x) } else { Complex64::ZERO });
            let local = model.variation.local_kernel(kernel, position(x, SIZE.1), position(y, SIZE.0));
            let local = DisplayModel { kernel: KernelShape::Smooth(local), ..DisplayModel::ideal(model.setup) };
            let sent = reference::propagate(&alone, 8e-6, |fx, fy| local.transfer(fx, fy));
            sum.values_mut().iter_mut().zip(sent.values()).for_each(|(sum, u)| *sum += u);
        }
        sum
    }

    fn relative_l2(actual: &Plane<Complex64>, expected: &Plane<Complex64>) -> f64 {
        let error: f64 = actual.values().iter().zip(expected.values()).map(|(a, e)| (a - e).norm_sqr()).sum();
        (error / expected.values().iter().map(Complex64::norm_sqr).sum::<f64>()).sqrt()
    }

    fn sent(height_px: usize, width_px: usize) -> Plane<Complex64> {
        initial_phase(height_px, width_px, 6.0, 3).unwrap().map(|phase| Complex64::cis(f64::from(phase)))
    }

    #[test]
    fn kernel_grid_approximates_pixel_by_pixel_propagation() {
        let field = sent(SIZE.0, SIZE.1);
        for (change, side) in [(0.1, 3), (0.44, 3), (0.74, 4), (1.3, 5)] {
            let model = varying(change);
            assert_eq!(per_side(&model.variation), side);
            let expected = pixel_by_pixel(&model, &field);
            let engine = EngineCore::<f64>::new(&model, Detector::Point, None).unwrap();
            let error = relative_l2(&engine.propagate(&field).unwrap(), &expected);
            assert!(error < 6e-3, "{change}: {error:e}");
            let uniform = DisplayModel { variation: SpatialVariation::none(), ..model };
            let engine = EngineCore::<f64>::new(&uniform, Detector::Point, None).unwrap();
            let without = relative_l2(&engine.propagate(&field).unwrap(), &expected);
            assert!(without > 5.0 * error, "{change}: {without:e} with one kernel");
        }
    }

    #[test]
    fn zero_variation_matches_uniform_kernel() {
        let field = sent(SIZE.0, SIZE.1);
        let mut model = varying(1.0);
        model.variation = SpatialVariation::new([(); 5].map(|()| SmoothField::flat(1)));
        let grid = EngineCore::<f64>::new(&model, Detector::Point, None).unwrap().propagate(&field).unwrap();
        model.variation = SpatialVariation::none();
        let single = EngineCore::<f64>::new(&model, Detector::Point, None).unwrap().propagate(&field).unwrap();
        assert!(relative_l2(&grid, &single) < 1e-13);
    }

    #[test]
    fn windows_add_up_to_one_and_each_is_one_at_its_own_node() {
        for at in [-1.0, -0.4, 0.0, 0.7, 1.0] {
            assert!(((0..4).map(|i| window(i, 4, at)).sum::<f64>() - 1.0).abs() < 1e-14);
        }
        for (i, k) in (0..4).flat_map(|i| (0..4).map(move |k| (i, k))) {
            assert!((window(i, 4, node(k, 4)) - f64::from(u8::from(i == k))).abs() < 1e-14);
        }
    }
}
