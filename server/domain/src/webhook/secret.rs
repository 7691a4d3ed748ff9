//! Keys that sign what webhooks get.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use std::fmt;

/// Length of a key \[bytes\]: that of the hash in the signature.
const KEY_BYTES: usize = 32;
/// What a key begins with, in the form that receivers get.
const PREFIX: &str = "whsec_";

/// The key that signs what a webhook gets: `whsec_` and 256 random bits in Base64, as the
/// [Standard Webhooks](https://www.standardwebhooks.com) specification writes keys.
#[derive(Clone, PartialEq, Eq)]
pub struct WebhookSecret(String);

impl WebhookSecret {
    /// Makes a new key.
    ///
    /// # Errors
    ///
    /// The error of the operating system if it has no random numbers.
    pub fn generate() -> Result<Self, getrandom::Error> {
        let mut key = [0; KEY_BYTES];
        getrandom::fill(&mut key)?;
        Ok(Self(format!("{PREFIX}{}", STANDARD.encode(key))))
    }

    /// The key in the form that receivers get; `None` for a text in another form.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let secret = Self(text.to_owned());
        secret.key_bytes().is_some_and(|key| key.len() == KEY_BYTES).then_some(secret)
    }

    /// The form that receivers get.
    #[must_use]
    pub fn reveal(&self) -> &str {
        &self.0
    }

    /// The bytes of the key.
    #[must_use]
    pub fn key(&self) -> Vec<u8> {
        self.key_bytes().unwrap_or_default()
    }

    fn key_bytes(&self) -> Option<Vec<u8>> {
        STANDARD.decode(self.0.strip_prefix(PREFIX)?).ok()
    }
}

impl fmt::Debug for WebhookSecret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("WebhookSecret(…)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_differ_and_logs_do_not_show_them() {
        let (one, other) = (WebhookSecret::generate().unwrap(), WebhookSecret::generate().unwrap());
        assert_ne!(one, other);
        assert_eq!(WebhookSecret::parse(one.reveal()).as_ref(), Some(&one));
        assert_eq!(one.key().len(), KEY_BYTES);
        assert_eq!(format!("{one:?}"), "WebhookSecret(…)");
        for wrong in ["", "whsec_", "whsec_AAAA", "whsec_!", &one.reveal()[1..]] {
            assert_eq!(WebhookSecret::parse(wrong), None, "{wrong}");
        }
    }
}
