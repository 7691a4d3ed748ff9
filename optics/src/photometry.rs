//! Comparing light with a wanted or photographed picture.
//!
//! ```text
//! e = s·p + o − t,   L = Σ w e² / Σ w,   g = ∂L/∂u* = 2 w s e u / (n Σ w)
//! ```
//!
//! p the detector's light, t the picture, s gain, o offset, w 1 in the region of interest (0 at masked pixels), u the field
//! at each of the n sub-samples. With the detector `Supersampled` every sub-sample has its own p and e.

use crate::convolution::{Convolver, Scratch};
use crate::detector::Detector;
use crate::plane::Plane;
use crate::real::Real;
use crate::region::RegionOfInterest;
use num_complex::Complex;
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use std::ops::Range;

/// Weighted sums over pixels, in f64, from which loss, gain and offset follow.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// Σ w
    pub w: f64,
    /// Σ w p
    pub p: f64,
    /// Σ w p²
    pub pp: f64,
    /// Σ w t
    pub t: f64,
    /// Σ w t p
    pub tp: f64,
    /// Σ w t²
    pub tt: f64,
    /// Σ w e²
    pub ee: f64,
    /// Σ w e
    pub e: f64,
    /// Σ w e p
    pub ep: f64,
}

impl Sums {
    /// L at the gain and offset that the light was compared with.
    #[must_use]
    pub fn loss(&self) -> f64 {
        self.ee / self.w
    }

    /// The gain that fits best, without an offset: Σ t p / Σ p². 0 where there is no light.
    #[must_use]
    pub fn best_gain(&self) -> f64 {
        if self.pp > 0.0 { self.tp / self.pp } else { 0.0 }
    }

    /// L at [`Self::best_gain`].
    #[must_use]
    pub fn best_loss(&self) -> f64 {
        ((self.tt - self.best_gain() * self.tp) / self.w).max(0.0)
    }

    /// The gain and offset that fit best together.
    #[must_use]
    pub fn best_gain_and_offset(&self) -> (f64, f64) {
        let spread = self.pp - self.p * self.p / self.w;
        if spread <= f64::EPSILON * self.pp {
            return (self.best_gain(), 0.0);
        }
        let gain = (self.tp - self.t * self.p / self.w) / spread;
        (gain, (self.t - gain * self.p) / self.w)
    }

    /// Adds another's sums.
    pub fn add(&mut self, other: &Self) {
        self.w += other.w;
        self.p += other.p;
        self.pp += other.pp;
        self.t += other.t;
        self.tp += other.tp;
        self.tt += other.tt;
        self.ee += other.ee;
        self.e += other.e;
        self.ep += other.ep;
    }
}

/// The picture that light is compared with.
#[derive(Clone, Debug)]
pub(crate) struct Comparison<'a, T> {
    pub(crate) picture: &'a Plane<T>,
    /// 1 or 0 for each pixel; `None`: all count.
    pub(crate) weight: Option<&'a Plane<T>>,
    pub(crate) region: RegionOfInterest,
    pub(crate) detector: Detector,
    pub(crate) gain: f64,
    pub(crate) offset: f64,
    /// What the gradient is divided by: the Σ w that the loss will be divided by.
    pub(crate) weight_sum: f64,
}

impl<T: Real> Convolver<T> {
    /// Compares the light in `tiles` with a picture and writes the half-transformed gradient to `spectrum` (all offsets).
    pub(crate) fn compare(
        &self,
        tiles: &[Complex<T>],
        comparison: &Comparison<'_, T>,
        spectrum: &mut [Complex<T>],
    ) -> Sums {
        let arch = Arch::new();
        let row_len = self.lanes() * self.row_len();
        let rows = spectrum.par_chunks_mut(row_len).enumerate().map_init(
            || self.scratch.take(),
            |scratch, (y, out)| {
                let Some(columns) = comparison.region.columns(y) else {
                    out.fill(Complex::new(T::zero(), T::zero()));
                    return Sums::default();
                };
                self.sample_row(arch, tiles, y, scratch);
                let Scratch { samples, reals: [light, error], .. } = &mut **scratch;
                let sums = arch.dispatch(GradientRow { comparison, y, columns, samples, light, error });
                self.sample_row_adjoint(arch, scratch, out);
                sums
            },
        );
        total(&rows.collect::<Vec<_>>())
    }

    /// The sums of [`Self::compare`] alone.
    pub(crate) fn measure(&self, tiles: &[Complex<T>], comparison: &Comparison<'_, T>) -> Sums {
        let arch = Arch::new();
        let rows = (0..self.height_px).into_par_iter().map_init(
            || self.scratch.take(),
            |scratch, y| {
                let Some(columns) = comparison.region.columns(y) else { return Sums::default() };
                self.sample_row(arch, tiles, y, scratch);
                let Scratch { samples, reals: [light, error], .. } = &mut **scratch;
                arch.dispatch(GradientRow { comparison, y, columns, samples, light, error })
            },
        );
        total(&rows.collect::<Vec<_>>())
    }

    /// The light at each pixel, the mean over the sub-samples.
    pub(crate) fn light(&self, tiles: &[Complex<T>], light: &mut [T]) {
        let arch = Arch::new();
        light.par_chunks_mut(self.width_px).enumerate().for_each_init(
            || self.scratch.take(),
            |scratch, (y, out)| {
                self.sample_row(arch, tiles, y, scratch);
                arch.dispatch(|| mean_light(&scratch.samples, self.width_px, 0..self.width_px, out));
            },
        );
    }
}

/// [`Comparison::gradient_row`] as an operation that is compiled for the vector instructions of the machine at hand.
struct GradientRow<'a, 'b, T> {
    comparison: &'a Comparison<'b, T>,
    y: usize,
    columns: Range<usize>,
    samples: &'a mut [Complex<T>],
    light: &'a mut [T],
    error: &'a mut [T],
}

impl<T: Real> WithSimd for GradientRow<'_, '_, T> {
    type Output = Sums;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Sums {
        self.comparison.gradient_row(self.y, self.columns, self.samples, self.light, self.error)
    }
}

/// In the order of the rows, whoever computed them.
fn total(rows: &[Sums]) -> Sums {
    rows.iter().fold(Sums::default(), |mut sum, row| {
        sum.add(row);
        sum
    })
}

impl<T: Real> Comparison<'_, T> {
    /// Turns the sub-samples of row `y` into their gradient; zero outside `columns`.
    #[inline(always)]
    fn gradient_row(
        &self,
        y: usize,
        columns: Range<usize>,
        samples: &mut [Complex<T>],
        light: &mut [T],
        error: &mut [T],
    ) -> Sums {
        let width_px = self.picture.width_px();
        let sample_rows = samples.len() / width_px;
        let factor = T::of(2.0 * self.gain / (sample_rows as f64 * self.weight_sum));
        let mut sums = Sums::default();
        if self.detector != Detector::Supersampled {
            mean_light(samples, width_px, columns.clone(), light);
            sums = self.errors(y, columns.clone(), light, error);
        }
        for row in samples.chunks_exact_mut(width_px) {
            if self.detector == Detector::Supersampled {
                for (light, u) in light[columns.clone()].iter_mut().zip(&row[columns.clone()]) {
                    *light = u.norm_sqr();
                }
                sums.add(&self.errors(y, columns.clone(), light, error));
            }
            row[..columns.start].fill(Complex::new(T::zero(), T::zero()));
            row[columns.end..].fill(Complex::new(T::zero(), T::zero()));
            for (u, &error) in row[columns.clone()].iter_mut().zip(&error[columns.clone()]) {
                *u = u.scale(error * factor);
            }
        }
        if self.detector == Detector::Supersampled {
            sums.divide(sample_rows as f64);
        }
        sums
    }

    /// Writes w·e along the columns and sums up.
    #[inline(always)]
    fn errors(&self, y: usize, columns: Range<usize>, light: &[T], error: &mut [T]) -> Sums {
        let (gain, offset) = (T::of(self.gain), T::of(self.offset));
        let picture = &self.picture.row(y)[columns.clone()];
        let (light, error) = (&light[columns.clone()], &mut error[columns.clone()]);
        for ((error, &p), &t) in error.iter_mut().zip(light).zip(picture) {
            *error = gain * p + offset - t;
        }
        match self.weight {
            None => sum_row(light, picture, error, |_| T::one()),
            Some(weight) => {
                let weight = &weight.row(y)[columns];
                for (error, &w) in error.iter_mut().zip(weight) {
                    *error = *error * w;
                }
                sum_row(light, picture, error, |i| weight[i])
            }
        }
    }
}

impl Sums {
    fn divide(&mut self, by: f64) {
        for sum in [
            &mut self.w,
            &mut self.p,
            &mut self.pp,
            &mut self.t,
            &mut self.tp,
            &mut self.tt,
            &mut self.ee,
            &mut self.e,
            &mut self.ep,
        ] {
            *sum /= by;
        }
    }
}

/// Independent sums side by side, so that the additions become vector instructions in an order that is fixed.
const LANES: usize = 8;

#[inline(always)]
fn sum_row<T: Real>(light: &[T], picture: &[T], error: &[T], weight: impl Fn(usize) -> T) -> Sums {
    let mut lanes = [[0.0_f64; LANES]; 9];
    let mut add = |lane: usize, i: usize| {
        let (w, p, t, e) = (weight(i).wide(), light[i].wide(), picture[i].wide(), error[i].wide());
        for (sum, value) in lanes.iter_mut().zip([w, w * p, w * p * p, w * t, w * t * p, w * t * t, e * e, e, e * p]) {
            sum[lane] += value;
        }
    };
    let whole = light.len() / LANES * LANES;
    for start in (0..whole).step_by(LANES) {
        for lane in 0..LANES {
            add(lane, start + lane);
        }
    }
    for i in whole..light.len() {
        add(i - whole, i);
    }
    let [w, p, pp, t, tp, tt, ee, e, ep] = lanes.map(|lane| lane.iter().sum());
    Sums { w, p, pp, t, tp, tt, ee, e, ep }
}

#[inline(always)]
fn mean_light<T: Real>(samples: &[Complex<T>], width_px: usize, columns: Range<usize>, light: &mut [T]) {
    let share = T::of(width_px as f64 / samples.len() as f64);
    let light = &mut light[columns.clone()];
    for (i, row) in samples.chunks_exact(width_px).enumerate() {
        let row = &row[columns.clone()];
        if i == 0 {
            for (light, u) in light.iter_mut().zip(row) {
                *light = u.norm_sqr() * share;
            }
        } else {
            for (light, u) in light.iter_mut().zip(row) {
                *light = *light + u.norm_sqr() * share;
            }
        }
    }
}
