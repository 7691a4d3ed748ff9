//! What a device accepts.

use crate::keyring::SignedKeyring;
use crate::{DocumentError, Keyring, Manifest, Now, Optics, PublicKey, SignedManifest, Time};

/// What a device asks for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// Id of the device's display.
    pub display: String,
    /// For which light and which place. Only the digests are compared.
    pub optics: Optics,
    /// Format of the file.
    pub format: String,
    /// Generation of the manifest that the device accepted last; 0: none.
    pub generation: u64,
}

/// Reason why a device does not accept a document; the messages say what each means.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)]
pub enum Distrust {
    #[error(transparent)]
    Document(#[from] DocumentError),
    #[error("the keyring is not signed by a root key of this device")]
    KeyringSignature,
    #[error("the keyring has version {found}, but version {known} is known")]
    OlderKeyring { found: u32, known: u32 },
    #[error("the keyring has version {version} like the known one, but other keys")]
    OtherKeyring { version: u32 },
    #[error("the keyring counts from {from} until {until}, but it is {now}")]
    KeyringTime { from: Time, until: Time, now: Now },
    #[error("the manifest is signed with the key {key}, which the keyring does not list")]
    UnknownKey { key: String },
    #[error("the manifest is signed with the key {key}, which is revoked")]
    RevokedKey { key: String },
    #[error("the manifest's key counts from {from} until {until}, but it is {now}")]
    KeyTime { from: Time, until: Time, now: Now },
    #[error("the manifest's signature is wrong")]
    Signature,
    #[error("the manifest counts from {from} until {until}, but it is {now}")]
    Time { from: Time, until: Time, now: Now },
    #[error("the manifest has {name} {found}, but {wanted} was asked for")]
    Other { name: &'static str, found: String, wanted: String },
    /// The digests differ. The lines say for people in what.
    #[error("the manifest is for {found}, but {wanted} was asked for")]
    OtherOptics { found: Optics, wanted: Optics },
    #[error("the manifest has generation {found}, but generation {known} was accepted before")]
    LowerGeneration { found: u64, known: u64 },
}

/// What a device trusts: its newest keyring, and before the first one the root keys of its manufacture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Trust {
    /// Root keys from the device's manufacture.
    Roots(Vec<PublicKey>),
    /// The newest keyring.
    Keyring(Keyring),
}

impl Trust {
    /// Root keys that may sign the next keyring.
    #[must_use]
    pub fn roots(&self) -> &[PublicKey] {
        match self {
            Self::Roots(roots) => roots,
            Self::Keyring(keyring) => &keyring.roots,
        }
    }

    /// The keyring of a document, if the device accepts it. Roots of an expired keyring still count: a device that
    /// slept for a year needs them to accept the present one.
    ///
    /// # Errors
    ///
    /// [`Distrust`].
    pub fn renew(&self, bytes: &[u8], now: impl Into<Now>) -> Result<Keyring, Distrust> {
        let signed = SignedKeyring::parse(bytes)?;
        let keyring = signed.verified_by(self.roots()).ok_or(Distrust::KeyringSignature)?;
        if let Self::Keyring(known) = self {
            if keyring.version < known.version {
                return Err(Distrust::OlderKeyring { found: keyring.version, known: known.version });
            }
            if keyring.version == known.version && keyring != *known {
                return Err(Distrust::OtherKeyring { version: known.version });
            }
        }
        check_time(&keyring, now.into().not_before(keyring.issued))?;
        Ok(keyring)
    }

    /// The manifest of a document, if the device accepts it.
    ///
    /// # Errors
    ///
    /// [`Distrust`].
    pub fn manifest(&self, bytes: &[u8], wanted: &Wanted, now: impl Into<Now>) -> Result<Manifest, Distrust> {
        let signed = SignedManifest::parse(bytes)?;
        let now = now.into().not_before(signed.unchecked().issued);
        let unknown = || Distrust::UnknownKey { key: signed.key_id().to_owned() };
        let Self::Keyring(keyring) = self else { return Err(unknown()) };
        check_time(keyring, now)?;
        if keyring.revoked.iter().any(|key| key.id() == signed.key_id()) {
            return Err(Distrust::RevokedKey { key: signed.key_id().to_owned() });
        }
        let listed = *keyring.key(signed.key_id()).ok_or_else(unknown)?;
        if !now.is_within(listed.from, listed.until) {
            return Err(Distrust::KeyTime { from: listed.from, until: listed.until, now });
        }
        let manifest = signed.verified_by(&listed.key).ok_or(Distrust::Signature)?;
        if !now.is_within(manifest.issued, manifest.expires) {
            return Err(Distrust::Time { from: manifest.issued, until: manifest.expires, now });
        }
        wanted.check(&manifest)?;
        Ok(manifest)
    }
}

impl Wanted {
    fn check(&self, manifest: &Manifest) -> Result<(), Distrust> {
        let other = |name, found: &String, wanted: &String| {
            Err(Distrust::Other { name, found: found.clone(), wanted: wanted.clone() })
        };
        if manifest.display != self.display {
            return other("display", &manifest.display, &self.display);
        }
        if manifest.optics.digest() != self.optics.digest() {
            return Err(Distrust::OtherOptics { found: manifest.optics.clone(), wanted: self.optics.clone() });
        }
        if manifest.format != self.format {
            return other("format", &manifest.format, &self.format);
        }
        if manifest.generation < self.generation {
            return Err(Distrust::LowerGeneration { found: manifest.generation, known: self.generation });
        }
        Ok(())
    }
}

fn check_time(keyring: &Keyring, now: Now) -> Result<(), Distrust> {
    if !now.is_within(keyring.issued, keyring.expires) {
        return Err(Distrust::KeyringTime { from: keyring.issued, until: keyring.expires, now });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifest::tests::manifest;
    use crate::{ListedKey, SigningKey};

    fn time(text: &str) -> Time {
        Time::parse(text).unwrap()
    }

    fn now() -> Time {
        time("2026-11-24T00:00:00Z")
    }

    fn key(number: u8) -> SigningKey {
        SigningKey::from_seed([number; 32])
    }

    const ROOT: u8 = 1;
    const SIGNER: u8 = 2;

    fn listed(number: u8) -> ListedKey {
        let (from, until) = (time("2026-11-01T00:00:00Z"), time("2027-11-01T00:00:00Z"));
        ListedKey { key: key(number).public(), from, until }
    }

    fn keyring(version: u32) -> Keyring {
        Keyring {
            version,
            issued: time("2026-11-01T00:00:00Z"),
            expires: time("2026-12-01T00:00:00Z"),
            roots: vec![key(ROOT).public()],
            keys: vec![listed(SIGNER)],
            revoked: vec![key(9).public()],
        }
    }

    fn wanted() -> Wanted {
        let (display, format) = ("pluto".to_owned(), "compact".to_owned());
        Wanted { display, optics: Optics::at_distance(515_000, 150_000_000), format, generation: 6 }
    }

    fn refused(trust: &Trust, text: &str, wanted: &Wanted, now: Time) -> String {
        trust.manifest(text.as_bytes(), wanted, now).unwrap_err().to_string()
    }

    #[test]
    fn device_accepts_the_manifest_of_a_listed_key_and_names_why_it_refuses_others() {
        let trust = Trust::Keyring(keyring(1));
        let good = manifest().signed(&key(SIGNER));
        assert_eq!(trust.manifest(good.as_bytes(), &wanted(), now()), Ok(manifest()));
        let of = |number: u8| manifest().signed(&key(number));
        assert!(refused(&trust, &of(3), &wanted(), now()).contains("does not list"));
        assert!(refused(&trust, &of(9), &wanted(), now()).contains("is revoked"));
        assert!(refused(&Trust::Roots(vec![key(ROOT).public()]), &good, &wanted(), now()).contains("does not list"));
        // The body of one version with the signature of another.
        let other = Manifest { version: 11, ..manifest() }.signed(&key(SIGNER));
        let mixed = good.split("signature").next().unwrap().to_owned() + &other[other.find("signature").unwrap()..];
        assert_eq!(refused(&trust, &mixed, &wanted(), now()), "the manifest's signature is wrong");
        let late = time("2026-11-30T18:00:00Z");
        assert!(refused(&trust, &good, &wanted(), late).contains("but it is 2026-11-30T18:00:00Z"));
        assert!(
            refused(&trust, &good, &wanted(), time("2026-11-23T17:59:59Z")).starts_with("the manifest counts from")
        );
        let generation = Wanted { generation: 8, ..wanted() };
        assert!(refused(&trust, &good, &generation, now()).contains("generation 7, but generation 8"));
        for (other, name) in [
            (Wanted { display: "venus".to_owned(), ..wanted() }, "display pluto, but venus"),
            (
                Wanted { optics: Optics::at_distance(638_000, 150_000_000), ..wanted() },
                "is for wavelength_pm 515000, place distance_nm 150000000, but wavelength_pm 638000, place",
            ),
            (Wanted { optics: Optics::at_distance(515_000, 1), ..wanted() }, "place distance_nm 1 was asked for"),
            (Wanted { format: "f16".to_owned(), ..wanted() }, "format compact, but f16"),
        ] {
            assert!(refused(&trust, &good, &other, now()).contains(name));
        }
        let old_key = ListedKey { until: now(), ..listed(SIGNER) };
        let trust = Trust::Keyring(Keyring { keys: vec![old_key], ..keyring(1) });
        assert!(refused(&trust, &good, &wanted(), now()).starts_with("the manifest's key counts"));
        let trust = Trust::Keyring(Keyring { expires: time("2026-11-23T00:00:00Z"), ..keyring(1) });
        assert!(refused(&trust, &good, &wanted(), now()).starts_with("the keyring counts"));
    }

    #[test]
    fn device_without_a_clock_refuses_what_ended_before_the_latest_document() {
        let trust = Trust::Keyring(keyring(1));
        let good = manifest().signed(&key(SIGNER));
        let at = |text: &str| trust.manifest(good.as_bytes(), &wanted(), Now::AtLeast(time(text)));
        for early in ["1970-01-01T00:00:00Z", "2026-11-23T18:00:00Z", "2026-11-30T17:59:59Z"] {
            assert_eq!(at(early), Ok(manifest()), "{early}");
        }
        let refused = at("2026-11-30T18:00:00Z").unwrap_err().to_string();
        assert!(refused.ends_with("but it is 2026-11-30T18:00:00Z or later"), "{refused}");
        assert!(matches!(at("2026-12-01T00:00:00Z"), Err(Distrust::KeyringTime { .. })));
        // No key can name a time after its keyring.
        let late =
            Manifest { issued: time("2026-12-01T00:00:00Z"), expires: time("2099-01-01T00:00:00Z"), ..manifest() };
        let late = late.signed(&key(SIGNER));
        let found = trust.manifest(late.as_bytes(), &wanted(), Now::AtLeast(Time::EPOCH));
        assert!(matches!(found, Err(Distrust::KeyringTime { .. })), "{found:?}");
    }

    #[test]
    fn keyring_is_renewed_only_by_a_root_key_and_never_goes_back() {
        let trust = Trust::Roots(vec![key(ROOT).public()]);
        let first = keyring(1).signed(&[&key(ROOT)]);
        assert_eq!(trust.renew(first.as_bytes(), now()), Ok(keyring(1)));
        assert_eq!(trust.renew(keyring(1).signed(&[&key(SIGNER)]).as_bytes(), now()), Err(Distrust::KeyringSignature));
        // A line more than was signed.
        let added = first.replacen("revoked", &format!("key {} {} {}\nrevoked", key(5).public(), now(), now()), 1);
        assert_eq!(trust.renew(added.as_bytes(), now()), Err(Distrust::KeyringSignature));
        let trust = Trust::Keyring(keyring(2));
        assert_eq!(trust.renew(first.as_bytes(), now()), Err(Distrust::OlderKeyring { found: 1, known: 2 }));
        assert!(trust.renew(keyring(2).signed(&[&key(ROOT)]).as_bytes(), now()).is_ok());
        let other = Keyring { keys: vec![], ..keyring(2) }.signed(&[&key(ROOT)]);
        assert_eq!(trust.renew(other.as_bytes(), now()), Err(Distrust::OtherKeyring { version: 2 }));
        let late = time("2026-12-01T00:00:00Z");
        assert!(matches!(
            trust.renew(keyring(3).signed(&[&key(ROOT)]).as_bytes(), late),
            Err(Distrust::KeyringTime { .. })
        ));
        // A new root key: the old one signs the keyring that lists the new one.
        let moved = Keyring { roots: vec![key(4).public()], ..keyring(3) };
        let accepted = trust.renew(moved.signed(&[&key(ROOT), &key(4)]).as_bytes(), now()).unwrap();
        let trust = Trust::Keyring(accepted);
        assert!(trust.renew(keyring(4).signed(&[&key(ROOT)]).as_bytes(), now()).is_err());
        assert!(trust.renew(keyring(4).signed(&[&key(4)]).as_bytes(), now()).is_ok());
    }

    #[test]
    fn largest_keyring_fits_its_limit() {
        let all = |from: u8| (from..from + 8).map(key).collect::<Vec<_>>();
        let public = |keys: &[SigningKey]| keys.iter().map(SigningKey::public).collect::<Vec<_>>();
        let largest = Keyring {
            version: u32::MAX,
            roots: public(&all(1)),
            keys: (11..19).map(listed).collect(),
            revoked: public(&all(21)),
            ..keyring(1)
        };
        let text = largest.signed(&all(1).iter().collect::<Vec<_>>());
        assert!(text.len() <= crate::DOCUMENT_BYTES_MAX, "{}", text.len());
        assert_eq!(Trust::Roots(public(&all(1))).renew(text.as_bytes(), now()), Ok(largest));
    }
}
