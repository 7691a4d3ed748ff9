//! H as a number for each frequency, in arrays.

use super::array::Array;
use super::error::KernelFormatError;
use super::imported::Imported;
use super::losses::{Loss, beside_bins};
use crate::budget::Budget;
use lightpath_domain::kernel_format::KernelFormat;
use lightpath_optics::numerics::grid::frequency;
use lightpath_optics::{DisplayModel, KernelModel, KernelShape, OpticalSetup, Plane};
use num_complex::Complex32;
use num_complex::Complex64;
use rayon::prelude::*;
use std::cell::OnceCell;
use std::fmt;

/// H at a frequency \[1/m\].
pub(super) type Sampled<'a> = Box<dyn Fn(f64, f64) -> Complex64 + Sync + 'a>;

/// H of a model. Its tables, whose computation takes longest, are made when they are needed first, and once.
pub(super) struct Transfer<'a> {
    pub(super) model: &'a DisplayModel,
    sampled: OnceCell<Sampled<'a>>,
}

impl fmt::Debug for Transfer<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Transfer").field("model", self.model).finish_non_exhaustive()
    }
}

impl<'a> Transfer<'a> {
    pub(super) fn of(model: &'a DisplayModel) -> Self {
        Self { model, sampled: OnceCell::new() }
    }

    /// H at padded bins.
    pub(super) fn sampled(&self) -> &Sampled<'a> {
        self.sampled.get_or_init(|| Box::new(self.model.sampled()))
    }

    /// H at every bin of the padded spectrum, zero frequency in the middle.
    pub(super) fn padded(&self) -> Plane<Complex32> {
        self.middle(self.model.setup.padded_height_px(), self.model.setup.padded_width_px())
    }

    /// H at the middle `rows` × `columns` bins of the padded spectrum, zero frequency in the middle.
    pub(super) fn middle(&self, rows: usize, columns: usize) -> Plane<Complex32> {
        let setup = &self.model.setup;
        let bins = [setup.padded_height_px(), setup.padded_width_px()];
        let (h, pitch_m) = (self.sampled(), setup.grid().pixel_pitch_m());
        let at = |i: usize, side: usize, bins: usize| frequency((i + bins - side / 2) % bins, bins, pitch_m);
        let mut out = Plane::filled(rows, columns, Complex32::ZERO);
        out.values_mut().par_chunks_mut(columns).enumerate().for_each(|(y, row)| {
            let fy = at(y, rows, bins[0]);
            for (x, value) in row.iter_mut().enumerate() {
                let h = h(at(x, columns, bins[1]), fy);
                *value = Complex32::new(h.re as f32, h.im as f32);
            }
        });
        out
    }
}

pub(super) fn parts(plane: &Plane<Complex32>) -> Vec<f32> {
    plane.values().iter().flat_map(|value| [value.re, value.im]).collect()
}

pub(super) fn f32_bytes(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

/// Reads H from an array: complex \[rows, columns\], real and imaginary parts \[rows, columns, 2\], or the paper's
/// amplitude and phase \[1, 2, rows, columns\] or \[2, rows, columns\].
pub(super) fn of_array(
    array: &Array<'_>,
    setup: &OpticalSetup,
    form: KernelFormat,
    budget: &Budget,
) -> Result<Imported, KernelFormatError> {
    let numbers = &array.numbers;
    budget.take(size_of_val(&numbers[..]) as u64)?;
    let (rows, columns, values): (usize, usize, Vec<Complex32>) = match (array.complex, &array.shape[..]) {
        (true, &[rows, columns]) => (rows, columns, complex_of(numbers)),
        (false, &[rows, columns, 2]) => (rows, columns, complex_of(numbers)),
        (false, &[1, 2, rows, columns] | &[2, rows, columns]) => {
            let (amplitude, phase) = numbers.split_at(rows * columns);
            let polar = |(&a, &p): (&f32, &f32)| {
                let (sine, cosine) = f64::from(p).sin_cos();
                Complex32::new((f64::from(a) * cosine) as f32, (f64::from(a) * sine) as f32)
            };
            (rows, columns, amplitude.iter().zip(phase).map(polar).collect())
        }
        _ => {
            return Err(KernelFormatError::Array {
                name: array.name.clone(),
                actual: array.described(),
                expected: "real of shape [1, 2, rows, columns] (amplitude and phase), real of shape [rows, columns, \
                           2], or complex of shape [rows, columns]"
                    .to_owned(),
            });
        }
    };
    let grid = setup.grid();
    let is = |factor: usize| (rows, columns) == (factor * grid.height_px(), factor * grid.width_px());
    if !is(1) && !is(2) {
        let (height, width) = (grid.height_px(), grid.width_px());
        return Err(KernelFormatError::Array {
            name: array.name.clone(),
            actual: format!("{rows}×{columns} (rows × columns)"),
            expected: format!(
                "{height}×{width} (the display's) or {}×{} (the padded spectrum's)",
                2 * height,
                2 * width
            ),
        });
    }
    let kind = if is(1) { KernelModel::Paper } else { KernelModel::Dense };
    let kernel = KernelShape::Bins(Plane::try_from_vec(rows, columns, values)?);
    let model = DisplayModel { kernel, ..DisplayModel::ideal(*setup) };
    model.validate()?;
    let outer = (kind == KernelModel::Paper).then_some(Loss::OuterSpectrum);
    Ok(Imported { kind, absent: beside_bins().chain(outer).collect(), ..Imported::new(form, model) })
}

fn complex_of(numbers: &[f32]) -> Vec<Complex32> {
    numbers.as_chunks().0.iter().map(|&[re, im]| Complex32::new(re, im)).collect()
}
