//! Files of NumPy, looked at before anything is allocated for what they claim.

/// Longest header that is read \[bytes\]. NumPy writes 118 for the arrays that are read here; the parser goes one deeper for each
/// bracket in it.
const HEADER_BYTES_MAX: usize = 512;

/// Whether a file says that it is an array of NumPy.
#[must_use]
pub(crate) fn is_npy(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x93NUMPY")
}

/// The file's header is short enough to be parsed.
///
/// # Errors
///
/// What is wrong with it.
pub(crate) fn require_short_header(bytes: &[u8]) -> Result<(), String> {
    // Magic, version, then the header's length: two bytes in version 1, four later.
    let header_bytes = match bytes {
        [_, _, _, _, _, _, 1, _, low, high, ..] => usize::from(u16::from_le_bytes([*low, *high])),
        [_, _, _, _, _, _, 2..=u8::MAX, _, a, b, c, d, ..] => u32::from_le_bytes([*a, *b, *c, *d]) as usize,
        _ => return Err("no .npy file".to_owned()),
    };
    if header_bytes <= HEADER_BYTES_MAX {
        return Ok(());
    }
    Err(format!("a .npy file with a header of {header_bytes} bytes, of which at most {HEADER_BYTES_MAX} are read"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_that_claim_much_are_not_read() {
        let file = |version: u8, length: &[u8]| [&b"\x93NUMPY"[..], &[version, 0], length, b"{}"].concat();
        assert_eq!(require_short_header(&file(1, &[118, 0])), Ok(()));
        assert_eq!(require_short_header(&file(2, &[0, 2, 0, 0])), Ok(()));
        for (version, length) in [(1, &[0xff, 0xff][..]), (2, &[0xff; 4]), (3, &[0, 0, 0, 0xee])] {
            assert!(require_short_header(&file(version, length)).unwrap_err().contains("at most 512"));
        }
        for end in 0..10 {
            assert!(require_short_header(&file(1, &[118, 0])[..end]).is_err());
        }
    }

    #[test]
    fn nested_brackets_do_not_use_up_the_stack() {
        let header = [b"{'descr': ".to_vec(), b"[".repeat(HEADER_BYTES_MAX - 10)].concat();
        let file = [b"\x93NUMPY\x01\0".to_vec(), (header.len() as u16).to_le_bytes().to_vec(), header].concat();
        assert_eq!(require_short_header(&file), Ok(()));
        assert!(npyz::NpyFile::new(&file[..]).is_err());
    }
}
