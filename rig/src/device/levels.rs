//! Levels: what an SLM shows.

use super::{DeviceError, Result};
use sha2::{Digest as _, Sha256};
use std::fmt::Write as _;
use std::sync::Arc;

/// A pattern of levels, row by row. Cheap to clone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Levels {
    width_px: u32,
    height_px: u32,
    bit_depth: u32,
    values: Arc<[u16]>,
}

impl Levels {
    /// # Errors
    ///
    /// The number of values is not that of the pixels, or one is above the highest level.
    pub fn try_new(width_px: u32, height_px: u32, bit_depth: u32, values: impl Into<Arc<[u16]>>) -> Result<Self> {
        let values = values.into();
        let highest = u16::MAX >> (16 - bit_depth.clamp(1, 16));
        if values.len() != width_px as usize * height_px as usize {
            let found = values.len();
            return Err(DeviceError(format!("{found} levels are not {width_px}×{height_px} px")));
        }
        if let Some(at) = values.iter().position(|&level| level > highest) {
            let (level, x, y) = (values[at], at % width_px as usize, at / width_px as usize);
            return Err(DeviceError(format!(
                "level {level} at x {x}, y {y} is above {highest}, the highest of {bit_depth} bits"
            )));
        }
        Ok(Self { width_px, height_px, bit_depth, values })
    }

    /// Columns \[px\].
    #[must_use]
    pub fn width_px(&self) -> u32 {
        self.width_px
    }

    /// Rows \[px\].
    #[must_use]
    pub fn height_px(&self) -> u32 {
        self.height_px
    }

    /// Bits of a level.
    #[must_use]
    pub fn bit_depth(&self) -> u32 {
        self.bit_depth
    }

    /// The levels, row by row.
    #[must_use]
    pub fn values(&self) -> &[u16] {
        &self.values
    }

    /// SHA-256 in hexadecimal digits of the levels, row by row: a byte for each, or two (the lower first) if levels have
    /// more than 8 bits.
    #[must_use]
    pub fn sha256(&self) -> String {
        let mut hash = Sha256::new();
        let bytes: Vec<u8> = match self.bit_depth {
            ..=8 => self.values.iter().map(|&level| level as u8).collect(),
            _ => self.values.iter().flat_map(|level| level.to_le_bytes()).collect(),
        };
        hash.update(bytes);
        hash.finalize().iter().fold(String::new(), |mut text, byte| {
            // Writing to a string cannot fail.
            let _ = write!(text, "{byte:02x}");
            text
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digests_are_of_a_byte_or_two_for_each_level() {
        let narrow = Levels::try_new(3, 1, 8, [97, 98, 99]).unwrap();
        assert_eq!(narrow.sha256(), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
        // The bytes "abc\0", as two levels of 10 bits would be.
        let wide = Levels::try_new(2, 1, 16, [0x6261, 0x63]).unwrap();
        assert_eq!(wide.sha256(), "dc1114cd074914bd872cc1f9a23ec910ea2203bc79779ab2e17da25782a624fc");
    }

    #[test]
    fn levels_fit_size_and_bits() {
        assert!(Levels::try_new(2, 2, 8, [0; 3]).unwrap_err().0.contains("3 levels are not 2×2 px"));
        let high = Levels::try_new(2, 2, 4, [0, 15, 16, 0]).unwrap_err();
        assert_eq!(high.0, "level 16 at x 0, y 1 is above 15, the highest of 4 bits");
    }
}
