//! Two-dimensional arrays of values.

use crate::error::{Error, Result};
use crate::interrupt;
use serde::{Deserialize, Serialize};

/// Two-dimensional array in row-major order, `values[y · width_px + x]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Unchecked<T>", bound(deserialize = "T: Copy + Deserialize<'de>"))]
pub struct Plane<T> {
    height_px: usize,
    width_px: usize,
    values: Vec<T>,
}

/// Stored form of a plane, in which the number of values may be wrong.
#[derive(Deserialize)]
struct Unchecked<T> {
    height_px: usize,
    width_px: usize,
    values: Vec<T>,
}

impl<T: Copy> TryFrom<Unchecked<T>> for Plane<T> {
    type Error = Error;

    fn try_from(stored: Unchecked<T>) -> Result<Self> {
        Self::try_from_vec(stored.height_px, stored.width_px, stored.values)
    }
}

impl<T: Copy> Plane<T> {
    /// Plane with the same value at every pixel.
    #[must_use]
    pub fn filled(height_px: usize, width_px: usize, value: T) -> Self {
        Self { height_px, width_px, values: vec![value; height_px * width_px] }
    }

    /// Plane with the value `f(y, x)` at every pixel.
    #[must_use]
    pub fn from_fn(height_px: usize, width_px: usize, mut f: impl FnMut(usize, usize) -> T) -> Self {
        let mut values = Vec::with_capacity(height_px * width_px);
        for y in 0..height_px {
            interrupt::check();
            values.extend((0..width_px).map(|x| f(y, x)));
        }
        Self { height_px, width_px, values }
    }

    /// Plane of `values`, given row by row.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`] if the number of values is not `height_px · width_px`.
    pub fn try_from_vec(height_px: usize, width_px: usize, values: Vec<T>) -> Result<Self> {
        if Some(values.len()) != height_px.checked_mul(width_px) {
            return Err(Error::SizeMismatch {
                name: "values",
                width_px,
                height_px,
                actual_width_px: values.len(),
                actual_height_px: 1,
            });
        }
        Ok(Self { height_px, width_px, values })
    }

    /// Number of rows \[px\].
    #[must_use]
    pub fn height_px(&self) -> usize {
        self.height_px
    }

    /// Number of columns \[px\].
    #[must_use]
    pub fn width_px(&self) -> usize {
        self.width_px
    }

    /// All values, row by row.
    #[must_use]
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// All values, row by row, for writing.
    pub fn values_mut(&mut self) -> &mut [T] {
        &mut self.values
    }

    /// Converts the plane to its values, row by row.
    #[must_use]
    pub fn into_vec(self) -> Vec<T> {
        self.values
    }

    /// Values of row `y`.
    #[must_use]
    pub fn row(&self, y: usize) -> &[T] {
        &self.values[y * self.width_px..][..self.width_px]
    }

    /// Value at row `y` and column `x`.
    #[must_use]
    pub fn at(&self, y: usize, x: usize) -> T {
        self.values[y * self.width_px + x]
    }

    /// Plane of the same size with `f` applied to every value.
    #[must_use]
    pub fn map<U: Copy>(&self, mut f: impl FnMut(T) -> U) -> Plane<U> {
        let mut values = Vec::with_capacity(self.values.len());
        for row in self.values.chunks(self.width_px.max(1)) {
            interrupt::check();
            values.extend(row.iter().map(|&value| f(value)));
        }
        Plane { height_px: self.height_px, width_px: self.width_px, values }
    }

    /// Checks that the plane has `height_px` × `width_px` values.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`] for another size; the error calls this plane `name`.
    pub fn expect_size(&self, name: &'static str, height_px: usize, width_px: usize) -> Result<()> {
        if (self.height_px, self.width_px) == (height_px, width_px) {
            return Ok(());
        }
        Err(Error::SizeMismatch {
            name,
            width_px,
            height_px,
            actual_width_px: self.width_px,
            actual_height_px: self.height_px,
        })
    }
}

impl Plane<f32> {
    /// Checks that all values are finite.
    ///
    /// # Errors
    ///
    /// [`Error::NotFinite`] for the first NaN or infinity; the error calls this plane `name`.
    pub fn expect_finite(&self, name: &'static str) -> Result<()> {
        match self.values.iter().position(|value| !value.is_finite()) {
            None => Ok(()),
            Some(i) => Err(Error::NotFinite { name, x_px: i % self.width_px, y_px: i / self.width_px }),
        }
    }
}
