//! Which keyrings and manifests the agent accepts.

use crate::problem::Problem;
use crate::{Settings, durable, log, regular_file};
use lightpath_manifest::{
    DOCUMENT_BYTES_MAX, Distrust, Keyring, Manifest, Now, PublicKey, SignedKeyring, SignedManifest, Time, Trust, Wanted,
};
use std::io::{self, Read as _};
use std::path::Path;

/// Share of a keyring's time, at its end, in which the agent asks for the next one.
const RENEWAL_SHARE: i64 = 8;

/// What the agent trusts, and the bytes of the keyring.
#[derive(Debug)]
pub(crate) struct Vouching {
    pub(crate) trust: Trust,
    /// The document of the keyring; empty before the first one.
    pub(crate) document: Vec<u8>,
}

impl Vouching {
    /// Trust in the pinned root keys alone.
    pub(crate) fn pinned(settings: &Settings) -> Self {
        Self { trust: Trust::Roots(settings.roots.clone()), document: Vec::new() }
    }

    /// Trust in the stored keyring, and in the pinned root keys without one. `earlier_roots` are those that were pinned
    /// when the keyring was accepted. Keys that lead to none of these are those of another server: the operator has
    /// changed them.
    pub(crate) fn load(path: &Path, settings: &Settings, earlier_roots: &str) -> Self {
        let pinned = Self::pinned(settings);
        let document = match read_document(path) {
            Ok(document) => document,
            Err(error) => {
                if error.kind() != io::ErrorKind::NotFound {
                    log::line(format_args!("the agent cannot read {}: {error}", path.display()));
                }
                return pinned;
            }
        };
        let Some(keyring) = intact(&document) else {
            log::line(format_args!("the agent ignores {}, because the file is damaged", path.display()));
            return pinned;
        };
        let is_of_this_server = |root: &PublicKey| {
            keyring.roots.contains(root) || earlier_roots.split(',').any(|text| text == root.to_string())
        };
        if !earlier_roots.is_empty() && !settings.roots.iter().any(is_of_this_server) {
            log::line("the agent forgets the keyring, because it belongs to other root keys than those of --root");
            return pinned;
        }
        Self { trust: Trust::Keyring(keyring), document }
    }

    pub(crate) fn keyring(&self) -> Option<&Keyring> {
        match &self.trust {
            Trust::Keyring(keyring) => Some(keyring),
            Trust::Roots(_) => None,
        }
    }

    /// Whether the keyring is missing, or its end is near.
    pub(crate) fn must_be_renewed(&self, now: Time) -> bool {
        self.keyring().is_none_or(|keyring| {
            let (from, until) = (keyring.issued.unix_s(), keyring.expires.unix_s());
            now.unix_s() >= until - (until - from) / RENEWAL_SHARE
        })
    }

    /// Accepts a keyring of the server and keeps it. `known` is the highest version that was accepted before.
    pub(crate) fn renew(&mut self, document: Vec<u8>, known: u32, now: Now, path: &Path) -> Result<(), Problem> {
        let keyring = self.trust.renew(&document, now).map_err(Problem::Keyring)?;
        if keyring.version < known {
            return Err(Problem::OlderKeyring { found: keyring.version, known });
        }
        if document != self.document {
            durable::write_file(path, &document).map_err(Problem::disk("write", path))?;
            log::line(format_args!("the agent accepted version {} of the keyring", keyring.version));
        }
        (self.trust, self.document) = (Trust::Keyring(keyring), document);
        Ok(())
    }
}

/// The manifest of an installed kernel, if the keyring beside it vouches for it. The time does not matter: what counted
/// when it was installed stays good.
pub(crate) fn installed_manifest(manifest: &[u8], keyring: &[u8], wanted: &Wanted) -> Result<Manifest, Distrust> {
    let said = SignedManifest::parse(manifest)?;
    let keyring = intact(keyring).ok_or(Distrust::KeyringSignature)?;
    // All three counted when the manifest was accepted, so they count when the last of them begins.
    let listed = keyring.key(said.key_id()).map_or(keyring.issued, |listed| listed.from);
    let at = said.unchecked().issued.max(keyring.issued).max(listed);
    Trust::Keyring(keyring).manifest(manifest, wanted, at)
}

/// The keyring of a document from the disk, if its bytes are those that were stored: one of its signatures is right,
/// whoever made it. Which keys may sign was checked when the document came from the server; the disk is trusted, but it
/// may be damaged.
fn intact(document: &[u8]) -> Option<Keyring> {
    let said = SignedKeyring::parse(document).ok()?;
    let text = std::str::from_utf8(document).ok()?;
    let signers = text.lines().filter_map(|line| line.strip_prefix("signature ")?.split(' ').next());
    let signers = signers.filter_map(PublicKey::parse).collect();
    Trust::Roots(signers).renew(document, said.unchecked().issued).ok()
}

/// Reads a manifest or a keyring from the disk.
pub(crate) fn read_document(path: &Path) -> io::Result<Vec<u8>> {
    let mut document = Vec::new();
    // One byte more is enough for the check of the size to refuse it.
    regular_file::open(path)?.take(DOCUMENT_BYTES_MAX as u64 + 1).read_to_end(&mut document)?;
    Ok(document)
}
