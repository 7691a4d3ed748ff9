//! The response of the pixels' [band](super::band_response) beside the pixels' centres, behind the errors of a learned
//! kernel, and behind a filter.
//!
//! ```text
//! h(n + o) = Δ² ∫∫ H(fx, fy) E(fx, fy) e^{i2πΔ((n_x + o_x)·fx + (n_y + o_y)·fy)} dfx dfy   over |fx|, |fy| ≤ 1/2Δ
//! ```
//!
//! n lags between two pixels of the frame, o place of a sub-sample from the centre of its pixel \[px\], E smooth errors
//! times the part that a [filter](crate::OrderFilter) passes, whose edges are smooth over many of the frequencies. It
//! is the same sum over M frequencies along each axis as at the centres. The leading term of its error along x is now
//!
//! ```text
//! error(x) = 1/(12M²) · [ (F′ + i2πx F) e^{i2πνx} ]  from ν = −1/2 to ν = 1/2,   F = H·E,   x = n + o,   ν = Δ·fx
//! ```
//!
//! A linear phase on the padded spectrum would move the samples by o as well, but from samples of the whole padded
//! frame, which beyond the image are not those of the field. For the same reason errors that are multiplied there are
//! not quite those of the optics.

use super::band_response::{BandEnds, bins, sample_column};
use crate::display::OpticalSetup;
use crate::display::parts::ghost::TransferErrors;
use crate::interrupt;
use crate::numerics::buffers::zeros;
use crate::propagation_method::ConvolutionMethod;
use lightpath_fft::{Fft, FftPlanner};
use num_complex::{Complex32, Complex64};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};
use std::ops::Range;
use std::sync::Arc;

/// Number of values of a [`BandSamples`]; 0 for another method, or if there would be too many frequencies.
pub(crate) fn band_samples(setup: &OpticalSetup, has_errors: bool) -> u64 {
    if setup.method() != ConvolutionMethod::BandResponse {
        return 0;
    }
    let is_even = is_even(setup, has_errors);
    bins(setup).map_or(0, |[bins_x, _]| Columns { bins_x, is_even }.count() as u64)
        * 2
        * setup.grid().height_px() as u64
}

/// Whether the response is even along both axes.
pub(crate) fn is_even(setup: &OpticalSetup, has_errors: bool) -> bool {
    !has_errors && setup.orders().filter().is_none()
}

/// The response at one place along y, transformed along y.
pub(crate) struct BandSamples {
    height_px: usize,
    bins_y: usize,
    columns: Columns,
    /// For each of the columns the lags along y, in the order of the padded frame. The rounding to f32 is as small as
    /// that of the transfer function that is made of them.
    along_y: Vec<Complex32>,
    fft: Arc<dyn Fft<f64>>,
}

/// Columns of frequencies along x that are transformed along y, and where each is stored: bin by bin, then what belongs
/// to the ends of the band. Of an even response only one side.
#[derive(Clone, Copy)]
struct Columns {
    bins_x: usize,
    is_even: bool,
}

/// What a column holds: F at a bin, or F or ∂F/∂ν at an end of the band, which is -1 or 1.
enum Column {
    Bin(usize),
    End(f64),
    Slope(f64),
}

impl Columns {
    fn count(self) -> usize {
        if self.is_even { self.bins_x / 2 + 2 } else { self.bins_x + 3 }
    }

    fn at(self, stored: usize) -> Column {
        let half = self.bins_x / 2;
        let last = if self.is_even { half } else { self.bins_x - 1 };
        match stored.checked_sub(last + 1) {
            None if stored == half => Column::End(1.0),
            None => Column::Bin(stored),
            Some(0) => Column::Slope(1.0),
            Some(1) => Column::Slope(-1.0),
            Some(_) => Column::End(-1.0),
        }
    }

    /// F at a bin, and both ends of the band.
    fn read(self, column: impl Fn(usize) -> Complex64) -> (impl Fn(usize) -> Complex64, [End; 2]) {
        let half = self.bins_x / 2;
        let upper = column(half);
        let ends = if self.is_even {
            let slope = column(half + 1);
            [End { value: upper, slope: -slope }, End { value: upper, slope }]
        } else {
            let besides = |i| column(self.bins_x + i);
            [End { value: besides(2), slope: besides(1) }, End { value: upper, slope: besides(0) }]
        };
        (move |bin: usize| column(if self.is_even { bin.min(self.bins_x - bin) } else { bin }), ends)
    }
}

/// F and ∂F/∂ν at an end of the band.
#[derive(Clone, Copy, Default)]
struct End {
    value: Complex64,
    slope: Complex64,
}

impl BandSamples {
    /// The response at the place `offset_y` \[px\], behind these errors. `None` if there would be too many frequencies.
    pub(crate) fn new(setup: &OpticalSetup, errors: Option<&TransferErrors>, offset_y: f64) -> Option<Self> {
        let [bins_x, bins_y] = bins(setup)?;
        let (height_px, pitch_m) = (setup.grid().height_px(), setup.grid().pixel_pitch_m());
        let (columns, band) = (Columns { bins_x, is_even: is_even(setup, errors.is_some()) }, BandEnds::new(setup));
        let filter = setup.orders().filter();
        let mut planner = FftPlanner::new();
        let (fft_y, turns) = (planner.plan_fft_inverse(bins_y), turns(bins_y, offset_y));
        let (edge, light) = (Edge::at(offset_y), (setup.wavelength_m(), setup.distance_m()));
        let mut along_y: Vec<Complex32> = zeros(columns.count() * 2 * height_px);
        along_y.par_chunks_exact_mut(2 * height_px).enumerate().for_each_init(
            || {
                let scratch = vec![Complex64::ZERO; fft_y.get_inplace_scratch_len()];
                (vec![Complex64::ZERO; bins_y], scratch, vec![Complex64::ZERO; bins_y / 2 + 1])
            },
            |(sequence, scratch, ideal), (stored, out)| {
                interrupt::check();
                let column = columns.at(stored);
                // Frequencies along x in cycles per pixel.
                let nu = match column {
                    Column::Bin(bin) => signed(bin, bins_x),
                    Column::End(sign) | Column::Slope(sign) => 0.5 * sign,
                };
                let series = errors.map(|errors| errors.along_y(2.0 * nu));
                let error = |mu: f64| {
                    let passed = filter.map_or(1.0, |filter| filter.passed(nu, mu));
                    series.as_ref().map_or(Complex64::ONE, |series| series.at(2.0 * mu)) * passed
                };
                // Without errors, at all bins from zero frequency to the end of the band. It is even along y.
                match column {
                    Column::Slope(sign) => ideal
                        .iter_mut()
                        .enumerate()
                        .for_each(|(bin, value)| *value = band.slope(signed(bin, bins_y) / pitch_m) * sign),
                    _ => sample_column(nu / pitch_m, 1.0 / (bins_y as f64 * pitch_m), light, ideal),
                }
                let value = |bin: usize| ideal[bin.min(bins_y - bin)] * error(signed(bin, bins_y));
                // The slopes are a correction already, and have none.
                let slope = |sign: f64| match column {
                    Column::Slope(_) => Complex64::ZERO,
                    _ => band.slope(nu / pitch_m) * error(0.5 * sign) * sign,
                };
                let at_end = ideal[bins_y / 2];
                let ends = [-1.0, 1.0].map(|sign| End { value: at_end * error(0.5 * sign), slope: slope(sign) });
                let has_correction = !matches!(column, Column::Slope(_));
                fill(sequence, &turns, offset_y, value, ends, columns.is_even);
                fft_y.process_with_scratch(sequence, scratch);
                for (row, out) in out.iter_mut().enumerate() {
                    let mut exact = sequence[index(row, height_px, bins_y)];
                    if has_correction {
                        exact -= edge.correction(lag(row, height_px), ends) / bins_y as f64;
                    }
                    *out = Complex32::new(exact.re as f32, exact.im as f32);
                }
            },
        );
        Some(Self { height_px, bins_y, columns, along_y, fft: planner.plan_fft_inverse(bins_x) })
    }

    /// Rows that [`AlongX::row`] takes along x.
    pub(super) fn along_x(&self, offset_x: f64) -> AlongX<'_> {
        AlongX { samples: self, offset_x, edge: Edge::at(offset_x), turns: turns(self.columns.bins_x, offset_x) }
    }

    /// The values of some rows of the padded frame, row by row. Rows that are gathered together share lines of the
    /// cache.
    pub(super) fn gather(&self, rows: Range<usize>, gathered: &mut Vec<Complex32>) {
        let (count, len) = (self.columns.count(), 2 * self.height_px);
        gathered.resize(count * rows.len(), Complex32::ZERO);
        for (stored, column) in self.along_y.chunks_exact(len).enumerate() {
            for (i, value) in column[rows.clone()].iter().enumerate() {
                gathered[i * count + stored] = *value;
            }
        }
    }
}

/// The response at one place in the pixel.
pub(super) struct AlongX<'a> {
    samples: &'a BandSamples,
    offset_x: f64,
    edge: Edge,
    turns: Vec<Complex64>,
}

impl AlongX<'_> {
    /// Writes the response at the lag along y of one of the [gathered](BandSamples::gather) rows, at all lags along x
    /// of the columns of the padded frame. `buffer` is scratch memory.
    pub(super) fn row(&self, row: usize, gathered: &[Complex32], out: &mut [Complex64], buffer: &mut Vec<Complex64>) {
        let BandSamples { bins_y, columns, fft, .. } = self.samples;
        let (bins_x, width_px) = (columns.bins_x, out.len() / 2);
        let values = &gathered[row * columns.count()..];
        let (value, ends) = columns.read(|stored| {
            let narrow = values[stored];
            Complex64::new(f64::from(narrow.re), f64::from(narrow.im))
        });
        buffer.resize(bins_x + fft.get_inplace_scratch_len(), Complex64::ZERO);
        let (sequence, scratch) = buffer.split_at_mut(bins_x);
        fill(sequence, &self.turns, self.offset_x, value, ends, columns.is_even);
        fft.process_with_scratch(sequence, scratch);
        let scale = 1.0 / (bins_x as f64 * *bins_y as f64);
        for (column, out) in out.iter_mut().enumerate() {
            let error = self.edge.correction(lag(column, width_px), ends) / bins_x as f64;
            *out = (sequence[index(column, width_px, bins_x)] - error) * scale;
        }
    }
}

/// Frequency of a bin \[cycles per pixel\].
fn signed(bin: usize, bins: usize) -> f64 {
    let bin = if bin <= bins / 2 { bin as f64 } else { bin as f64 - bins as f64 };
    bin / bins as f64
}

/// e^{i2πk·offset/bins} for k = 0 … bins/2.
fn turns(bins: usize, offset: f64) -> Vec<Complex64> {
    (0..=bins / 2).map(|k| Complex64::cis(TAU * k as f64 * offset / bins as f64)).collect()
}

/// Fills the frequencies of a function, times the phase of the offset.
fn fill(
    sequence: &mut [Complex64],
    turns: &[Complex64],
    offset: f64,
    value: impl Fn(usize) -> Complex64,
    [lower, upper]: [End; 2],
    is_even: bool,
) {
    let bins = sequence.len();
    sequence[0] = value(0);
    for k in 1..bins / 2 {
        let above = value(k);
        let below = if is_even { above } else { value(bins - k) };
        (sequence[k], sequence[bins - k]) = (above * turns[k], below * turns[k].conj());
    }
    // Half of the value at each end of the band.
    let turn = Complex64::cis(PI * offset);
    sequence[bins / 2] = 0.5 * (upper.value * turn + lower.value * turn.conj());
}

/// What the sharp ends of the band do to the sum at one place in the pixels.
struct Edge {
    offset: f64,
    /// e^{iπ·offset}
    turn: Complex64,
}

impl Edge {
    fn at(offset: f64) -> Self {
        Self { offset, turn: Complex64::cis(PI * offset) }
    }

    /// The leading term of the error of the sum at a whole `lag`, times the number of frequencies.
    fn correction(&self, lag: f64, [lower, upper]: [End; 2]) -> Complex64 {
        let at = |end: End| end.slope + Complex64::new(0.0, TAU * (lag + self.offset)) * end.value;
        let sign = if lag % 2.0 == 0.0 { 1.0 } else { -1.0 };
        (at(upper) * self.turn - at(lower) * self.turn.conj()) * (sign / 12.0)
    }
}

/// Lag of an index of the padded frame, from −side to side − 1.
fn lag(index: usize, side_px: usize) -> f64 {
    if index < side_px { index as f64 } else { index as f64 - 2.0 * side_px as f64 }
}

/// Index of a lag of the padded frame in a sequence of `bins`.
fn index(lag: usize, side_px: usize, bins: usize) -> usize {
    if lag < side_px { lag } else { bins + lag - 2 * side_px }
}
