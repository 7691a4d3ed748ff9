//! Ed25519 keys (RFC 8032).

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use ring::signature::{ED25519, Ed25519KeyPair, KeyPair as _, UnparsedPublicKey};
use sha2::{Digest as _, Sha256};
use std::fmt::{self, Write as _};
use std::str::FromStr;

/// Bytes before the seed in PKCS#8, version 1, of an Ed25519 key (RFC 8410, section 7).
const PKCS8_HEAD: [u8; 16] =
    [0x30, 0x2e, 0x02, 0x01, 0x00, 0x30, 0x05, 0x06, 0x03, 0x2b, 0x65, 0x70, 0x04, 0x22, 0x04, 0x20];
const PEM_BEGIN: &str = "-----BEGIN PRIVATE KEY-----";
const PEM_END: &str = "-----END PRIVATE KEY-----";

/// Reason why a key cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum KeyError {
    /// The system has no random numbers.
    #[error("the system provided no random numbers")]
    NoRandomNumbers,
    /// The text is not a key file.
    #[error(
        "the file is not an Ed25519 private key in PEM form (PKCS#8); `openssl genpkey -algorithm ed25519` makes one"
    )]
    NotPem,
}

/// A public key, written as 64 hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct PublicKey([u8; 32]);

impl PublicKey {
    /// The key with these bytes.
    #[must_use]
    pub fn from_bytes(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }

    /// The key's bytes.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8; 32] {
        &self.0
    }

    /// The key in a text of 64 lower-case hexadecimal digits.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        from_hex(text).map(Self)
    }

    /// Short name of the key: the first eight bytes of the key's SHA-256, as 16 hexadecimal digits.
    #[must_use]
    pub fn id(&self) -> String {
        to_hex(&Sha256::digest(self.0)[..8])
    }

    /// Whether the signature is this key's, over these bytes.
    #[must_use]
    pub fn verifies(&self, signed: &[u8], signature: &Signature) -> bool {
        UnparsedPublicKey::new(&ED25519, self.0).verify(signed, &signature.0).is_ok()
    }
}

impl FromStr for PublicKey {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::parse(text)
            .ok_or("a public key has 64 hexadecimal digits in lower case, as `lightpathd key list` prints it")
    }
}

impl fmt::Display for PublicKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&to_hex(&self.0))
    }
}

impl fmt::Debug for PublicKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "PublicKey({self})")
    }
}

/// A signature, written as 128 hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Signature([u8; 64]);

impl Signature {
    /// The signature with these bytes.
    #[must_use]
    pub fn from_bytes(bytes: [u8; 64]) -> Self {
        Self(bytes)
    }

    /// The signature in a text of 128 lower-case hexadecimal digits.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        from_hex(text).map(Self)
    }
}

impl fmt::Display for Signature {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&to_hex(&self.0))
    }
}

impl fmt::Debug for Signature {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Signature({self})")
    }
}

/// A private key. It is never printed.
pub struct SigningKey {
    seed: [u8; 32],
    pair: Ed25519KeyPair,
}

impl SigningKey {
    /// Makes a new key.
    ///
    /// # Errors
    ///
    /// [`KeyError::NoRandomNumbers`].
    pub fn generate() -> Result<Self, KeyError> {
        let random: [u8; 32] =
            ring::rand::generate(&ring::rand::SystemRandom::new()).map_err(|_| KeyError::NoRandomNumbers)?.expose();
        Ok(Self::from_seed(random))
    }

    /// The key of a seed.
    ///
    /// # Panics
    ///
    /// Never: every 32 bytes are a seed.
    #[must_use]
    pub fn from_seed(seed: [u8; 32]) -> Self {
        let pair = Ed25519KeyPair::from_seed_unchecked(&seed);
        Self { seed, pair: pair.unwrap_or_else(|_| unreachable!("every 32 bytes are a seed")) }
    }

    /// Reads a key file: PEM with PKCS#8, as this function's twin [`Self::to_pem`] and OpenSSL write it.
    ///
    /// # Errors
    ///
    /// [`KeyError::NotPem`].
    pub fn from_pem(text: &str) -> Result<Self, KeyError> {
        let lines = text.trim().strip_prefix(PEM_BEGIN).and_then(|rest| rest.strip_suffix(PEM_END));
        let encoded: String = lines.ok_or(KeyError::NotPem)?.split_whitespace().collect();
        let bytes = STANDARD.decode(encoded).map_err(|_| KeyError::NotPem)?;
        let seed = bytes.strip_prefix(&PKCS8_HEAD).and_then(|seed| seed.try_into().ok());
        seed.map(Self::from_seed).ok_or(KeyError::NotPem)
    }

    /// The text of a key file.
    #[must_use]
    pub fn to_pem(&self) -> String {
        let encoded = STANDARD.encode([&PKCS8_HEAD[..], &self.seed].concat());
        format!("{PEM_BEGIN}\n{encoded}\n{PEM_END}\n")
    }

    /// The public key.
    ///
    /// # Panics
    ///
    /// Never: a public key has 32 bytes.
    #[must_use]
    pub fn public(&self) -> PublicKey {
        let bytes = self.pair.public_key().as_ref().try_into();
        PublicKey(bytes.unwrap_or_else(|_| unreachable!("a public key has 32 bytes")))
    }

    /// Signs bytes. The same bytes always have the same signature.
    ///
    /// # Panics
    ///
    /// Never: a signature has 64 bytes.
    #[must_use]
    pub fn sign(&self, bytes: &[u8]) -> Signature {
        let signature = self.pair.sign(bytes);
        Signature(signature.as_ref().try_into().unwrap_or_else(|_| unreachable!("a signature has 64 bytes")))
    }
}

impl fmt::Debug for SigningKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SigningKey({})", self.public().id())
    }
}

fn to_hex(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(2 * bytes.len());
    for byte in bytes {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    text
}

fn from_hex<const N: usize>(text: &str) -> Option<[u8; N]> {
    let digit = |byte: u8| match byte {
        b'0'..=b'9' => Some(byte - b'0'),
        b'a'..=b'f' => Some(byte - b'a' + 10),
        _ => None,
    };
    let mut bytes = [0; N];
    if text.len() != 2 * N {
        return None;
    }
    for (byte, pair) in bytes.iter_mut().zip(text.as_bytes().chunks_exact(2)) {
        *byte = 16 * digit(pair[0])? + digit(pair[1])?;
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// RFC 8032, section 7.1, test 2.
    #[test]
    fn signatures_are_those_of_the_standard() {
        let seed = from_hex("4ccd089b28ff96da9db6c346ec114e0f5b8a319f35aba624da8cf6ed4fb8a6fb").unwrap();
        let key = SigningKey::from_seed(seed);
        let public = "3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c";
        assert_eq!(key.public().to_string(), public);
        let signature = "92a009a9f0d4cab8720e820b5f642540a2b27b5416503f8fb3762223ebdb69da\
                         085ac1e43e15996e458f3613d0f11d8c387b2eaeb4302aeeb00d291612bb0c00";
        assert_eq!(key.sign(b"\x72").to_string(), signature);
        assert!(key.public().verifies(b"\x72", &Signature::parse(signature).unwrap()));
        assert!(!key.public().verifies(b"\x73", &Signature::parse(signature).unwrap()));
    }

    #[test]
    fn key_file_is_read_back_and_others_are_refused() {
        let key = SigningKey::generate().unwrap();
        let pem = key.to_pem();
        assert_eq!(SigningKey::from_pem(&pem).unwrap().public(), key.public());
        assert_eq!(SigningKey::from_pem(&pem.replace('\n', "\r\n")).unwrap().public(), key.public());
        for other in ["", &pem[..60], &pem.replace("MC4C", "MC4D"), &pem.replace("PRIVATE", "PUBLIC")] {
            assert_eq!(SigningKey::from_pem(other).unwrap_err(), KeyError::NotPem, "{other}");
        }
        assert!(!format!("{key:?}").contains(&to_hex(&key.seed)));
    }

    /// A key that OpenSSL 3 wrote, and its public key.
    #[test]
    fn key_of_openssl_is_read() {
        let pem = "-----BEGIN PRIVATE KEY-----\n\
                   MC4CAQAwBQYDK2VwBCIEIEzNCJso/5banbbDRuwRTg9bijGfNaumJNqM9u1PuKb7\n-----END PRIVATE KEY-----\n";
        let public = "3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c";
        assert_eq!(SigningKey::from_pem(pem).unwrap().public().to_string(), public);
    }
}
