//! Products of the derivatives of a row's light, from which a curvature is summed.

use crate::engine::Real;
use pulp::{Simd, WithSimd};

/// All products of the derivatives along a row: of each with itself and the later ones, and of each with the error.
pub(super) struct Products<'a, T> {
    pub(super) values: &'a [T],
    pub(super) error: &'a [T],
    pub(super) parameters: usize,
    pub(super) width: usize,
}

impl<T: Real> WithSimd for Products<'_, T> {
    type Output = (Vec<f64>, Vec<f64>);

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let Self { values, error, parameters, width } = self;
        let row = |a: usize| &values[a * width..][..width];
        let mut products = vec![0.0; parameters * (parameters + 1) / 2];
        let gradient = (0..parameters).map(|a| dot(row(a), error)).collect();
        // Products of a with a and the later ones start here.
        let start = |a: usize| a * parameters - a * a.saturating_sub(1) / 2;
        for first in (0..parameters).step_by(TOGETHER) {
            // The last rows are repeated where fewer are left.
            let together: [&[T]; TOGETHER] = std::array::from_fn(|k| row((first + k).min(parameters - 1)));
            for b in first..parameters {
                let found = dots(together, row(b));
                for (a, found) in (first..=b).zip(found) {
                    products[start(a) + b - a] = found;
                }
            }
        }
        (products, gradient)
    }
}

/// Number of rows that are multiplied by another one together, so that it is read once for all of them.
const TOGETHER: usize = 4;

/// Dot product in a fixed order, in lanes that vector instructions can add.
#[inline(always)]
fn dot<T: Real>(a: &[T], b: &[T]) -> f64 {
    let [found] = dots([a], b);
    found
}

/// Dot products of several rows with another one.
#[inline(always)]
fn dots<T: Real, const N: usize>(rows: [&[T]; N], b: &[T]) -> [f64; N] {
    const LANES: usize = 16;
    let mut lanes = [[T::zero(); LANES]; N];
    let (b_blocks, b_rest) = b.as_chunks::<LANES>();
    let blocks = rows.map(|row| &row.as_chunks::<LANES>().0[..b_blocks.len()]);
    for (i, b) in b_blocks.iter().enumerate() {
        for (lanes, blocks) in lanes.iter_mut().zip(blocks) {
            for lane in 0..LANES {
                lanes[lane] = lanes[lane] + blocks[i][lane] * b[lane];
            }
        }
    }
    std::array::from_fn(|n| {
        let rest = rows[n].as_chunks::<LANES>().1.iter().zip(b_rest).map(|(a, b)| (*a * *b).wide()).sum::<f64>();
        lanes[n].iter().map(|lane| lane.wide()).sum::<f64>() + rest
    })
}
