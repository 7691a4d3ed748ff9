//! Two-dimensional arrays.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};

/// A row-major array, `values[y · width_px + x]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Unchecked<T>", bound(deserialize = "T: Copy + Deserialize<'de>"))]
pub struct Plane<T> {
    height_px: usize,
    width_px: usize,
    values: Vec<T>,
}

/// A plane as it is stored: the number of its values may be wrong.
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
    /// A plane with the same value everywhere.
    #[must_use]
    pub fn filled(height_px: usize, width_px: usize, value: T) -> Self {
        Self { height_px, width_px, values: vec![value; height_px * width_px] }
    }

    /// The value of `f(y, x)` at every pixel.
    #[must_use]
    pub fn from_fn(height_px: usize, width_px: usize, mut f: impl FnMut(usize, usize) -> T) -> Self {
        let values = (0..height_px * width_px).map(|i| f(i / width_px, i % width_px)).collect();
        Self { height_px, width_px, values }
    }

    /// Takes over `values`.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`] when there are not `height_px · width_px` values.
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

    /// Rows.
    #[must_use]
    pub fn height_px(&self) -> usize {
        self.height_px
    }

    /// Columns.
    #[must_use]
    pub fn width_px(&self) -> usize {
        self.width_px
    }

    /// All values, row after row.
    #[must_use]
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// All values, row after row.
    pub fn values_mut(&mut self) -> &mut [T] {
        &mut self.values
    }

    /// Gives up the array.
    #[must_use]
    pub fn into_vec(self) -> Vec<T> {
        self.values
    }

    /// One row.
    #[must_use]
    pub fn row(&self, y: usize) -> &[T] {
        &self.values[y * self.width_px..][..self.width_px]
    }

    /// One value.
    #[must_use]
    pub fn at(&self, y: usize, x: usize) -> T {
        self.values[y * self.width_px + x]
    }

    /// The same plane with `f` applied to every value.
    #[must_use]
    pub fn map<U: Copy>(&self, f: impl FnMut(T) -> U) -> Plane<U> {
        Plane {
            height_px: self.height_px,
            width_px: self.width_px,
            values: self.values.iter().copied().map(f).collect(),
        }
    }

    /// # Errors
    ///
    /// [`Error::SizeMismatch`], naming this plane `name`, when it is not `height_px` × `width_px`.
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
    /// # Errors
    ///
    /// [`Error::NotFinite`], naming this plane `name`, at the first NaN or infinity.
    pub fn expect_finite(&self, name: &'static str) -> Result<()> {
        match self.values.iter().position(|value| !value.is_finite()) {
            None => Ok(()),
            Some(i) => Err(Error::NotFinite { name, x_px: i % self.width_px, y_px: i / self.width_px }),
        }
    }
}
