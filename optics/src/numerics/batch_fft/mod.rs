//! Discrete Fourier transforms of many columns at once.
//!
//! ```text
//! X_k = Σ_n x_n e^{−i2πnk/N},   N = R₁·R₂·…
//! ```
//!
//! A tile holds `columns` neighbouring columns row by row, with the real and the imaginary parts in separate planes.
//! Each lane of a register belongs to one column, so numbers never move between lanes and no transposes or shuffles are
//! needed. Each stage is one of Stockham's algorithm, which reads one buffer and writes another in natural order. The
//! inverse transform is the forward transform with the two planes exchanged.
//!
//! Lengths with prime factors other than 2, 3 and 5 are transformed by the crate rustfft, one column at a time.

mod butterflies;
mod lanes;
mod tile;

pub(crate) use lanes::ComplexLanes;
pub(crate) use tile::{Factors, Planes};

use super::real::{Number, unit_of};
use butterflies::{
    Butterfly2, Butterfly3, Butterfly4, Butterfly5, Butterfly6, Butterfly8, Butterfly9, Butterfly10, Butterfly12,
    StageOf,
};
use lightpath_fft::{Fft, FftPlanner};
use num_complex::Complex;
use pulp::{Simd, WithSimd};
use std::{f64::consts::TAU, sync::Arc};

/// Radices of the stages. The largest radix that divides the remaining length is chosen first.
const RADICES: [usize; 9] = [12, 10, 9, 8, 6, 5, 4, 3, 2];

/// FFT plan for tiles of a fixed number of columns.
pub(crate) struct BatchFft<T> {
    columns: usize,
    plan: Plan<T>,
}

/// Algorithm that transforms the columns of a tile.
enum Plan<T> {
    Stages(Vec<Stage<T>>),
    ColumnByColumn(Arc<dyn Fft<T>>),
}

/// Stage of Stockham's algorithm with radix R. Rows (r·m + p)·s + q of the source, r = 0 … R−1, are transformed to rows
/// (p·R + k)·s + q, k = 0 … R−1.
struct Stage<T> {
    radix: usize,
    /// Length that remains to be transformed after this stage.
    m: usize,
    /// Product of the radices of the previous stages.
    s: usize,
    /// Twiddle factors e^{−i2πpk/(R·m)}, R of them for each p.
    twiddles: Vec<Complex<T>>,
}

impl<T: Number> BatchFft<T> {
    /// Plans transforms of columns of `n` samples. `columns` must be a multiple of 16, the largest number of lanes of a
    /// register.
    pub(crate) fn new(n: usize, columns: usize) -> Self {
        let plan = match factors(n) {
            Some(radices) => Plan::Stages(stages(n, &radices)),
            None => Plan::ColumnByColumn(FftPlanner::new().plan_fft_forward(n)),
        };
        Self { columns, plan }
    }

    /// Transforms `tile` without scaling and multiplies it by `factors` if they are given; overwrites `spare`.
    #[inline(always)]
    pub(crate) fn forward<S: Simd>(
        &self,
        simd: S,
        tile: &mut Planes<T>,
        spare: &mut Planes<T>,
        factors: Option<Factors<'_, T>>,
    ) {
        let registers = self.columns / T::lanes::<S>();
        match &self.plan {
            Plan::Stages(stages) if !stages.is_empty() => {
                let (last, stages) = stages.split_last().expect("the list of stages is not empty");
                for stage in stages {
                    simd.vectorize(Run { stage, registers, from: tile, to: spare });
                    std::mem::swap(tile, spare);
                }
                match factors {
                    None => simd.vectorize(Run { stage: last, registers, from: tile, to: spare }),
                    Some(factors) => {
                        simd.vectorize(RunLast { stage: last, registers, from: tile, to: spare, factors });
                    }
                }
                std::mem::swap(tile, spare);
            }
            Plan::Stages(_) => factors.into_iter().for_each(|factors| factors.apply(simd, tile)),
            Plan::ColumnByColumn(fft) => {
                column_by_column(&**fft, self.columns, tile);
                factors.into_iter().for_each(|factors| factors.apply(simd, tile));
            }
        }
    }

    /// Applies the inverse of [`Self::forward`], times n; overwrites `spare`.
    #[inline(always)]
    pub(crate) fn inverse<S: Simd>(&self, simd: S, tile: &mut Planes<T>, spare: &mut Planes<T>) {
        tile.swap_parts();
        self.forward(simd, tile, spare, None);
        tile.swap_parts();
    }
}

/// Runs a stage in a separate function, so that the butterflies are compiled only once.
struct Run<'a, T> {
    stage: &'a Stage<T>,
    registers: usize,
    from: &'a Planes<T>,
    to: &'a mut Planes<T>,
}

impl<T: Number> WithSimd for Run<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { stage, registers, from, to } = self;
        match stage.radix {
            2 => stage.run::<S, Butterfly2, 2>(simd, registers, from, to),
            3 => stage.run::<S, Butterfly3, 3>(simd, registers, from, to),
            4 => stage.run::<S, Butterfly4, 4>(simd, registers, from, to),
            5 => stage.run::<S, Butterfly5, 5>(simd, registers, from, to),
            6 => stage.run::<S, Butterfly6, 6>(simd, registers, from, to),
            8 => stage.run::<S, Butterfly8, 8>(simd, registers, from, to),
            9 => stage.run::<S, Butterfly9, 9>(simd, registers, from, to),
            10 => stage.run::<S, Butterfly10, 10>(simd, registers, from, to),
            12 => stage.run::<S, Butterfly12, 12>(simd, registers, from, to),
            radix => unreachable!("a stage of radix {radix}"),
        }
    }
}

/// Runs the last stage and multiplies its results by `factors`.
struct RunLast<'a, T> {
    stage: &'a Stage<T>,
    registers: usize,
    from: &'a Planes<T>,
    to: &'a mut Planes<T>,
    factors: Factors<'a, T>,
}

impl<T: Number> WithSimd for RunLast<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { stage, registers, from, to, factors } = self;
        match stage.radix {
            2 => stage.run_last::<S, Butterfly2, 2>(simd, registers, from, to, factors),
            3 => stage.run_last::<S, Butterfly3, 3>(simd, registers, from, to, factors),
            4 => stage.run_last::<S, Butterfly4, 4>(simd, registers, from, to, factors),
            5 => stage.run_last::<S, Butterfly5, 5>(simd, registers, from, to, factors),
            6 => stage.run_last::<S, Butterfly6, 6>(simd, registers, from, to, factors),
            8 => stage.run_last::<S, Butterfly8, 8>(simd, registers, from, to, factors),
            9 => stage.run_last::<S, Butterfly9, 9>(simd, registers, from, to, factors),
            10 => stage.run_last::<S, Butterfly10, 10>(simd, registers, from, to, factors),
            12 => stage.run_last::<S, Butterfly12, 12>(simd, registers, from, to, factors),
            radix => unreachable!("a stage of radix {radix}"),
        }
    }
}

impl<T: Number> Stage<T> {
    #[inline(always)]
    fn run<S: Simd, B: StageOf<R>, const R: usize>(
        &self,
        simd: S,
        registers: usize,
        from: &Planes<T>,
        to: &mut Planes<T>,
    ) {
        let (m, s) = (self.m, self.s * registers);
        let (from_re, from_im) = (&T::vectors::<S>(&from.re)[..R * m * s], &T::vectors::<S>(&from.im)[..R * m * s]);
        let to_re = T::vectors_mut::<S>(&mut to.re).chunks_exact_mut(R * s);
        let to_im = T::vectors_mut::<S>(&mut to.im).chunks_exact_mut(R * s);
        for (p, ((twiddles, to_re), to_im)) in self.twiddles.chunks_exact(R).zip(to_re).zip(to_im).enumerate() {
            for q in 0..s {
                let y = B::transform(B::gather(simd, [from_re, from_im], p * s + q, m * s));
                let twiddles = (m > 1).then_some(twiddles);
                B::scatter(simd, y, twiddles, [&mut *to_re, &mut *to_im], q, s);
            }
        }
    }

    #[inline(always)]
    fn run_last<S: Simd, B: StageOf<R>, const R: usize>(
        &self,
        simd: S,
        registers: usize,
        from: &Planes<T>,
        to: &mut Planes<T>,
        factors: Factors<'_, T>,
    ) {
        let s = self.s * registers;
        let (from_re, from_im) = (&T::vectors::<S>(&from.re)[..R * s], &T::vectors::<S>(&from.im)[..R * s]);
        let to_re = &mut T::vectors_mut::<S>(&mut to.re)[..R * s];
        let to_im = &mut T::vectors_mut::<S>(&mut to.im)[..R * s];
        for q in 0..s {
            let y = B::transform(B::gather(simd, [from_re, from_im], q, s));
            B::scatter_times(simd, y, factors, [&mut *to_re, &mut *to_im], q, s);
        }
    }
}

fn column_by_column<T: Number>(fft: &dyn Fft<T>, columns: usize, tile: &mut Planes<T>) {
    let mut column = vec![Complex::new(T::zero(), T::zero()); fft.len()];
    for k in 0..columns {
        let parts = tile.re[k..].iter().step_by(columns).zip(tile.im[k..].iter().step_by(columns));
        for (value, (&re, &im)) in column.iter_mut().zip(parts) {
            *value = Complex::new(re, im);
        }
        fft.process(&mut column);
        let parts = tile.re[k..].iter_mut().step_by(columns).zip(tile.im[k..].iter_mut().step_by(columns));
        for (value, (re, im)) in column.iter().zip(parts) {
            (*re, *im) = (value.re, value.im);
        }
    }
}

/// Factors of n among [`RADICES`], the largest first; `None` if n has other prime factors.
fn factors(n: usize) -> Option<Vec<usize>> {
    let (mut left, mut found) = (n, Vec::new());
    while let Some(&radix) = RADICES.iter().find(|&radix| left % radix == 0) {
        found.push(radix);
        left /= radix;
    }
    (left == 1).then_some(found)
}

fn stages<T: Number>(n: usize, radices: &[usize]) -> Vec<Stage<T>> {
    let (mut length, mut s) = (n, 1);
    let mut stages = Vec::new();
    for &radix in radices {
        let m = length / radix;
        let turn = |p: usize, k: usize| unit_of(-TAU * (p * k) as f64 / length as f64);
        let twiddles = (0..m).flat_map(|p| (0..radix).map(move |k| turn(p, k))).collect();
        stages.push(Stage { radix, m, s, twiddles });
        (length, s) = (m, s * radix);
    }
    stages
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::Complex64;
    use pulp::Arch;

    const COLUMNS: usize = 16;

    struct Transform<'a, T> {
        fft: &'a BatchFft<T>,
        tile: &'a mut Planes<T>,
        spare: &'a mut Planes<T>,
        inverse: bool,
    }

    impl<T: Number> WithSimd for Transform<'_, T> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            let Self { fft, tile, spare, inverse } = self;
            if inverse { fft.inverse(simd, tile, spare) } else { fft.forward(simd, tile, spare, None) }
        }
    }

    fn check<T: Number>(n: usize, bound: f64) {
        let fft = BatchFft::<T>::new(n, COLUMNS);
        let noise = |i: usize, by: usize| T::of(((i * by) % 1009) as f64 / 504.5 - 1.0);
        let garbage = vec![T::of(f64::NAN); n * COLUMNS];
        let re: Vec<T> = (0..n * COLUMNS).map(|i| noise(i, 7919)).collect();
        let im: Vec<T> = (0..n * COLUMNS).map(|i| noise(i, 104_729)).collect();
        for inverse in [false, true] {
            let mut tile = Planes { re: re.clone(), im: im.clone() };
            let mut spare = Planes { re: garbage.clone(), im: garbage.clone() };
            Arch::new().dispatch(Transform { fft: &fft, tile: &mut tile, spare: &mut spare, inverse });
            let (mut error, mut energy) = (0.0, 0.0);
            for column in [0, 1, COLUMNS - 1] {
                for k in 0..n {
                    let turn = if inverse { TAU } else { -TAU } / n as f64;
                    let term = |j: usize| {
                        let at = j * COLUMNS + column;
                        Complex64::new(re[at].wide(), im[at].wide()) * Complex64::cis(turn * ((j * k) % n) as f64)
                    };
                    let expected: Complex64 = (0..n).map(term).sum();
                    let at = k * COLUMNS + column;
                    error += (Complex64::new(tile.re[at].wide(), tile.im[at].wide()) - expected).norm_sqr();
                    energy += expected.norm_sqr();
                }
            }
            let error = (error / energy).sqrt();
            assert!(error < bound, "n = {n}, inverse {inverse}: {error:e}");
        }
    }

    // The lengths cover every radix, every pair of radices, and lengths that rustfft transforms.
    #[test]
    fn transform_matches_direct_sum() {
        for n in (1..=60).chain([64, 72, 81, 96, 100, 108, 120, 125, 131, 144, 270, 360, 540]) {
            check::<f32>(n, 5e-7);
            check::<f64>(n, 1e-14);
        }
    }

    #[test]
    fn common_display_sizes_need_few_stages() {
        for (n, most) in [(1080, 3), (2160, 4), (1200, 3), (1024, 4), (768, 3), (1536, 4), (2400, 4), (600, 3)] {
            let radices = factors(n).unwrap();
            assert_eq!(radices.iter().product::<usize>(), n);
            assert!(radices.len() <= most, "{n}: {radices:?}");
        }
        assert_eq!(factors(7), None);
        assert_eq!(factors(1), Some(vec![]));
    }
}
