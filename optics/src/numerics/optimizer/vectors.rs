//! Operations on long f32 vectors, in as few passes over memory as possible. Sums have a fixed order.
//!
//! Within a chunk, values are added in f32 in independent lanes. The sums of the chunks are then added in f64 in order,
//! so that the result does not depend on the number of threads.

use crate::interrupt;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Number of steps in the history, m. A longer history improves the result little and takes time, since each step reads
/// the history twice.
pub(crate) const HISTORY: usize = 6;
/// Number of basis vectors of a direction: s_1 … s_m, y_1 … y_m, g.
pub(crate) const BASIS: usize = 2 * HISTORY + 1;
/// Number of values in a chunk, which one thread processes at a time. A few chunks fit into a core's first-level cache.
const CHUNK: usize = 4096;
/// Number of independent partial sums.
const LANES: usize = 32;

/// Inner product Σ a b.
pub(crate) fn product(a: &[f32], b: &[f32], sums: &mut Vec<f64>) -> f64 {
    let arch = Arch::new();
    sums.resize(a.len().div_ceil(CHUNK), 0.0);
    (a.par_chunks(CHUNK), b.par_chunks(CHUNK), &mut sums[..]).into_par_iter().for_each(|(a, b, sum)| {
        interrupt::check();
        *sum = arch.dispatch(Dot { a, b });
    });
    sums.iter().sum()
}

/// `to` = `from` + step · `direction`
pub(crate) fn move_along(from: &[f32], direction: &[f32], step: f32, to: &mut [f32]) {
    let arch = Arch::new();
    (from.par_chunks(CHUNK), direction.par_chunks(CHUNK), to.par_chunks_mut(CHUNK)).into_par_iter().for_each(
        |(from, direction, to)| {
            interrupt::check();
            arch.dispatch(|| {
                for ((to, &from), &d) in to.iter_mut().zip(from).zip(direction) {
                    *to = from + step * d;
                }
            });
        },
    );
}

/// Writes the new step and the change of the gradient to slot `slot` of the history. Returns the inner products of the
/// new s, y and g with s_1 … s_m, y_1 … y_m, g.
pub(crate) fn gram_rows(
    points: [&[f32]; 2],
    gradients: [&[f32]; 2],
    history: (&mut [Vec<f32>], &mut [Vec<f32>]),
    slot: usize,
    sums: &mut Vec<f64>,
) -> [[f64; BASIS]; 3] {
    let arch = Arch::new();
    let len = points[0].len();
    let (steps, changes) = history;
    let (mut new_step, mut new_change) = (std::mem::take(&mut steps[slot]), std::mem::take(&mut changes[slot]));
    // Products with slots that hold no vector yet stay 0.
    sums.clear();
    sums.resize(len.div_ceil(CHUNK) * 3 * BASIS, 0.0);
    let chunks = (new_step.par_chunks_mut(CHUNK), new_change.par_chunks_mut(CHUNK), sums.par_chunks_mut(3 * BASIS));
    chunks.into_par_iter().enumerate().for_each(|(i, (s, y, sums))| {
        interrupt::check();
        let range = i * CHUNK..(i * CHUNK + s.len());
        arch.dispatch(|| subtract(&points[1][range.clone()], &points[0][range.clone()], s));
        arch.dispatch(|| subtract(&gradients[1][range.clone()], &gradients[0][range.clone()], y));
        let new = [&*s, &*y, &gradients[1][range.clone()]];
        let (row_s, rest) = sums.split_at_mut(BASIS);
        let (row_y, row_g) = rest.split_at_mut(BASIS);
        let mut put = |b: usize, with: &[f32]| {
            [row_s[b], row_y[b], row_g[b]] = arch.dispatch(ThreeDots { a: new, b: with });
        };
        for (i, (step, change)) in steps.iter().zip(&*changes).enumerate() {
            if i != slot {
                put(i, &step[range.clone()]);
                put(HISTORY + i, &change[range.clone()]);
            }
        }
        put(slot, new[0]);
        put(HISTORY + slot, new[1]);
        put(2 * HISTORY, new[2]);
    });
    (steps[slot], changes[slot]) = (new_step, new_change);
    let mut rows = [[0.0; BASIS]; 3];
    for sums in sums.chunks_exact(3 * BASIS) {
        for (total, sum) in rows.as_flattened_mut().iter_mut().zip(sums) {
            *total += sum;
        }
    }
    rows
}

/// `to` = Σ weights · (s_1 … s_m, y_1 … y_m, g). Vectors s and y with weight 0 are not read.
pub(crate) fn combine(
    steps: &[Vec<f32>],
    changes: &[Vec<f32>],
    gradient: &[f32],
    weights: &[f64; BASIS],
    to: &mut [f32],
) {
    let arch = Arch::new();
    to.par_chunks_mut(CHUNK).enumerate().for_each(|(i, to)| {
        interrupt::check();
        let range = i * CHUNK..(i * CHUNK + to.len());
        let weight = weights[2 * HISTORY] as f32;
        arch.dispatch(|| scale(&gradient[range.clone()], weight, to));
        for (vectors, weights) in [(steps, &weights[..HISTORY]), (changes, &weights[HISTORY..])] {
            for (vector, &weight) in vectors.iter().zip(weights) {
                if weight != 0.0 {
                    arch.dispatch(|| add_scaled(&vector[range.clone()], weight as f32, to));
                }
            }
        }
    });
}

struct Dot<'a> {
    a: &'a [f32],
    b: &'a [f32],
}

impl WithSimd for Dot<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let mut lanes = [0.0_f32; LANES];
        let (a, a_rest) = self.a.as_chunks::<LANES>();
        let (b, b_rest) = self.b.as_chunks::<LANES>();
        for (a, b) in a.iter().zip(b) {
            for ((lane, &a), &b) in lanes.iter_mut().zip(a).zip(b) {
                *lane += a * b;
            }
        }
        for ((lane, &a), &b) in lanes.iter_mut().zip(a_rest).zip(b_rest) {
            *lane += a * b;
        }
        lanes.iter().map(|&lane| f64::from(lane)).sum()
    }
}

/// Inner products of three vectors with one vector, which is read from memory once.
struct ThreeDots<'a> {
    a: [&'a [f32]; 3],
    b: &'a [f32],
}

impl WithSimd for ThreeDots<'_> {
    type Output = [f64; 3];

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> [f64; 3] {
        // The chunk stays in the first-level cache between the products.
        self.a.map(|a| Dot { a, b: self.b }.with_simd(simd))
    }
}

#[inline(always)]
fn subtract(a: &[f32], b: &[f32], to: &mut [f32]) {
    for ((to, &a), &b) in to.iter_mut().zip(a).zip(b) {
        *to = a - b;
    }
}

#[inline(always)]
fn scale(from: &[f32], by: f32, to: &mut [f32]) {
    for (to, &from) in to.iter_mut().zip(from) {
        *to = by * from;
    }
}

#[inline(always)]
fn add_scaled(from: &[f32], by: f32, to: &mut [f32]) {
    for (to, &from) in to.iter_mut().zip(from) {
        *to += by * from;
    }
}
