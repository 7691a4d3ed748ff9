//! A tile of columns as real and imaginary parts, and factors of its values.

use super::lanes::ComplexLanes;
use crate::numerics::real::Number;
use num_complex::Complex;
use pulp::Simd;

/// Real and imaginary parts of a tile, `n · columns` values each.
#[derive(Debug)]
pub(crate) struct Planes<T> {
    pub(crate) re: Vec<T>,
    pub(crate) im: Vec<T>,
}

impl<T: Number> Planes<T> {
    pub(crate) fn zeros(len: usize) -> Self {
        Self { re: vec![T::zero(); len], im: vec![T::zero(); len] }
    }

    /// Replaces every value by i · conj(value). Applied before and after a transform, this gives the inverse transform.
    pub(super) fn swap_parts(&mut self) {
        std::mem::swap(&mut self.re, &mut self.im);
    }
}

/// Factors of the values of a tile, in the order of the tile.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Factors<'a, T> {
    pub(crate) values: &'a [Complex<T>],
    /// Whether to multiply by the complex conjugates instead.
    pub(crate) conjugate: bool,
}

impl<T: Number> Factors<'_, T> {
    /// Factors for register `at` of the tile.
    #[inline(always)]
    pub(crate) fn factor<S: Simd>(self, simd: S, at: usize) -> ComplexLanes<T, S> {
        let [re, im] = T::parts(simd, T::interleaved::<S>(self.values)[at]);
        let factor = ComplexLanes::new(simd, re, im);
        if self.conjugate { factor.conj() } else { factor }
    }

    #[inline(always)]
    pub(crate) fn apply<S: Simd>(self, simd: S, tile: &mut Planes<T>) {
        let parts = T::vectors_mut::<S>(&mut tile.re).iter_mut().zip(T::vectors_mut::<S>(&mut tile.im));
        for (at, (re, im)) in parts.enumerate() {
            let value = ComplexLanes::new(simd, *re, *im) * self.factor(simd, at);
            (*re, *im) = (value.re.vector, value.im.vector);
        }
    }
}
