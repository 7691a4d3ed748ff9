//! The keys that may sign manifests.

use crate::lines::{Reader, Writer};
use crate::{DocumentError, PublicKey, Signature, SigningKey, Time};

const HEAD: &str = "lightpath keyring";
const FORMAT_VERSION: u32 = 1;

/// A key of a keyring, and the time within which its manifests count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ListedKey {
    /// The key.
    pub key: PublicKey,
    /// Time from which the key's manifests count.
    pub from: Time,
    /// Time from which they count no more.
    pub until: Time,
}

/// The keys of a server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Keyring {
    /// Number of the keyring, from 1. A device refuses a lower one than it has.
    pub version: u32,
    /// Time from which the keyring counts.
    pub issued: Time,
    /// Time from which the keyring counts no more.
    pub expires: Time,
    /// Keys that may sign the next keyring.
    pub roots: Vec<PublicKey>,
    /// Keys that may sign manifests.
    pub keys: Vec<ListedKey>,
    /// Keys that may sign manifests no more, because others may have them.
    pub revoked: Vec<PublicKey>,
}

impl Keyring {
    /// Limit on the keys of each kind, so that a keyring with all of them stays within its size.
    pub const KEYS_MAX: usize = 8;

    /// The bytes that root keys sign.
    #[must_use]
    pub fn body(&self) -> String {
        let mut writer = Writer::default()
            .line(HEAD, FORMAT_VERSION)
            .line("version", self.version)
            .line("issued", self.issued)
            .line("expires", self.expires);
        for root in &self.roots {
            writer = writer.line("root", root);
        }
        for ListedKey { key, from, until } in &self.keys {
            writer = writer.line("key", format!("{key} {from} {until}"));
        }
        for key in &self.revoked {
            writer = writer.line("revoked", key);
        }
        writer.finish()
    }

    /// The signed document. To replace a root key, the old and the new one sign.
    #[must_use]
    pub fn signed(&self, roots: &[&SigningKey]) -> String {
        let body = self.body();
        let signatures = roots.iter().map(|root| {
            let (key, signature) = (root.public(), root.sign(body.as_bytes()));
            Writer::default().line("signature", format!("{key} {signature}")).finish()
        });
        let signatures: String = signatures.collect();
        body + &signatures
    }

    /// The listed key with this id.
    #[must_use]
    pub fn key(&self, id: &str) -> Option<&ListedKey> {
        self.keys.iter().find(|listed| listed.key.id() == id)
    }
}

/// A keyring whose signatures were not checked yet: [`Trust::renew`](crate::Trust::renew) checks them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SignedKeyring {
    keyring: Keyring,
    body: String,
    signatures: Vec<(PublicKey, Signature)>,
}

impl SignedKeyring {
    /// Reads a document.
    ///
    /// # Errors
    ///
    /// [`DocumentError`] with the first line that is wrong.
    pub fn parse(bytes: &[u8]) -> Result<Self, DocumentError> {
        const KEY: &str = "64 hexadecimal digits, and at most 8 keys of a kind";
        let mut reader = Reader::new(bytes)?;
        reader.head(HEAD, FORMAT_VERSION)?;
        let mut keyring = Keyring {
            version: reader.number("version")?,
            issued: reader.time("issued")?,
            expires: reader.time("expires")?,
            roots: Vec::new(),
            keys: Vec::new(),
            revoked: Vec::new(),
        };
        while reader.comes("root") {
            let is_free = keyring.roots.len() < Keyring::KEYS_MAX;
            keyring.roots.push(reader.value("root", KEY, |text| PublicKey::parse(text).filter(|_| is_free))?);
        }
        while reader.comes("key") {
            let listed = listed(reader.text("key")?).filter(|_| keyring.keys.len() < Keyring::KEYS_MAX);
            keyring.keys.push(listed.ok_or_else(|| reader.wrong_value("key", "a key, its first and its last time"))?);
        }
        while reader.comes("revoked") {
            let is_free = keyring.revoked.len() < Keyring::KEYS_MAX;
            keyring.revoked.push(reader.value("revoked", KEY, |text| PublicKey::parse(text).filter(|_| is_free))?);
        }
        let body = reader.before().to_owned();
        let mut signatures = Vec::new();
        while signatures.is_empty() || reader.comes("signature") {
            let text = reader.text("signature")?;
            let signed = text.split_once(' ').and_then(|(key, signature)| {
                Some((PublicKey::parse(key)?, Signature::parse(signature)?))
                    .filter(|_| signatures.len() < Keyring::KEYS_MAX)
            });
            signatures.push(signed.ok_or_else(|| reader.wrong_value("signature", "a root key and its signature"))?);
        }
        reader.end()?;
        Ok(Self { keyring, body, signatures })
    }

    /// What the document says, whoever wrote it.
    #[must_use]
    pub fn unchecked(&self) -> &Keyring {
        &self.keyring
    }

    /// What the document says, if one of the keys signed it.
    pub(crate) fn verified_by(self, roots: &[PublicKey]) -> Option<Keyring> {
        let is_signed = self
            .signatures
            .iter()
            .any(|(key, signature)| roots.contains(key) && key.verifies(self.body.as_bytes(), signature));
        is_signed.then_some(self.keyring)
    }
}

/// A key, its first and its last time, in the form in which they are written.
fn listed(text: &str) -> Option<ListedKey> {
    let mut words = text.split(' ');
    let (key, from, until) = (words.next()?, words.next()?, words.next()?);
    let listed = ListedKey { key: PublicKey::parse(key)?, from: Time::parse(from)?, until: Time::parse(until)? };
    words.next().is_none().then_some(listed)
}
