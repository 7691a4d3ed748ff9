//! What is stored of a display model: entries of a header, and arrays of numbers.
//!
//! The row of each part writes the part's own, and reads them back. How entries and arrays become a file is the matter
//! of its form: the native form is described in `server/media/src/kernel_file.rs`, with all entries and arrays.

use super::{ModelPart, STORED};
use crate::display::{DisplayModel, OpticalSetup};
use crate::numerics::{Plane, SmoothField};
use num_complex::Complex32;
use serde::de::{self, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use std::fmt;

/// The array with gain and offset of the camera, which belong to no part, and the undiffracted light after them.
pub(super) const PHOTOMETRY: &str = "photometry";

/// The value of an entry of the header.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(untagged)]
pub enum Entry {
    /// Whether the display has a part.
    Flag(bool),
    /// Highest total degree of a series.
    Order(usize),
    /// Highest total degree of each of several series.
    Orders(Vec<usize>),
}

/// Reads the value as it comes, and keeps nothing of one that no entry has.
impl<'de> Deserialize<'de> for Entry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Value;

        impl<'de> Visitor<'de> for Value {
            type Value = Entry;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("true or false, a whole number, or a list of whole numbers")
            }

            fn visit_bool<E>(self, flag: bool) -> Result<Entry, E> {
                Ok(Entry::Flag(flag))
            }

            fn visit_u64<E: de::Error>(self, order: u64) -> Result<Entry, E> {
                Ok(Entry::Order(usize::try_from(order).map_err(E::custom)?))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Entry, A::Error> {
                let mut orders = Vec::new();
                while let Some(order) = list.next_element()? {
                    orders.push(order);
                }
                Ok(Entry::Orders(orders))
            }
        }

        deserializer.deserialize_any(Value)
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::{
        Crosstalk, Dust, FurtherMode, Ghost, KernelShape, LightBlur, PartialCoherence, ResponseVariation,
        SpatialVariation,
    };
    use crate::numerics::Grid;
    use num_complex::Complex64;
    use proptest::prelude::*;
    use rand::SeedableRng as _;
    use rand_chacha::ChaCha8Rng;

    /// What was stored, as a file gives it back.
    impl StoredParts for Stored {
        fn has_bins(&self) -> bool {
            self.arrays.iter().any(|array| matches!(array.numbers, Numbers::F32(_)))
        }

        fn entry(&self, key: &'static str) -> Result<Option<Entry>, StoredError> {
            Ok(self.entries().find(|(other, _)| *other == key).map(|(_, entry)| entry.clone()))
        }

        fn f64s(&self, name: &'static str) -> Result<Vec<f64>, StoredError> {
            match self.arrays.iter().find(|array| array.name == name) {
                Some(StoredArray { numbers: Numbers::F64(numbers), .. }) => Ok(numbers.clone()),
                _ => Err(StoredError::Array { name, expected: "f64" }),
            }
        }

        fn complex32s(&self, name: &'static str) -> Result<Plane<Complex32>, StoredError> {
            match self.arrays.iter().find(|array| array.name == name) {
                Some(StoredArray { numbers: Numbers::F32(numbers), shape, .. }) => {
                    let values = numbers.as_chunks().0.iter().map(|&[re, im]| Complex32::new(re, im)).collect();
                    Ok(Plane::try_from_vec(shape[0], shape[1], values).unwrap())
                }
                _ => Err(StoredError::Array { name, expected: "f32" }),
            }
        }

        fn i16_pairs(&self, name: &'static str) -> Result<Plane<[i16; 2]>, StoredError> {
            match self.arrays.iter().find(|array| array.name == name) {
                Some(StoredArray { numbers: Numbers::I16(numbers), shape, .. }) => {
                    Ok(Plane::try_from_vec(shape[0], shape[1], numbers.as_chunks().0.to_vec()).unwrap())
                }
                _ => Err(StoredError::Array { name, expected: "i16" }),
            }
        }
    }

    /// A display that has all parts, with drawn numbers and orders.
    fn with_all_parts(seed: u64) -> DisplayModel {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut field = |order_max| {
            let mut field = SmoothField::flat(random.random_range(1..=order_max));
            field.log_amplitude.iter_mut().chain(&mut field.phase).for_each(|c| *c = random.random_range(-1.0..1.0));
            field
        };
        let (kernel, beyond, source) = (field(6), field(2), field(4));
        let modes = (0..1 + seed % 3).map(|m| FurtherMode { light: 0.3 * m as f64, errors: field(3) }).collect();
        let variation = field(4);
        let mut number = || random.random_range(0.01..0.5);
        let setup = OpticalSetup::try_new(Grid::try_new(4, 6, 8e-6).unwrap(), 515e-9, 2e-3).unwrap();
        DisplayModel {
            kernel: KernelShape::Smooth(kernel),
            beyond,
            source,
            ghost: Ghost::of_numbers(std::array::from_fn(|_| number())),
            variation: SpatialVariation::new(std::array::from_fn(|power| {
                let mut variation = variation.clone();
                variation.phase[0] = power as f64;
                variation
            })),
            coherence: PartialCoherence::new(modes),
            dust: Dust::new(Plane::from_fn(4, 6, |y, x| [(seed % 99) as i16 * y as i16, 1 - x as i16])),
            response: (0..1 + seed % 4).map(|_| [number(), -number()]).collect(),
            response_variation: ResponseVariation { order: 1, coefficients: vec![number(), -number(), number()] },
            crosstalk: Crosstalk::of_ratios([number(), 0.0]),
            light_blur: LightBlur::of_ratios([number(), number()]),
            zero_order: Complex64::new(number(), -number()),
            gain: number(),
            offset: number(),
            ..DisplayModel::ideal(setup)
        }
    }

    fn read_back(model: &DisplayModel) -> DisplayModel {
        let stored: &dyn StoredParts = &Stored::of(model);
        stored.model(model.setup).unwrap()
    }

    proptest! {
        #[test]
        fn what_is_stored_of_any_parts_comes_back_equal(seed: u64, without: u16) {
            let mut model = with_all_parts(seed);
            for &part in ModelPart::ALL {
                prop_assert!(part.is_in(&model), "{part:?}");
            }
            for (_, &part) in ModelPart::ALL.iter().enumerate().filter(|(i, _)| without >> i & 1 == 1) {
                part.remove(&mut model);
            }
            let read = read_back(&model);
            prop_assert_eq!(&read, &model);
            for part in ModelPart::ALL {
                prop_assert!(part.is_same_in(&read, &model), "{part:?}");
            }
        }
    }

    #[test]
    fn a_part_that_differs_is_not_the_same_and_no_other_part_stores_it() {
        let model = with_all_parts(7);
        for &part in ModelPart::ALL {
            let mut without = model.clone();
            part.remove(&mut without);
            assert!(!part.is_same_in(&model, &without), "{part:?}");
        }
        let names: Vec<&str> = Stored::of(&model).into_arrays().iter().map(|array| array.name).collect();
        let keys: Vec<&str> = Stored::of(&model).entries().map(|(key, _)| *key).collect();
        for names in [names, keys] {
            assert!(names.iter().enumerate().all(|(i, name)| !names[..i].contains(name)), "{names:?}");
        }
    }

    #[test]
    fn kernels_of_bins_come_back_equal() {
        let bins = Plane::from_fn(8, 12, |y, x| Complex32::new(y as f32 + 0.1, -(x as f32) / 3.0));
        let mut model = with_all_parts(3);
        let parts = ModelPart::ALL.iter().filter(|part| part.in_bins() != super::super::InBins::Beside);
        parts.for_each(|part| part.remove(&mut model));
        model.kernel = KernelShape::Bins(bins);
        assert_eq!(read_back(&model), model);
    }

    #[test]
    fn what_is_missing_or_has_another_length_is_refused_by_name() {
        let model = with_all_parts(5);
        let whole = Stored::of(&model);
        let refusal = |stored: Stored| {
            let stored: &dyn StoredParts = &stored;
            stored.model(model.setup).unwrap_err().to_string()
        };
        for (i, StoredArray { name, .. }) in whole.arrays.iter().enumerate() {
            let mut without = whole.clone();
            without.arrays.remove(i);
            assert!(refusal(without).contains(&format!("`{name}`")), "{name}");
        }
        for (key, _) in &whole.always {
            let mut without = whole.clone();
            without.always.retain(|(other, _)| other != key);
            assert_eq!(refusal(without), format!("the header has no entry `{key}`"));
        }
        let mut huge = whole;
        huge.sometimes.iter_mut().filter(|(key, _)| *key == "mode_orders").for_each(|(_, entry)| {
            *entry = Entry::Orders(vec![1 << 40]);
        });
        assert!(refusal(huge).contains("`mode_orders`"));
    }
}
