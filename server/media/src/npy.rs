//! Checks of NumPy's array files before memory for their contents is allocated.

use crate::shortened::{shortened, sides};
use npyz::{NpyHeader, Order};

/// Longest accepted header \[bytes\]. NumPy writes 118 bytes for the arrays that this crate reads.
const HEADER_BYTES_MAX: usize = 512;

/// Whether the first bytes of a file are those of a NumPy array.
#[must_use]
pub(crate) fn is_npy(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x93NUMPY")
}

/// A plain array of numbers, whose values are not converted yet.
pub(crate) struct Array<'a> {
    /// NumPy's name of the number type, for example `<f4`.
    pub(crate) kind: String,
    pub(crate) shape: Vec<u64>,
    pub(crate) is_c_order: bool,
    data: &'a [u8],
}

impl<'a> Array<'a> {
    /// Reads the header of a file.
    ///
    /// # Errors
    ///
    /// A message that says what is wrong with it.
    pub(crate) fn open(bytes: &'a [u8]) -> Result<Self, String> {
        require_plain_header(bytes)?;
        let mut data = bytes;
        let header =
            NpyHeader::from_reader(&mut data).map_err(|error| shortened(format!("not a .npy file ({error})")))?;
        let kind = shortened(header.dtype().descr().trim_matches(['\'', '"']));
        Ok(Self { kind, shape: header.shape().to_vec(), is_c_order: header.order() == Order::C, data })
    }

    /// Length of the values \[bytes\].
    pub(crate) fn data_bytes(&self) -> usize {
        self.data.len()
    }

    /// The first `count` values; `None` if the file has fewer. Nothing is allocated before that is known.
    pub(crate) fn values<const BYTES: usize, T>(
        &self,
        count: usize,
        of_value: impl Fn([u8; BYTES]) -> T,
    ) -> Option<Vec<T>> {
        let values = self.data.as_chunks().0.get(..count)?;
        Some(values.iter().map(|&bytes| of_value(bytes)).collect())
    }

    /// Type and shape, for messages.
    pub(crate) fn described(&self) -> String {
        format!("{} of shape {}", self.kind, sides(&self.shape))
    }
}

/// Checks that the file's header is short and has no nested brackets. Some hundred nested brackets would keep the
/// parser busy for minutes.
///
/// # Errors
///
/// A message that says what is wrong with the header.
pub(crate) fn require_plain_header(bytes: &[u8]) -> Result<(), String> {
    // The magic bytes, the version, and the header's length: two bytes in version 1, four bytes in later versions.
    let (header_bytes, rest) = match bytes {
        [_, _, _, _, _, _, 1, _, low, high, rest @ ..] => (usize::from(u16::from_le_bytes([*low, *high])), rest),
        [_, _, _, _, _, _, 2..=u8::MAX, _, a, b, c, d, rest @ ..] => {
            (u32::from_le_bytes([*a, *b, *c, *d]) as usize, rest)
        }
        _ => return Err("not a .npy file".to_owned()),
    };
    if header_bytes > HEADER_BYTES_MAX {
        return Err(format!(
            "a .npy file with a header of {header_bytes} bytes (at most {HEADER_BYTES_MAX} are accepted)"
        ));
    }
    let Some(header) = rest.get(..header_bytes) else { return Err("a .npy file that ends in its header".to_owned()) };
    let count = |bracket: u8| header.iter().filter(|byte| **byte == bracket).count();
    // A valid header has one dictionary and one shape.
    if count(b'{') > 1 || count(b'(') > 1 || count(b'[') > 0 {
        return Err("a .npy file of records, not of numbers".to_owned());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(version: u8, length: &[u8], header: &[u8]) -> Vec<u8> {
        [&b"\x93NUMPY"[..], &[version, 0], length, header].concat()
    }

    #[test]
    fn long_and_truncated_headers_are_refused() {
        let header = b"{'descr': '<f4', 'fortran_order': False, 'shape': (3, 4), }";
        let length = header.len() as u8;
        let good = file(1, &[length, 0], header);
        assert_eq!(require_plain_header(&good), Ok(()));
        assert_eq!(require_plain_header(&file(2, &[length, 0, 0, 0], header)), Ok(()));
        for (version, length) in [(1, &[0xff, 0xff][..]), (2, &[0xff; 4]), (3, &[0, 0, 0, 0xee])] {
            assert!(require_plain_header(&file(version, length, header)).unwrap_err().contains("at most 512"));
        }
        for end in 0..good.len() {
            assert!(require_plain_header(&good[..end]).is_err());
        }
    }

    #[test]
    fn nested_brackets_are_refused() {
        for bracket in [b"[", b"(", b"{"] {
            let header = [b"{'descr': ".to_vec(), bracket.repeat(400)].concat();
            let file = file(1, &(header.len() as u16).to_le_bytes(), &header);
            assert!(require_plain_header(&file).unwrap_err().contains("of records"));
        }
    }
}
