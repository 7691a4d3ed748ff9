//! What is stored of a display model: entries of a header, and arrays of numbers.
//!
//! The row of each part writes the part's own, and reads them back ([`Part::store`](super::Part::store),
//! [`Part::restore`](super::Part::restore)). How entries and arrays become a file is the matter of its form: the native
//! form is described in `server/media/src/kernel_file.rs`, with all entries and arrays.

use super::{ModelPart, STORED};
use crate::display::{DisplayModel, OpticalSetup};
use crate::numerics::{Plane, SmoothField};
use num_complex::Complex32;
use serde::{Deserialize, Serialize};

/// The array with gain and offset of the camera, which belong to no part, and the undiffracted light after them.
pub(super) const PHOTOMETRY: &str = "photometry";

/// The value of an entry of the header.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Entry {
    /// Whether the display has a part.
    Flag(bool),
    /// Highest total degree of a series.
    Order(usize),
    /// Highest total degree of each of several series.
    Orders(Vec<usize>),
}

/// The numbers of an array, in C order.
#[derive(Clone, Debug, PartialEq)]
#[expect(missing_docs, reason = "the names are those of the types")]
pub enum Numbers {
    F64(Vec<f64>),
    F32(Vec<f32>),
    I16(Vec<i16>),
}

/// A named array.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredArray {
    /// Name, unique in a model.
    pub name: &'static str,
    /// Number of numbers along each axis.
    pub shape: Vec<usize>,
    /// The numbers.
    pub numbers: Numbers,
}

/// The entries and arrays of a model, or of a part of one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stored {
    always: Vec<(&'static str, Entry)>,
    sometimes: Vec<(&'static str, Entry)>,
    arrays: Vec<StoredArray>,
}

impl Stored {
    /// All that is stored of a model, besides its setup.
    #[must_use]
    pub fn of(model: &DisplayModel) -> Self {
        let mut stored = Self::default();
        stored.append(PHOTOMETRY, &[model.gain, model.offset]);
        STORED.into_iter().for_each(|part| part.row().store(model, &mut stored));
        stored
    }

    /// What is stored of one part of a model.
    pub(super) fn of_part(part: ModelPart, model: &DisplayModel) -> Self {
        let mut stored = Self::default();
        part.row().store(model, &mut stored);
        stored
    }

    /// The entries of the header: first those that all models have, then those that only some have.
    pub fn entries(&self) -> impl Iterator<Item = &(&'static str, Entry)> {
        self.always.iter().chain(&self.sometimes)
    }

    /// The arrays.
    #[must_use]
    pub fn into_arrays(self) -> Vec<StoredArray> {
        self.arrays
    }

    /// Adds an entry that all models have.
    pub(super) fn always(&mut self, key: &'static str, value: Entry) {
        self.always.push((key, value));
    }

    /// Adds an entry that only models with the part have.
    pub(super) fn sometimes(&mut self, key: &'static str, value: Entry) {
        self.sometimes.push((key, value));
    }

    pub(super) fn array(&mut self, name: &'static str, shape: &[usize], numbers: Numbers) {
        self.arrays.push(StoredArray { name, shape: shape.to_vec(), numbers });
    }

    /// Adds an array of one axis.
    pub(super) fn list(&mut self, name: &'static str, numbers: &[f64]) {
        self.array(name, &[numbers.len()], Numbers::F64(numbers.to_vec()));
    }

    /// Adds numbers to an array of one axis, which need not exist.
    pub(super) fn append(&mut self, name: &'static str, more: &[f64]) {
        match self.arrays.iter_mut().find(|array| array.name == name) {
            Some(StoredArray { shape, numbers: Numbers::F64(numbers), .. }) => {
                numbers.extend(more);
                *shape = vec![numbers.len()];
            }
            _ => self.list(name, more),
        }
    }

    /// Adds an array with the logarithms of the amplitudes of some fields and one with their phases, each field after
    /// the other. `axes` are the sides of both arrays before the coefficients.
    pub(super) fn fields<'a>(
        &mut self,
        [log_amplitude, phase]: [&'static str; 2],
        axes: &[usize],
        fields: impl Iterator<Item = &'a SmoothField> + Clone,
    ) {
        let mut add = |name, of: fn(&SmoothField) -> &[f64]| {
            let numbers: Vec<f64> = fields.clone().flat_map(of).copied().collect();
            let shape = [axes, &[numbers.len() / axes.iter().product::<usize>()]].concat();
            self.array(name, &shape, Numbers::F64(numbers));
        };
        add(log_amplitude, |field| &field.log_amplitude);
        add(phase, |field| &field.phase);
    }
}

/// Reason why a part could not be read.
#[derive(Debug, thiserror::Error)]
pub enum StoredError {
    /// The header lacks an entry that all models have.
    #[error("the header has no entry `{key}`")]
    NoEntry {
        /// Key of the entry.
        key: &'static str,
    },
    /// An entry has a value of another type.
    #[error("the header's entry `{key}` must be {expected}")]
    Entry {
        /// Key of the entry.
        key: &'static str,
        /// Expected value.
        expected: &'static str,
    },
    /// An array has another type or shape.
    #[error("array `{name}` must be {expected}")]
    Array {
        /// Name of the array.
        name: &'static str,
        /// Expected type and shape.
        expected: &'static str,
    },
    /// An error of the file's form.
    #[error(transparent)]
    Form(Box<dyn std::error::Error + Send + Sync>),
}

/// Whether a part could be read.
pub(super) type Restored = Result<(), StoredError>;

/// Entries and arrays of a file.
pub trait StoredParts {
    /// Whether the transfer function is an array with a number for each frequency, and not a series.
    fn has_bins(&self) -> bool;

    /// The value of an entry; `None` if the header does not have it.
    ///
    /// # Errors
    ///
    /// [`StoredError`] for a value that no entry has.
    fn entry(&self, key: &'static str) -> Result<Option<Entry>, StoredError>;

    /// The numbers of an array of f64.
    ///
    /// # Errors
    ///
    /// [`StoredError`] if the file does not have the array, or one of another type.
    fn f64s(&self, name: &'static str) -> Result<Vec<f64>, StoredError>;

    /// The numbers of an array of f32 of shape \[rows, columns, 2\].
    ///
    /// # Errors
    ///
    /// [`StoredError`] if the file does not have the array, or one of another type or shape.
    fn complex32s(&self, name: &'static str) -> Result<Plane<Complex32>, StoredError>;

    /// The numbers of an array of i16 of shape \[rows, columns, 2\].
    ///
    /// # Errors
    ///
    /// [`StoredError`] if the file does not have the array, or one of another type or shape.
    fn i16_pairs(&self, name: &'static str) -> Result<Plane<[i16; 2]>, StoredError>;
}

impl dyn StoredParts + '_ {
    /// The model for a setup. It may be an impossible one.
    ///
    /// # Errors
    ///
    /// [`StoredError`] for a file that lacks a part of which its header says that it has it, or has it in another form.
    pub fn model(&self, setup: OpticalSetup) -> Result<DisplayModel, StoredError> {
        let [gain, offset, ..] = self.photometry()?;
        let mut model = DisplayModel { gain, offset, ..DisplayModel::ideal(setup) };
        STORED.into_iter().try_for_each(|part| part.row().restore(self, &mut model))?;
        Ok(model)
    }

    /// Gain and offset, and real and imaginary part of the undiffracted light.
    pub(super) fn photometry(&self) -> Result<[f64; 4], StoredError> {
        self.exactly(PHOTOMETRY, "four f64")
    }

    pub(super) fn exactly<const N: usize>(
        &self,
        name: &'static str,
        expected: &'static str,
    ) -> Result<[f64; N], StoredError> {
        self.f64s(name)?.try_into().map_err(|_| StoredError::Array { name, expected })
    }

    /// An order that all models have.
    pub(super) fn order(&self, key: &'static str) -> Result<usize, StoredError> {
        self.order_if_any(key)?.ok_or(StoredError::NoEntry { key })
    }

    pub(super) fn order_if_any(&self, key: &'static str) -> Result<Option<usize>, StoredError> {
        match self.entry(key)? {
            None => Ok(None),
            Some(Entry::Order(order)) => Ok(Some(order)),
            Some(_) => Err(StoredError::Entry { key, expected: "a whole number" }),
        }
    }

    /// Several orders; none if the header does not have the entry.
    pub(super) fn orders(&self, key: &'static str) -> Result<Vec<usize>, StoredError> {
        match self.entry(key)? {
            None => Ok(Vec::new()),
            Some(Entry::Orders(orders)) => Ok(orders),
            Some(_) => Err(StoredError::Entry { key, expected: "a list of whole numbers" }),
        }
    }

    /// A flag; `false` if the header does not have the entry.
    pub(super) fn flag(&self, key: &'static str) -> Result<bool, StoredError> {
        match self.entry(key)? {
            None => Ok(false),
            Some(Entry::Flag(flag)) => Ok(flag),
            Some(_) => Err(StoredError::Entry { key, expected: "true or false" }),
        }
    }

    /// The field of an order from an array with the logarithm of its amplitude and one with its phase.
    pub(super) fn field(&self, order: usize, names: [&'static str; 2]) -> Result<SmoothField, StoredError> {
        let [log_amplitude, phase] = names;
        Ok(SmoothField { order, log_amplitude: self.f64s(log_amplitude)?, phase: self.f64s(phase)? })
    }
}
