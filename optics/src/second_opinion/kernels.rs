//! Learned kernels as the independent model sees them.
//!
//! A kernel that [varies over the SLM](crate::SpatialVariation) is interpolated between points on the SLM, as the engine
//! does, but at other points and at more of them:
//!
//! ```text
//! u = Σ_ij F⁻¹[ H E_ij F[ ℓ_i(x) ℓ_j(y) c ] ],   x_i = −cos(πi/(n − 1))
//! ```
//!
//! ℓ_i is the polynomial of degree n − 1 that is 1 at the point x_i and 0 at the others, E_ij the errors of the kernel
//! at the point x_i, y_j, and c the field on the SLM.
//!
//! A kernel with a value for each frequency of the engine's padded frame says nothing about the frequencies between
//! them. What it adds to free space on that frame is a response of as many lags, and their spectrum is known everywhere:
//!
//! ```text
//! H(ν) = H₀(ν) + Σ_n d(n) e^{−i2πν·n},   d = F⁻¹(H − H₀) on the padded frame,   n from −N to N − 1
//! ```
//!
//! H₀ is free space, N the sides of the display \[px\].

use crate::display::parts::spatial_variation::local_kernels;
use crate::display::{DisplayModel, KernelShape};
use crate::interrupt;
use crate::numerics::buffers::zeros;
use crate::numerics::chebyshev::position;
use crate::numerics::grid::frequency;
use crate::numerics::{Plane, SmoothField};
use lightpath_fft::FftPlanner;
use num_complex::Complex64;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Points along an axis besides those of the engine.
const MORE_POINTS: usize = 2;

/// Parts of the SLM with their errors. A uniform kernel has one part, the whole SLM.
pub(super) struct Parts {
    /// Windows along each axis: a factor for each pixel; `None`: 1 everywhere.
    pub(super) along_x: Vec<Option<Vec<f64>>>,
    pub(super) along_y: Vec<Option<Vec<f64>>>,
    /// For each window along y those of all windows along x; empty: no errors.
    errors: Vec<SmoothField>,
}

impl Parts {
    pub(super) fn of(model: &DisplayModel) -> Self {
        let KernelShape::Smooth(kernel) = &model.kernel else {
            return Self { along_x: vec![None], along_y: vec![None], errors: Vec::new() };
        };
        // With all orders, the kernel's own errors differ from order to order.
        let flat = SmoothField::flat(kernel.order);
        let kernel = if model.setup.orders().are_all() { &flat } else { kernel };
        if model.variation.is_none() {
            return Self { along_x: vec![None], along_y: vec![None], errors: vec![kernel.clone()] };
        }
        let per_side = windows_per_side(local_kernels::per_side(&model.variation));
        let points: Vec<f64> = (0..per_side).map(|i| -(PI * i as f64 / (per_side - 1) as f64).cos()).collect();
        let windows = |side_px| (0..per_side).map(|i| Some(window(&points, i, side_px))).collect();
        let local = |i| model.variation.local_kernel(kernel, points[i % per_side], points[i / per_side]);
        let grid = model.setup.grid();
        Self {
            along_x: windows(grid.width_px()),
            along_y: windows(grid.height_px()),
            errors: (0..per_side * per_side).map(local).collect(),
        }
    }

    pub(super) fn errors(&self, part_x: usize, part_y: usize) -> Option<&SmoothField> {
        self.errors.get(part_y * self.along_x.len() + part_x)
    }
}

/// Spectra that are transformed along y in place of one: the residual has twice as many rows as the field.
pub(super) const SPECTRA_OF_BINS: u64 = 3;

/// Number of windows along an axis, for that of the engine's.
pub(super) fn windows_per_side(kernels_per_side: usize) -> usize {
    if kernels_per_side == 1 { 1 } else { kernels_per_side + MORE_POINTS }
}

/// The polynomial of a point at all pixels of an axis.
fn window(points: &[f64], i: usize, side_px: usize) -> Vec<f64> {
    let others = || points.iter().enumerate().filter(move |(k, _)| *k != i).map(|(_, other)| other);
    let scale: f64 = others().map(|other| points[i] - other).product();
    (0..side_px).map(|px| others().map(|other| position(px, side_px) - other).product::<f64>() / scale).collect()
}

/// What a kernel with a value for each frequency adds to free space.
pub(super) struct Residual {
    /// d(n), from the lags −N.
    pub(super) response: Plane<Complex64>,
}

impl Residual {
    /// `None` for other kernels.
    pub(super) fn of(model: &DisplayModel) -> Option<Self> {
        if !matches!(model.kernel, KernelShape::Bins(_)) {
            return None;
        }
        let (height_px, width_px) = (model.setup.padded_height_px(), model.setup.padded_width_px());
        let pitch_m = model.setup.grid().pixel_pitch_m();
        let (learned, free) = (model.sampled(), model.setup.sampled());
        let mut by_row: Vec<Complex64> = zeros(height_px * width_px);
        by_row.par_chunks_exact_mut(width_px).enumerate().for_each(|(row, values)| {
            interrupt::check();
            let fy = frequency(row, height_px, pitch_m);
            for (column, value) in values.iter_mut().enumerate() {
                let fx = frequency(column, width_px, pitch_m);
                *value = learned(fx, fy) - free.at(fx, fy);
            }
        });
        let by_column = transformed(by_row, [height_px, width_px]);
        let by_row = transformed(by_column, [width_px, height_px]);
        let scale = 1.0 / (height_px * width_px) as f64;
        let moved = |i: usize, side_px: usize| (i + side_px / 2) % side_px;
        let response = Plane::from_fn(height_px, width_px, |y, x| {
            scale * by_row[moved(y, height_px) * width_px + moved(x, width_px)]
        });
        Some(Self { response })
    }

    /// The lags along x and y of the first value \[px\].
    pub(super) fn first_lags(&self) -> [f64; 2] {
        [self.response.width_px(), self.response.height_px()].map(|side_px| -((side_px / 2) as f64))
    }
}

/// Rows, transformed without a factor, as the columns of a plane in the same order.
fn transformed(mut rows: Vec<Complex64>, [height_px, width_px]: [usize; 2]) -> Vec<Complex64> {
    let fft = FftPlanner::new().plan_fft_inverse(width_px);
    rows.par_chunks_exact_mut(width_px).for_each(|row| {
        interrupt::check();
        fft.process(row);
    });
    let mut columns: Vec<Complex64> = zeros(rows.len());
    columns.par_chunks_exact_mut(height_px).enumerate().for_each(|(x, column)| {
        column.iter_mut().enumerate().for_each(|(y, value)| *value = rows[y * width_px + x]);
    });
    columns
}
