//! Arrays in the forms in which NumPy and PyTorch store them.

use super::error::KernelFormatError;
use super::half;
use crate::budget::{Budget, Held};
use crate::kernel_file::i16_pairs;
use crate::npy;
use crate::shortened::{shortened, sides};
use lightpath_optics::Plane;
use npyz::{DType, Order};

/// A dense array of real or complex numbers in C order.
#[derive(Debug)]
pub(super) struct Array<'b> {
    /// Name of the array in messages.
    pub(super) name: String,
    pub(super) shape: Vec<usize>,
    /// The numbers. The real and the imaginary part of a complex number follow each other.
    pub(super) numbers: Vec<f32>,
    pub(super) complex: bool,
    _held: Held<'b>,
}

/// NumPy's name of 16-bit integers.
pub(super) const I16: &str = "<i2";

/// Number type of an array's bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    F16,
    F32,
    F64,
    C64,
    C128,
}

impl Kind {
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::F16 => 2,
            Self::F32 => 4,
            Self::F64 | Self::C64 => 8,
            Self::C128 => 16,
        }
    }

    /// Memory of the numbers of `bytes` of this type as float32 \[bytes\].
    fn f32_bytes(self, bytes: usize) -> u64 {
        match self {
            Self::F16 => 2 * bytes as u64,
            Self::F32 | Self::C64 => bytes as u64,
            Self::F64 | Self::C128 => bytes as u64 / 2,
        }
    }

    fn is_complex(self) -> bool {
        matches!(self, Self::C64 | Self::C128)
    }
}

impl<'b> Array<'b> {
    /// Makes an array from little-endian bytes.
    pub(super) fn new(
        name: &str,
        shape: Vec<usize>,
        kind: Kind,
        bytes: &[u8],
        budget: &'b Budget,
    ) -> Result<Self, KernelFormatError> {
        let count = shape.iter().try_fold(1_usize, |product, &side| product.checked_mul(side));
        if count.and_then(|count| count.checked_mul(kind.bytes())) != Some(bytes.len()) {
            return Err(KernelFormatError::Array {
                name: shortened(name),
                actual: format!("{} bytes long", bytes.len()),
                expected: format!("as long as {kind:?} numbers of shape {}", sides(&shape)),
            });
        }
        let held = budget.hold(kind.f32_bytes(bytes.len()))?;
        let numbers: Vec<f32> = match kind {
            Kind::F16 => bytes.as_chunks().0.iter().map(|&chunk| half::to_f32(u16::from_le_bytes(chunk))).collect(),
            Kind::F32 | Kind::C64 => bytes.as_chunks().0.iter().map(|&chunk| f32::from_le_bytes(chunk)).collect(),
            Kind::F64 | Kind::C128 => {
                bytes.as_chunks().0.iter().map(|&chunk| f64::from_le_bytes(chunk) as f32).collect()
            }
        };
        if let Some(index) = numbers.iter().position(|number| !number.is_finite()) {
            return Err(KernelFormatError::NotFinite { name: shortened(name), index });
        }
        Ok(Self { name: shortened(name), shape, numbers, complex: kind.is_complex(), _held: held })
    }

    /// Reads an array from a `.npy` file.
    pub(super) fn read_npy(name: &str, bytes: &[u8], budget: &'b Budget) -> Result<Self, KernelFormatError> {
        let file = NpyFile::open(name, bytes)?;
        let kind = match file.descr.as_str() {
            "<f2" => Kind::F16,
            "<f4" => Kind::F32,
            "<f8" => Kind::F64,
            "<c8" => Kind::C64,
            "<c16" => Kind::C128,
            _ => return Err(file.refused("of float16, float32, float64, complex64 or complex128")),
        };
        Self::new(name, file.shape, kind, file.data, budget)
    }

    /// Description of the array for messages.
    pub(super) fn described(&self) -> String {
        format!("{} of shape {}", if self.complex { "complex" } else { "real" }, sides(&self.shape))
    }
}

/// A `.npy` file after its header was read.
pub(super) struct NpyFile<'a> {
    name: String,
    /// NumPy's name of the number type, for example `<f4`.
    pub(super) descr: String,
    shape: Vec<usize>,
    pub(super) data: &'a [u8],
}

impl<'a> NpyFile<'a> {
    /// Reads the header of a file in C order. `name` stands for the array in messages.
    pub(super) fn open(name: &str, bytes: &'a [u8]) -> Result<Self, KernelFormatError> {
        let refused = |actual: String| KernelFormatError::Array {
            name: shortened(name),
            actual: shortened(actual),
            expected: "a .npy file of numbers, little-endian, C order".to_owned(),
        };
        npy::require_plain_header(bytes).map_err(refused)?;
        let mut data = bytes;
        let header = npyz::NpyHeader::from_reader(&mut data).map_err(|error| refused(format!("damaged ({error})")))?;
        let descr = header.dtype().descr().trim_matches('\'').to_owned();
        if !matches!(header.dtype(), DType::Plain(_)) {
            return Err(refused(descr));
        }
        if header.order() != Order::C {
            return Err(refused("in Fortran order".to_owned()));
        }
        let shape = header.shape().iter().map(|&side| side as usize).collect();
        Ok(Self { name: name.to_owned(), descr, shape, data })
    }

    /// The numbers of an array of float64 or float32, without rounding.
    pub(super) fn f64s(&self, budget: &Budget) -> Result<Vec<f64>, KernelFormatError> {
        budget.take(2 * self.data.len() as u64)?;
        let count = self.shape.iter().try_fold(1_usize, |product, &side| product.checked_mul(side));
        let numbers: Vec<f64> = match self.descr.as_str() {
            "<f8" => self.data.as_chunks().0.iter().map(|&chunk| f64::from_le_bytes(chunk)).collect(),
            "<f4" => self.data.as_chunks().0.iter().map(|&chunk| f32::from_le_bytes(chunk).into()).collect(),
            _ => return Err(self.refused("of float64 or float32")),
        };
        let size = if self.descr == "<f8" { 8 } else { 4 };
        if count.and_then(|count| count.checked_mul(size)) != Some(self.data.len()) {
            return Err(self.refused("as long as its shape"));
        }
        if let Some(index) = numbers.iter().position(|number| !number.is_finite()) {
            return Err(KernelFormatError::NotFinite { name: self.name.clone(), index });
        }
        Ok(numbers)
    }

    /// The pairs of integers of an array of int16 of shape \[rows, columns, 2\].
    pub(super) fn i16_pairs(&self, budget: &Budget) -> Result<Plane<[i16; 2]>, KernelFormatError> {
        let refused = || self.refused("of int16 of shape [rows, columns, 2]");
        let (I16, &[height_px, width_px, 2]) = (self.descr.as_str(), &self.shape[..]) else { return Err(refused()) };
        budget.take(self.data.len() as u64)?;
        Plane::try_from_vec(height_px, width_px, i16_pairs(self.data)).map_err(|_| refused())
    }

    /// The text of an array that holds a single one.
    pub(super) fn text(&self, budget: &Budget) -> Result<String, KernelFormatError> {
        let letters: Option<usize> = self.descr.strip_prefix("<U").and_then(|count| count.parse().ok());
        let is_one = self.shape.iter().all(|&side| side == 1);
        if !is_one || letters.and_then(|count| count.checked_mul(4)) != Some(self.data.len()) {
            return Err(self.refused("of one text"));
        }
        // A letter takes at most the four bytes that it has in the file, twice while the text grows or is trimmed.
        budget.take(3 * self.data.len() as u64)?;
        let points = self.data.as_chunks().0.iter().map(|&chunk| char::from_u32(u32::from_le_bytes(chunk)));
        let text: Option<String> = points.collect();
        // NumPy pads texts with zeros.
        text.map(|text| text.trim_end_matches('\0').to_owned()).ok_or_else(|| self.refused("of one text"))
    }

    fn refused(&self, expected: &str) -> KernelFormatError {
        KernelFormatError::Array {
            name: self.name.clone(),
            actual: format!("{} of shape {} in {} bytes", shortened(&self.descr), sides(&self.shape), self.data.len()),
            expected: format!("a .npy file {expected}, little-endian"),
        }
    }
}

/// Writes a `.npy` file of one text.
pub(super) fn npy_text(text: &str) -> Vec<u8> {
    let points: Vec<u8> = text.chars().flat_map(|letter| u32::from(letter).to_le_bytes()).collect();
    npy(&format!("<U{}", points.len() / 4), &[], &points)
}

/// Writes a `.npy` file, version 1.0. `descr` is NumPy's name of the number type, for example `<f4`.
pub(super) fn npy(descr: &str, shape: &[usize], bytes: &[u8]) -> Vec<u8> {
    let sides: Vec<String> = shape.iter().map(usize::to_string).collect();
    let comma = if shape.len() == 1 { "," } else { "" };
    let mut header =
        format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({}{comma}), }}", sides.join(", "));
    // The data begin at a multiple of 64 bytes.
    let padding = 63 - (10 + header.len()) % 64;
    header.push_str(&" ".repeat(padding));
    header.push('\n');
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend((header.len() as u16).to_le_bytes());
    file.extend(header.as_bytes());
    file.extend(bytes);
    file
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_type_is_read() {
        for (descr, kind, one) in [
            ("<f2", Kind::F16, 0x3c00_u16.to_le_bytes().to_vec()),
            ("<f4", Kind::F32, 1.0_f32.to_le_bytes().to_vec()),
            ("<f8", Kind::F64, 1.0_f64.to_le_bytes().to_vec()),
        ] {
            let file = npy(descr, &[1, 3], &one.repeat(3));
            assert!(npyz::NpyFile::new(&file[..]).is_ok());
            let budget = Budget::new(1000);
            let array = Array::read_npy("x", &file, &budget).unwrap();
            assert_eq!((array.numbers, array.shape, array.complex), (vec![1.0; 3], vec![1, 3], false), "{kind:?}");
        }
        let file = npy("<c8", &[2], &1.0_f32.to_le_bytes().repeat(4));
        assert!(Array::read_npy("x", &file, &Budget::new(1000)).unwrap().complex);
    }

    #[test]
    fn texts_and_float64_are_read_back_exactly() {
        for text in ["", "display", "{\"model\":\"Zernike–1\"}"] {
            assert_eq!(NpyFile::open("x", &npy_text(text)).unwrap().text(&Budget::new(1000)).unwrap(), text);
        }
        let padded = npy("<U3", &[1], &[65, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(NpyFile::open("x", &padded).unwrap().text(&Budget::new(1000)).unwrap(), "A");
        for (descr, data) in [("<U1", &[0; 8][..]), ("<U1", &[0xff; 4]), ("<f4", &[0; 4])] {
            assert!(NpyFile::open("x", &npy(descr, &[], data)).unwrap().text(&Budget::new(1000)).is_err(), "{descr}");
        }
        let numbers = [0.1, -1.0 / 3.0];
        let file = npy("<f8", &[2], &numbers.map(f64::to_le_bytes).concat());
        assert_eq!(NpyFile::open("x", &file).unwrap().f64s(&Budget::new(1000)).unwrap(), numbers);
        assert!(NpyFile::open("x", &file[..file.len() - 1]).unwrap().f64s(&Budget::new(1000)).is_err());
    }

    #[test]
    fn truncated_files_non_finite_values_and_integers_are_refused() {
        let file = npy("<f4", &[3], &1.0_f32.to_le_bytes().repeat(3));
        assert!(Array::read_npy("x", &file[..file.len() - 1], &Budget::new(1000)).is_err());
        let file = npy("<f4", &[2], &[1.0_f32.to_le_bytes(), f32::NAN.to_le_bytes()].concat());
        assert!(matches!(
            Array::read_npy("x", &file, &Budget::new(1000)),
            Err(KernelFormatError::NotFinite { index: 1, .. })
        ));
        let file = npy("<i4", &[1], &[0; 4]);
        assert!(Array::read_npy("x", &file, &Budget::new(1000)).unwrap_err().to_string().contains("<i4"));
    }
}
