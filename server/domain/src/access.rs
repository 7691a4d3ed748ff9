//! Who may do what: roles, and the tokens that carry them.
//!
//! A token is 256 random bits. It is shown once, when it is made; the server keeps its SHA-256, which is enough to
//! recognize it and nothing to guess it from.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fmt::{self, Write as _};

/// What a token's bearer may do. Each call names the roles that may make it; none includes another by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Looks at everything.
    Viewer,
    /// Also uploads, builds datasets, submits, cancels and retries jobs.
    Submitter,
    /// Also imports kernels and moves what is active.
    Curator,
    /// Fetches the kernels of named displays, and nothing else.
    Firmware,
    /// Does everything, displays and pauses included.
    Admin,
}

impl Role {
    /// Every role.
    pub const ALL: [Self; 5] = [Self::Viewer, Self::Submitter, Self::Curator, Self::Firmware, Self::Admin];

    /// In lower case, as people and the database write it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Viewer => "viewer",
            Self::Submitter => "submitter",
            Self::Curator => "curator",
            Self::Firmware => "firmware",
            Self::Admin => "admin",
        }
    }

    /// What its bearer may do, for help texts.
    #[must_use]
    pub fn purpose(self) -> &'static str {
        match self {
            Self::Viewer => "Look at everything",
            Self::Submitter => "Also upload, build datasets, submit, cancel and retry jobs",
            Self::Curator => "Also import kernels and move what is active",
            Self::Firmware => "Fetch the kernels of named displays, and nothing else",
            Self::Admin => "Everything, displays and pauses included",
        }
    }
}

/// Who calls.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Caller {
    /// The token's name; empty where none is asked for.
    pub name: String,
    /// What it may do.
    pub role: Role,
    /// Ids of the displays that it is for; empty: all.
    pub displays: Vec<String>,
}

impl Caller {
    /// Whoever calls a server that asks for no tokens.
    #[must_use]
    pub fn anybody() -> Self {
        Self { name: String::new(), role: Role::Admin, displays: Vec::new() }
    }

    /// Whether the token is for this display.
    #[must_use]
    pub fn may_use(&self, display: &str) -> bool {
        self.displays.is_empty() || self.displays.iter().any(|own| own == display)
    }
}

/// A token's text. Never shown by `Debug`; [`Self::reveal`] is for whoever made it.
#[derive(Clone, PartialEq, Eq)]
pub struct Secret(String);

/// What tokens begin with, so that scanners for leaked secrets know them.
const PREFIX: &str = "lightpath_";

impl Secret {
    /// A new one.
    ///
    /// # Errors
    ///
    /// Where the system has no random numbers.
    pub fn generate() -> Result<Self, getrandom::Error> {
        let mut bytes = [0; 32];
        getrandom::fill(&mut bytes)?;
        Ok(Self(format!("{PREFIX}{}", hex(&bytes))))
    }

    /// The one that a client has sent.
    #[must_use]
    pub fn sent(text: &str) -> Self {
        Self(text.to_owned())
    }

    /// What the server keeps.
    #[must_use]
    pub fn hash(&self) -> String {
        hex(&Sha256::digest(self.0.as_bytes()))
    }

    /// The text itself.
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
    fn tokens_have_256_bits_and_do_not_show_themselves() {
        let (one, other) = (Secret::generate().unwrap(), Secret::generate().unwrap());
        assert_ne!(one, other);
        assert_eq!(one.reveal().len(), PREFIX.len() + 64);
        assert_eq!(format!("{one:?}"), "Secret(…)");
        assert_eq!(Secret::sent(one.reveal()).hash(), one.hash());
        assert!(!one.hash().contains(&one.reveal()[PREFIX.len()..]));
    }

    #[test]
    fn scopes_name_displays() {
        let all = Caller::anybody();
        assert!(all.may_use("lab") && all.role == Role::Admin);
        let scoped = Caller { displays: vec!["lab".to_owned()], ..all };
        assert!(scoped.may_use("lab") && !scoped.may_use("lab-2"));
    }
}
