//! Arrays in the forms in which NumPy and PyTorch store them.

use super::error::KernelFormatError;
use super::half;
use crate::npy;
use npyz::{DType, Order};

/// A dense array of real or complex numbers in C order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Array {
    /// Name of the array in messages.
    pub(super) name: String,
    pub(super) shape: Vec<usize>,
    /// The numbers. The real and the imaginary part of a complex number follow each other.
    pub(super) numbers: Vec<f32>,
    pub(super) complex: bool,
}

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

    fn is_complex(self) -> bool {
        matches!(self, Self::C64 | Self::C128)
    }
}

impl Array {
    /// Makes an array from little-endian bytes.
    pub(super) fn new(name: &str, shape: Vec<usize>, kind: Kind, bytes: &[u8]) -> Result<Self, KernelFormatError> {
        let count = shape.iter().try_fold(1_usize, |product, &side| product.checked_mul(side));
        if count.and_then(|count| count.checked_mul(kind.bytes())) != Some(bytes.len()) {
            return Err(KernelFormatError::Array {
                name: name.to_owned(),
                actual: format!("{} bytes long", bytes.len()),
                expected: format!("as long as {kind:?} numbers of shape {shape:?}"),
            });
        }
        let numbers: Vec<f32> = match kind {
            Kind::F16 => bytes.as_chunks().0.iter().map(|&chunk| half::to_f32(u16::from_le_bytes(chunk))).collect(),
            Kind::F32 | Kind::C64 => bytes.as_chunks().0.iter().map(|&chunk| f32::from_le_bytes(chunk)).collect(),
            Kind::F64 | Kind::C128 => {
                bytes.as_chunks().0.iter().map(|&chunk| f64::from_le_bytes(chunk) as f32).collect()
            }
        };
        if let Some(index) = numbers.iter().position(|number| !number.is_finite()) {
            return Err(KernelFormatError::NotFinite { name: name.to_owned(), index });
        }
        Ok(Self { name: name.to_owned(), shape, numbers, complex: kind.is_complex() })
    }

    /// Reads an array from a `.npy` file.
    pub(super) fn read_npy(name: &str, bytes: &[u8]) -> Result<Self, KernelFormatError> {
        let expected = "a .npy file of float16, float32, float64, complex64 or complex128, little-endian, C order";
        let refused =
            |actual: String| KernelFormatError::Array { name: name.to_owned(), actual, expected: expected.to_owned() };
        npy::require_plain_header(bytes).map_err(refused)?;
        let mut rest = bytes;
        let header = npyz::NpyHeader::from_reader(&mut rest).map_err(|error| refused(format!("damaged ({error})")))?;
        let described = header.dtype().descr();
        let kind = match (header.dtype(), described.trim_matches('\'')) {
            (DType::Plain(_), "<f2") => Kind::F16,
            (DType::Plain(_), "<f4") => Kind::F32,
            (DType::Plain(_), "<f8") => Kind::F64,
            (DType::Plain(_), "<c8") => Kind::C64,
            (DType::Plain(_), "<c16") => Kind::C128,
            _ => return Err(refused(described)),
        };
        if header.order() != Order::C {
            return Err(refused("in Fortran order".to_owned()));
        }
        let shape = header.shape().iter().map(|&side| side as usize).collect();
        Self::new(name, shape, kind, rest)
    }

    /// Description of the array for messages.
    pub(super) fn described(&self) -> String {
        format!("{} of shape {:?}", if self.complex { "complex" } else { "real" }, self.shape)
    }
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
            let array = Array::read_npy("x", &file).unwrap();
            assert_eq!((array.numbers, array.shape, array.complex), (vec![1.0; 3], vec![1, 3], false), "{kind:?}");
        }
        let file = npy("<c8", &[2], &1.0_f32.to_le_bytes().repeat(4));
        assert!(Array::read_npy("x", &file).unwrap().complex);
    }

    #[test]
    fn truncated_files_non_finite_values_and_integers_are_refused() {
        let file = npy("<f4", &[3], &1.0_f32.to_le_bytes().repeat(3));
        assert!(Array::read_npy("x", &file[..file.len() - 1]).is_err());
        let file = npy("<f4", &[2], &[1.0_f32.to_le_bytes(), f32::NAN.to_le_bytes()].concat());
        assert!(matches!(Array::read_npy("x", &file), Err(KernelFormatError::NotFinite { index: 1, .. })));
        let file = npy("<i4", &[1], &[0; 4]);
        assert!(Array::read_npy("x", &file).unwrap_err().to_string().contains("<i4"));
    }
}
