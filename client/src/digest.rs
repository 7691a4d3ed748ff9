//! SHA-256 digests, which name artifacts.

use crate::{Error, Result};
use sha2::{Digest as _, Sha256};
use std::fmt::Write as _;
use std::io::Read;
use std::path::Path;

/// Size of the pieces in which a file is read and hashed.
const PIECE_BYTES: usize = 1 << 20;

/// Returns the digest of `bytes`: `sha256-` and 64 lower-case hexadecimal digits.
#[must_use]
pub fn digest_of(bytes: &[u8]) -> String {
    let mut hasher = Hasher::default();
    hasher.update(bytes);
    hasher.finish()
}

/// Returns the digest and the size \[bytes\] of a file.
pub(crate) fn digest_of_file(path: &Path) -> Result<(String, u64)> {
    let read_error = |source| Error::file("read", path, source);
    // Opening a pipe would wait for somebody who writes to it, and its bytes could be read only once.
    if !std::fs::metadata(path).map_err(read_error)?.is_file() {
        return Err(read_error(std::io::Error::other(
            "it is no file; a pipe, a device or a folder cannot be uploaded",
        )));
    }
    let mut file = std::fs::File::open(path).map_err(read_error)?;
    let (mut hasher, mut piece) = (Hasher::default(), vec![0; PIECE_BYTES]);
    loop {
        match file.read(&mut piece).map_err(read_error)? {
            0 => {
                let size_bytes = hasher.size_bytes;
                return Ok((hasher.finish(), size_bytes));
            }
            length => hasher.update(&piece[..length]),
        }
    }
}

/// Computes the digest of bytes that arrive in pieces.
#[derive(Default)]
pub(crate) struct Hasher {
    sha256: Sha256,
    size_bytes: u64,
}

impl Hasher {
    pub(crate) fn update(&mut self, bytes: &[u8]) {
        self.sha256.update(bytes);
        self.size_bytes += bytes.len() as u64;
    }

    /// Number of bytes hashed so far.
    pub(crate) fn size_bytes(&self) -> u64 {
        self.size_bytes
    }

    pub(crate) fn finish(self) -> String {
        let mut digest = "sha256-".to_owned();
        for byte in self.sha256.finalize() {
            // Writing to a string cannot fail.
            let _ = write!(digest, "{byte:02x}");
        }
        digest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digests_are_sha256_in_lower_case() {
        let abc = "sha256-ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(digest_of(b"abc"), abc);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("abc");
        std::fs::write(&path, b"abc").unwrap();
        assert_eq!(digest_of_file(&path).unwrap(), (abc.to_owned(), 3));
        let missing = digest_of_file(&folder.path().join("missing")).unwrap_err().to_string();
        assert!(missing.contains("could not read") && missing.contains("missing"), "{missing}");
    }
}
