//! Access rules: roles, and tokens with a role.
//!
//! A token consists of 256 random bits. It is shown once, when it is created. The server stores only its SHA-256, which
//! identifies the token but does not reveal it.

use sha2::{Digest, Sha256};
use std::fmt::{self, Write as _};

crate::words! {
    /// What the bearer of a token may do. Each call names the roles that may make it; no role includes another.
    pub enum Role {
        /// May read everything.
        Viewer = "viewer",
        /// May also upload, build datasets, and submit, cancel and retry jobs.
        Submitter = "submitter",
        /// May also delete datasets, import kernels and change the active version.
        Curator = "curator",
        /// May only fetch the kernels of named displays.
        Firmware = "firmware",
        /// May only serve the benches of named displays: read their patterns and upload photographs.
        Rig = "rig",
        /// May do everything, including displays, webhooks and pauses.
        Admin = "admin",
    }
}

impl Role {
    /// What the role permits, for help texts.
    #[must_use]
    pub fn purpose(self) -> &'static str {
        match self {
            Self::Viewer => "Read everything",
            Self::Submitter => "Also upload, build datasets, submit, cancel and retry jobs",
            Self::Curator => "Also delete datasets, import kernels and change the active version",
            Self::Firmware => "Only fetch the kernels of named displays",
            Self::Rig => "Only serve the benches of named displays: read their patterns, upload photographs",
            Self::Admin => "Do everything, including displays, webhooks and pauses",
        }
    }
}

/// The caller of a method.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Caller {
    /// Name of the token; empty if the server requires no tokens.
    pub name: String,
    /// Role of the token.
    pub role: Role,
    /// Ids of the displays for which the token is valid; empty: all displays.
    pub displays: Vec<String>,
}

impl Caller {
    /// The caller of a server that requires no tokens. This caller may do everything.
    #[must_use]
    pub fn without_token() -> Self {
        Self { name: String::new(), role: Role::Admin, displays: Vec::new() }
    }

    /// Whether the token is valid for this display.
    #[must_use]
    pub fn may_use(&self, display: &str) -> bool {
        self.displays.is_empty() || self.displays.iter().any(|own| own == display)
    }
}

/// Text of a token. `Debug` does not show it; [`Self::reveal`] returns it, to show it to the user once.
#[derive(Clone, PartialEq, Eq)]
pub struct Secret(String);

/// Prefix of all tokens, by which scanners for leaked secrets recognize them.
const PREFIX: &str = "lightpath_";

impl Secret {
    /// Creates a random token.
    ///
    /// # Errors
    ///
    /// An error if the system cannot supply random numbers.
    pub fn generate() -> Result<Self, getrandom::Error> {
        let mut bytes = [0; 32];
        getrandom::fill(&mut bytes)?;
        Ok(Self(format!("{PREFIX}{}", hex(&bytes))))
    }

    /// The token that a client sent.
    #[must_use]
    pub fn from_text(text: &str) -> Self {
        Self(text.to_owned())
    }

    /// SHA-256 of the token in hexadecimal digits, which the server stores.
    #[must_use]
    pub fn hash(&self) -> String {
        hex(&Sha256::digest(self.0.as_bytes()))
    }

    /// The text of the token.
    #[must_use]
    pub fn reveal(&self) -> &str {
        &self.0
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret(…)")
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_have_256_bits_and_debug_does_not_show_them() {
        let (token, other) = (Secret::generate().unwrap(), Secret::generate().unwrap());
        assert_ne!(token, other);
        assert_eq!(token.reveal().len(), PREFIX.len() + 64);
        assert_eq!(format!("{token:?}"), "Secret(…)");
        assert_eq!(Secret::from_text(token.reveal()).hash(), token.hash());
        assert!(!token.hash().contains(&token.reveal()[PREFIX.len()..]));
    }

    #[test]
    fn token_is_valid_only_for_its_displays() {
        let unscoped = Caller::without_token();
        assert!(unscoped.may_use("lab") && unscoped.role == Role::Admin);
        let scoped = Caller { displays: vec!["lab".to_owned()], ..unscoped };
        assert!(scoped.may_use("lab") && !scoped.may_use("lab-2"));
    }
}
