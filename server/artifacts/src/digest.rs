//! Names of blobs: `sha256-` and 64 lower-case hexadecimal digits.

use crate::error::{ArtifactError, Result};
use sha2::{Digest, Sha256};
use std::fmt::Write;

const PREFIX: &str = "sha256-";
const HEX_DIGITS: usize = 64;

/// Returns the digest of `bytes`.
#[must_use]
pub fn digest_of(bytes: &[u8]) -> String {
    name(Sha256::new_with_prefix(bytes))
}

/// Checks that `digest` is well formed. A well-formed digest is a plain file name: it has no separator and no dot.
pub fn check_digest(digest: &str) -> Result<()> {
    let good = digest.strip_prefix(PREFIX).is_some_and(|hex| {
        hex.len() == HEX_DIGITS && hex.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'))
    });
    if good { Ok(()) } else { Err(ArtifactError::BadDigest { digest: digest.chars().take(100).collect() }) }
}

/// Returns the digest of all bytes that `hasher` has seen.
pub(super) fn name(hasher: Sha256) -> String {
    let mut name = String::with_capacity(PREFIX.len() + HEX_DIGITS);
    name.push_str(PREFIX);
    for byte in hasher.finalize() {
        // Writing to a string cannot fail.
        let _ = write!(name, "{byte:02x}");
    }
    name
}

/// The subfolder of a blob: the first two hexadecimal digits of its digest, which the caller has checked.
pub(super) fn shard(digest: &str) -> &str {
    &digest[PREFIX.len()..PREFIX.len() + 2]
}
