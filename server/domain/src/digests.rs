//! Digests of contents, as artifacts are named: `sha256-` and 64 lower-case hexadecimal digits.

use sha2::{Digest as _, Sha256};

/// The digest of `bytes`.
#[must_use]
pub fn digest_of(bytes: &[u8]) -> String {
    let hash: String = Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect();
    format!("sha256-{hash}")
}
