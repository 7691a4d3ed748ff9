//! Real and complex numbers in vector registers, generic over the precision and the width of the registers.
//!
//! The crate pulp has separate operations for each precision. The generic types of this module allow code to be written
//! once for both. All functions are inlined into the operation that pulp dispatches; otherwise they would not be
//! compiled for the machine's vector instructions.

use crate::numerics::real::{Number, Vectors};
use num_complex::Complex;
use pulp::Simd;
use std::ops::{Add, Mul, Neg, Sub};

/// One register of real numbers.
#[derive(Clone, Copy)]
pub(crate) struct Lanes<T: Vectors, S: Simd> {
    simd: S,
    pub(crate) vector: T::Vector<S>,
}

impl<T: Vectors, S: Simd> Lanes<T, S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, vector: T::Vector<S>) -> Self {
        Self { simd, vector }
    }

    #[inline(always)]
    pub(crate) fn splat(simd: S, value: T) -> Self {
        Self { simd, vector: T::splat(simd, value) }
    }

    /// self · by + plus, rounded only once if the machine supports it.
    #[inline(always)]
    fn mul_add(self, by: Self, plus: Self) -> Self {
        Self { simd: self.simd, vector: T::mul_add(self.simd, self.vector, by.vector, plus.vector) }
    }
}

impl<T: Vectors, S: Simd> Add for Lanes<T, S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { simd: self.simd, vector: T::add(self.simd, self.vector, other.vector) }
    }
}

impl<T: Vectors, S: Simd> Sub for Lanes<T, S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { simd: self.simd, vector: T::sub(self.simd, self.vector, other.vector) }
    }
}

impl<T: Vectors, S: Simd> Mul for Lanes<T, S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self { simd: self.simd, vector: T::mul(self.simd, self.vector, other.vector) }
    }
}

impl<T: Vectors, S: Simd> Neg for Lanes<T, S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self { simd: self.simd, vector: T::neg(self.simd, self.vector) }
    }
}

/// Complex numbers in two registers, one for the real parts and one for the imaginary parts.
#[derive(Clone, Copy)]
pub(crate) struct ComplexLanes<T: Vectors, S: Simd> {
    pub(crate) re: Lanes<T, S>,
    pub(crate) im: Lanes<T, S>,
}

impl<T: Vectors, S: Simd> ComplexLanes<T, S> {
    #[inline(always)]
    pub(crate) fn new(simd: S, re: T::Vector<S>, im: T::Vector<S>) -> Self {
        Self { re: Lanes::new(simd, re), im: Lanes::new(simd, im) }
    }

    /// Registers with the same number in every lane.
    #[inline(always)]
    pub(crate) fn splat(simd: S, value: Complex<T>) -> Self {
        Self { re: Lanes::splat(simd, value.re), im: Lanes::splat(simd, value.im) }
    }

    #[inline(always)]
    pub(crate) fn conj(self) -> Self {
        Self { re: self.re, im: -self.im }
    }

    /// Returns −i · self.
    #[inline(always)]
    pub(super) fn times_minus_i(self) -> Self {
        Self { re: self.im, im: -self.re }
    }
}

impl<T: Number, S: Simd> ComplexLanes<T, S> {
    #[inline(always)]
    pub(super) fn scaled(self, by: f64) -> Self {
        let by = Lanes::splat(self.re.simd, T::of(by));
        Self { re: self.re * by, im: self.im * by }
    }

    /// Returns by · self + plus.
    #[inline(always)]
    pub(super) fn scaled_plus(self, by: f64, plus: Self) -> Self {
        let by = Lanes::splat(self.re.simd, T::of(by));
        Self { re: self.re.mul_add(by, plus.re), im: self.im.mul_add(by, plus.im) }
    }

    /// Returns e^{−i2π·cycles} · self.
    #[inline(always)]
    pub(super) fn rotated(self, cycles: f64) -> Self {
        let (sine, cosine) = (-std::f64::consts::TAU * cycles).sin_cos();
        self * Self::splat(self.re.simd, Complex::new(T::of(cosine), T::of(sine)))
    }
}

impl<T: Vectors, S: Simd> Add for ComplexLanes<T, S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }
}

impl<T: Vectors, S: Simd> Sub for ComplexLanes<T, S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { re: self.re - other.re, im: self.im - other.im }
    }
}

impl<T: Vectors, S: Simd> Mul for ComplexLanes<T, S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self { re: self.re.mul_add(other.re, -(self.im * other.im)), im: self.re.mul_add(other.im, self.im * other.re) }
    }
}
