//! Parallel transforms of all rows of a plane, and transposition.

use crate::numerics::buffers::zeros;
use crate::numerics::real::Number;
use num_complex::Complex;
use rayon::prelude::*;

/// Turns every row of `input_len` values into a row of `output_len` values by `each(row, out, scratch)`.
pub(super) fn transform_rows<T: Number, S>(
    input: &[Complex<T>],
    input_len: usize,
    output_len: usize,
    scratch: impl Fn() -> S + Sync,
    each: impl Fn(&[Complex<T>], &mut [Complex<T>], &mut S) + Sync,
) -> Vec<Complex<T>> {
    let mut output: Vec<Complex<T>> = zeros(input.len() / input_len * output_len);
    let rows = output.par_chunks_exact_mut(output_len).zip(input.par_chunks_exact(input_len));
    rows.for_each_init(&scratch, |scratch, (out, row)| each(row, out, scratch));
    output
}

/// Transposes a plane whose rows have `width` values.
pub(super) fn transposed<T: Number>(input: &[Complex<T>], width: usize) -> Vec<Complex<T>> {
    let height = input.len() / width;
    let mut output: Vec<Complex<T>> = zeros(input.len());
    output.par_chunks_exact_mut(height).enumerate().for_each(|(x, column)| {
        for (value, &from) in column.iter_mut().zip(input[x..].iter().step_by(width)) {
            *value = from;
        }
    });
    output
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_transposed_and_transformed() {
        let of = |values: &[f64]| values.iter().map(|&value| Complex::new(value, 0.0)).collect::<Vec<_>>();
        assert_eq!(transposed(&of(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), 3), of(&[1.0, 4.0, 2.0, 5.0, 3.0, 6.0]));
        let doubled = transform_rows(&of(&[1.0, 2.0, 3.0, 4.0]), 2, 1, || (), |row, out, ()| out[0] = row[0] + row[1]);
        assert_eq!(doubled, of(&[3.0, 7.0]));
    }
}
