//! Aberrations of a relay lens that depend on the position of the modulator's pixel in its field.
//!
//! ```text
//! ψ(f; r) = A · ( c₁ |f|² (f·r) + c₂ (f·r)² + c₃ |f|² |r|² + c₄ (f·r) |r|² ) / n,   α(f; r) = −A · c₅ (1 + f·r)² / 40
//! ```
//!
//! r is the position on the modulator relative to the drawn axis, f the frequency, both in units in which the middle of
//! an edge is 1. ψ has coma, astigmatism, field curvature and distortion, the third-order aberrations that depend on
//! the field (W. T. Welford, *Aberrations of Optical Systems*, 1986). α is the shadow of an aperture, which the light
//! of one side passes more closely. n makes A the largest phase \[rad\] of any pixel's light at the corner of the band.
//! Every pixel's light has its own transfer function. [`spectrum_by_column`] interpolates between a fine grid of
//! positions; its error is far below the camera's noise.

use super::draws::{Draws, Stream};
use super::{pixel_light, position};
use lightpath_fft::FftPlanner;
use lightpath_optics::display::parts::spatial_variation::local_kernels::{nodes, window};
use lightpath_optics::numerics::grid::frequency;
use lightpath_optics::{Plane, interrupt};
use num_complex::Complex64;
use rayon::prelude::*;

/// Number of positions along each axis between which transfer functions are interpolated.
pub(super) const POSITIONS: usize = 7;

/// The aberrations of one bench, with drawn properties.
#[derive(Clone, Debug)]
pub(super) struct FieldAberration {
    size_rad: f64,
    /// c₁ to c₄, divided by n.
    shapes: [f64; 4],
    shadow: f64,
    axis: (f64, f64),
}

impl FieldAberration {
    pub(super) fn draw(seed: u64, size_rad: f64) -> Self {
        let mut draws = Draws::new(seed, Stream::FieldAberration);
        let mut shape = || draws.within_a_fifth_of(1.0) * draws.angle().cos().signum();
        let mut drawn =
            Self { size_rad: 1.0, shapes: [shape(), shape(), shape(), 0.5 * shape()], shadow: 0.0, axis: (0.0, 0.0) };
        drawn.axis = (draws.between(-0.2, 0.2), draws.between(-0.2, 0.2));
        drawn.shadow = draws.within_a_fifth_of(1.0);
        let corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
        let pairs = corners.into_iter().flat_map(|at| corners.map(|f| (at, f)));
        let most = pairs.map(|(at, f)| drawn.exponent(at, f).im.abs()).fold(0.0, f64::max);
        drawn.shapes = drawn.shapes.map(|shape| shape / most);
        Self { size_rad, ..drawn }
    }

    pub(super) fn is_none(&self) -> bool {
        self.size_rad == 0.0
    }

    /// α + iψ at a position on the modulator and a frequency, both within ±1.
    pub(super) fn exponent(&self, (x, y): (f64, f64), (fx, fy): (f64, f64)) -> Complex64 {
        let (x, y) = (x - self.axis.0, y - self.axis.1);
        let (along, place, f) = (fx * x + fy * y, x * x + y * y, fx * fx + fy * fy);
        let [coma, astigmatism, curvature, distortion] = self.shapes;
        let phase = along * (coma * f + astigmatism * along + distortion * place) + curvature * f * place;
        let shadow = self.shadow * (1.0 + along).powi(2) / 40.0;
        self.size_rad * Complex64::new(-shadow, phase)
    }
}

/// For each position along an axis its window: the part of each pixel's light that has its transfer function.
pub(super) fn windows(side_px: usize) -> Vec<Vec<f64>> {
    let along = |i| (0..side_px).map(|px| window(i, POSITIONS, position(px, side_px))).collect();
    (0..POSITIONS).map(along).collect()
}

/// Computes Σ over positions of H · e^{α + iψ} · F pad( window · u₀ ), with one row for each fx.
pub(super) fn spectrum_by_column(
    field: &Plane<Complex64>,
    transfer_by_column: &Plane<Complex64>,
    aberration: &FieldAberration,
) -> Plane<Complex64> {
    let (height_px, width_px) = (field.height_px(), field.width_px());
    let forward_x = FftPlanner::new().plan_fft_forward(2 * width_px);
    let forward_y = FftPlanner::new().plan_fft_forward(2 * height_px);
    let (along_x, along_y) = (windows(width_px), windows(height_px));
    let rows_through = |window: &Vec<f64>| {
        let mut rows = Plane::filled(height_px, 2 * width_px, Complex64::ZERO);
        rows.values_mut().par_chunks_mut(2 * width_px).enumerate().for_each(|(y, row)| {
            interrupt::check();
            row.iter_mut().zip(field.row(y)).zip(window).for_each(|((value, u), w)| *value = u * w);
            forward_x.process(row);
        });
        rows
    };
    let rows: Vec<Plane<Complex64>> = along_x.iter().map(rows_through).collect();
    let positions: Vec<(f64, f64)> = nodes(POSITIONS).collect();
    // The frequency in units of the Nyquist frequency.
    let at = |bin, bins| 2.0 * frequency(bin, bins, 1.0);
    let mut spectrum = Plane::filled(2 * width_px, 2 * height_px, Complex64::ZERO);
    spectrum.values_mut().par_chunks_mut(2 * height_px).enumerate().for_each(|(u, sum)| {
        for (k, &node) in positions.iter().enumerate() {
            interrupt::check();
            let (rows, window) = (&rows[k % POSITIONS], &along_y[k / POSITIONS]);
            let mut column = vec![Complex64::ZERO; 2 * height_px];
            column.iter_mut().zip(window).enumerate().for_each(|(y, (value, w))| *value = rows.at(y, u) * w);
            forward_y.process(&mut column);
            for (v, (sum, value)) in sum.iter_mut().zip(&column).enumerate() {
                *sum += value * aberration.exponent(node, (at(u, 2 * width_px), at(v, 2 * height_px))).exp();
            }
        }
        sum.iter_mut().zip(transfer_by_column.row(u)).for_each(|(value, transfer)| *value *= transfer);
    });
    spectrum
}

/// The adjoint of [`spectrum_by_column`].
pub(super) fn spectrum_adjoint(
    back: &Plane<Complex64>,
    transfer_by_column: &Plane<Complex64>,
    aberration: &FieldAberration,
) -> Plane<Complex64> {
    let (height_px, width_px) = (back.width_px() / 2, back.height_px() / 2);
    let at = |bin, bins| 2.0 * frequency(bin, bins, 1.0);
    let mut field = Plane::filled(height_px, width_px, Complex64::ZERO);
    for (k, node) in nodes(POSITIONS).enumerate() {
        let mut through = back.clone();
        through.values_mut().par_chunks_mut(2 * height_px).enumerate().for_each(|(u, column)| {
            interrupt::check();
            for (v, (value, transfer)) in column.iter_mut().zip(transfer_by_column.row(u)).enumerate() {
                let local = aberration.exponent(node, (at(u, 2 * width_px), at(v, 2 * height_px))).exp();
                *value *= (transfer * local).conj();
            }
        });
        let local = pixel_light::field_of_columns(&through);
        for (y, row) in field.values_mut().chunks_exact_mut(width_px).enumerate() {
            let at_y = window(k / POSITIONS, POSITIONS, position(y, height_px));
            for (x, (sum, value)) in row.iter_mut().zip(local.row(y)).enumerate() {
                *sum += value * at_y * window(k % POSITIONS, POSITIONS, position(x, width_px));
            }
        }
    }
    field
}
