//! Keys, keyrings, manifests and kernels.

use lightpath_manifest::{Keyring, ListedKey, Manifest, Optics, PublicKey, SigningKey, Time};
use sha2::{Digest as _, Sha256};
use std::time::{SystemTime, UNIX_EPOCH};

/// Number of the root key that devices know.
pub(crate) const ROOT: u8 = 1;
/// Number of a key that the keyring lists.
pub(crate) const SIGNER: u8 = 2;
/// Number of a key that nobody lists.
pub(crate) const STRANGER: u8 = 3;
/// Number of a key that the keyring lists and whose time is over.
pub(crate) const EXPIRED: u8 = 4;
/// Number of a key that the keyring revokes.
pub(crate) const REVOKED: u8 = 5;

pub(crate) fn key(number: u8) -> SigningKey {
    SigningKey::from_seed([number; 32])
}

pub(crate) fn root() -> PublicKey {
    key(ROOT).public()
}

/// The time in this many hours.
pub(crate) fn in_hours(hours: i64) -> Time {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs() as i64;
    Time::from_unix_s(now + 3600 * hours).unwrap()
}

pub(crate) fn keyring(version: u32) -> Keyring {
    let listed =
        |number, from, until| ListedKey { key: key(number).public(), from: in_hours(from), until: in_hours(until) };
    Keyring {
        version,
        issued: in_hours(-240),
        expires: in_hours(2000),
        roots: vec![root()],
        keys: vec![listed(SIGNER, -240, 9000), listed(EXPIRED, -9000, -1)],
        revoked: vec![key(REVOKED).public()],
    }
}

pub(crate) fn signed(keyring: &Keyring) -> String {
    keyring.signed(&[&key(ROOT)])
}

/// A kernel: bytes that depend on the version alone. The first line has the version, for self-tests.
pub(crate) fn kernel(version: u32, size_bytes: usize) -> Vec<u8> {
    let mut bytes = format!("kernel {version}\n").into_bytes();
    let mut random = u64::from(version);
    while bytes.len() < size_bytes {
        random = next_random(random);
        bytes.extend_from_slice(&random.to_le_bytes());
    }
    bytes.truncate(size_bytes);
    bytes
}

/// The number after `state` in a fixed sequence (`splitmix64`, in one step).
pub(crate) fn next_random(state: u64) -> u64 {
    let mut mixed = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}

pub(crate) fn digest(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().fold("sha256-".to_owned(), |text, byte| text + &format!("{byte:02x}"))
}

pub(crate) fn manifest(version: u32, generation: u64, kernel: &[u8]) -> Manifest {
    Manifest {
        display: "pluto".to_owned(),
        optics: Optics::at_distance(515_000, 150_000_000),
        generation,
        version,
        format: "compact".to_owned(),
        digest: digest(kernel),
        size_bytes: kernel.len() as u64,
        width_px: 1920,
        height_px: 1080,
        pixel_pitch_pm: 8_000_000,
        orders: "first".to_owned(),
        interpolated: false,
        issued: in_hours(-1),
        expires: in_hours(160),
    }
}
