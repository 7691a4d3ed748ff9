//! Well-formed documents, and the keys that sign them.

use lightpath_manifest::{Keyring, ListedKey, Manifest, Optics, PublicKey, SigningKey, Time, Wanted};
use sha2::{Digest as _, Sha256};
use std::fmt::Write as _;

/// Seed of the root key that devices know from their manufacture.
pub(crate) const ROOT: u8 = 1;
/// Seed of the key that signs manifests.
pub(crate) const SIGNER: u8 = 2;
/// Seed of a key that counts from the first of December on.
pub(crate) const EARLY: u8 = 3;
/// Seed of a key that counted until the 20th of November.
pub(crate) const LATE: u8 = 4;
/// Seed of the root key that follows.
pub(crate) const NEW_ROOT: u8 = 5;
/// Seed of another root key of the device's manufacture. It signs nothing.
pub(crate) const SPARE_ROOT: u8 = 6;
/// Seed of a key that no keyring has.
pub(crate) const STRANGER: u8 = 7;
/// Seed of a revoked key. The keyring also lists it.
pub(crate) const REVOKED: u8 = 9;
/// Seed of a revoked key that the keyring does not list.
pub(crate) const GONE: u8 = 10;

/// Present time of most cases.
pub(crate) const NOW: &str = "2026-11-24T00:00:00Z";

pub(crate) fn key(seed: u8) -> SigningKey {
    SigningKey::from_seed([seed; 32])
}

pub(crate) fn public(seed: u8) -> PublicKey {
    key(seed).public()
}

/// The root keys of the device's manufacture.
pub(crate) fn pinned_roots() -> Vec<PublicKey> {
    vec![public(SPARE_ROOT), public(ROOT)]
}

pub(crate) fn time(text: &str) -> Time {
    Time::parse(text).unwrap()
}

pub(crate) fn unix_s(text: &str) -> i64 {
    time(text).unix_s()
}

pub(crate) fn listed(seed: u8, from: &str, until: &str) -> ListedKey {
    ListedKey { key: public(seed), from: time(from), until: time(until) }
}

/// The device's keyring in most cases: version 3.
pub(crate) fn keyring() -> Keyring {
    Keyring {
        version: 3,
        issued: time("2026-11-01T00:00:00Z"),
        expires: time("2026-12-31T00:00:00Z"),
        roots: vec![public(ROOT)],
        keys: vec![
            listed(SIGNER, "2026-11-01T00:00:00Z", "2027-11-01T00:00:00Z"),
            listed(EARLY, "2026-12-01T00:00:00Z", "2027-11-01T00:00:00Z"),
            listed(LATE, "2026-10-01T00:00:00Z", "2026-11-20T00:00:00Z"),
            listed(REVOKED, "2026-11-01T00:00:00Z", "2027-11-01T00:00:00Z"),
        ],
        revoked: vec![public(REVOKED), public(GONE)],
    }
}

/// The file of the manifests.
pub(crate) fn body() -> Vec<u8> {
    (0..200_u32).map(|i| (i * i * 31 + 7 * i) as u8).collect()
}

pub(crate) fn digest(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().fold("sha256-".to_owned(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// What the device's kernel is for.
pub(crate) fn optics() -> Optics {
    Optics::at_distance(515_000, 150_000_000)
}

/// Optics with a place of a kind that no reader knows.
pub(crate) fn new_optics() -> Optics {
    Optics { place: format!("{} {}", "Kind_2.0-".repeat(7), "~ ".repeat(64)), ..optics() }
}

pub(crate) fn manifest() -> Manifest {
    Manifest {
        display: "pluto".to_owned(),
        optics: optics(),
        generation: 7,
        version: 12,
        format: "compact".to_owned(),
        digest: digest(&body()),
        size_bytes: body().len() as u64,
        width_px: 1920,
        height_px: 1080,
        pixel_pitch_pm: 8_000_000,
        orders: "filtered ellipse 1 0.5 0 0.2".to_owned(),
        interpolated: false,
        issued: time("2026-11-23T18:00:00Z"),
        expires: time("2026-11-30T18:00:00Z"),
    }
}

/// A manifest in which every number is the largest or smallest of its kind.
pub(crate) fn extreme_manifest() -> Manifest {
    Manifest {
        display: format!("{}Az09._-", "x".repeat(56)),
        optics: Optics::at_distance(i64::MAX, i64::MIN),
        generation: u64::MAX,
        version: u32::MAX,
        format: "-".to_owned(),
        size_bytes: u64::MAX,
        width_px: u32::MAX,
        height_px: 0,
        pixel_pitch_pm: u64::MAX,
        orders: String::new(),
        interpolated: true,
        issued: time("1970-01-01T00:00:00Z"),
        expires: time("9999-12-31T23:59:59Z"),
        ..manifest()
    }
}

/// A manifest of this size, by the length of a line that has no other limit.
pub(crate) fn manifest_of(bytes: usize) -> Manifest {
    let short = Manifest { orders: String::new(), ..manifest() };
    let length = bytes - short.signed(&key(SIGNER)).len();
    Manifest { orders: "~".repeat(length), ..short }
}

/// What a device wants to which the manifest belongs.
pub(crate) fn wanted_of(manifest: &Manifest) -> Wanted {
    Wanted {
        display: manifest.display.clone(),
        optics: manifest.optics.clone(),
        format: manifest.format.clone(),
        generation: manifest.generation - 1,
    }
}

pub(crate) fn signed_keyring(keyring: &Keyring, roots: &[u8]) -> Vec<u8> {
    let keys: Vec<SigningKey> = roots.iter().map(|&seed| key(seed)).collect();
    keyring.signed(&keys.iter().collect::<Vec<_>>()).into_bytes()
}
