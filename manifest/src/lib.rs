//! Signed manifests: what a server vouches for when a device fetches a kernel.
//!
//! A [`Manifest`] says which version of a kernel is active for a display, wavelength and place, and which file holds it.
//! A [`Keyring`] lists the keys that may sign manifests, and is itself signed by a root key. A device knows the
//! root key from its manufacture, keeps the newest keyring, and trusts nothing else: not the network, and not the
//! server that it asks.
//!
//! ```text
//! root key (offline, pinned in devices) ── signs ──> keyring ── lists ──> manifest keys ── sign ──> manifests ── name ──> file
//! ```
//!
//! Both documents are lines of ASCII text in a fixed order, so that equal documents have equal bytes, `curl` shows them,
//! and a microcontroller reads them without a parser's memory. Signatures are Ed25519 (RFC 8032) over all bytes of the
//! document before its first line `signature`. The first line says what a document is, so that no document can be taken
//! for another kind.
//!
//! # Attacks, and what answers each
//!
//! The names are those of The Update Framework (specification 1.0, section 1.5.2).
//!
//! | attack | answer |
//! |---|---|
//! | arbitrary software | the manifest's signature, and the file's digest in it |
//! | rollback | the generation rises with every move of `active`, rollbacks too; a device refuses a lower one |
//! | indefinite freeze | manifest and keyring expire; an answer that nothing has changed is no signature, and counts only until then |
//! | endless data | manifest and keyring have a largest size; the manifest has the file's size |
//! | extraneous dependencies | a kernel depends on no other file |
//! | mix and match | one manifest names one file; kernels of a display have one common generation, so that a device sees whether those it combines belong together |
//! | wrong software | display, optics (wavelength and place) and format stand in the manifest |
//! | malicious mirror | a mirror has no key; it can only keep a device from new kernels until the manifest expires |
//! | key compromise | a new keyring revokes a manifest key; it must be signed by a root key |
//!
//! # Layout
//!
//! - `lines`: the form that both documents share. `manifest`, `keyring`: the documents. `optics`: wavelength and place.
//!   `keys`: Ed25519 keys and their files. `trust`: what a device accepts.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod keyring;
mod keys;
mod lines;
mod manifest;
mod optics;
mod time;
mod trust;

pub use keyring::{Keyring, ListedKey, SignedKeyring};
pub use keys::{KeyError, PublicKey, Signature, SigningKey};
pub use lines::DocumentError;
pub use manifest::{Manifest, SignedManifest};
pub use optics::Optics;
pub use time::{Now, Time};
pub use trust::{Distrust, Trust, Wanted};

/// Limit on the size of a manifest and of a keyring \[bytes\]: a device can provide for it once and for all.
pub const DOCUMENT_BYTES_MAX: usize = 4096;
