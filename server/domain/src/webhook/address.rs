//! Addresses of webhooks.

use crate::origin::origin_of;
use std::fmt;

/// Limit on the length of an address \[bytes\].
const URL_BYTES_MAX: usize = 2048;

/// The address of a webhook: `http` or `https`, a site, and a path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WebhookUrl {
    text: String,
    origin: String,
}

/// Why a text is no address of a webhook.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WebhookUrlError {
    /// The text is no address.
    #[error("is {0:?}, but must be an address such as https://hooks.example/lightpath, without a user and without #")]
    Form(String),
}

impl WebhookUrl {
    /// Reads an address.
    ///
    /// # Errors
    ///
    /// [`WebhookUrlError::Form`].
    pub fn parse(text: &str) -> Result<Self, WebhookUrlError> {
        let origin = origin_of(text).filter(|_| text.len() <= URL_BYTES_MAX);
        let shown = || WebhookUrlError::Form(text.chars().take(100).collect());
        origin.map(|origin| Self { text: text.to_owned(), origin }).ok_or_else(shown)
    }

    /// The address as it was given.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.text
    }

    /// Scheme, name and port, in small letters and without the usual port.
    #[must_use]
    pub fn origin(&self) -> &str {
        &self.origin
    }
}

impl fmt::Display for WebhookUrl {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::origin::Origins;

    fn allows(origins: &str, url: &str) -> bool {
        WebhookUrl::parse(url).is_ok_and(|url| Origins::parse(origins).unwrap().contains(url.origin()))
    }

    #[test]
    fn only_addresses_of_the_origins_are_allowed() {
        let origins = "https://hooks.example, http://127.0.0.1:9000,http://[::1]:9000,";
        for url in [
            "https://hooks.example",
            "https://hooks.example/a?b=c",
            "HTTPS://Hooks.Example:443/a",
            "https://hooks.example?b",
            "http://127.0.0.1:9000/",
            "http://[::1]:9000/a:b@c",
        ] {
            assert!(allows(origins, url), "{url}");
            assert!(!allows("", url), "{url}");
        }
        for url in [
            "http://hooks.example/",
            "https://hooks.example:8443/",
            "https://hooks.example.evil/",
            "https://evil/hooks.example",
            "https://a.hooks.example",
            "http://127.0.0.1/",
            "http://[::1]/",
        ] {
            assert!(WebhookUrl::parse(url).is_ok() && !allows(origins, url), "{url}");
        }
    }

    #[test]
    fn what_clients_could_read_in_two_ways_is_no_address() {
        for url in [
            "",
            "hooks.example",
            "ftp://hooks.example",
            "https://",
            "https:///a",
            "https://ada@hooks.example/",
            "https://hooks.example@evil/",
            "https://hooks.example\\@evil/",
            "https://hooks.example#@evil/",
            "https://hooks.example:443:80/",
            "https://hooks.example:0/",
            "https://hooks.example:99999/",
            "https://hooks.example: 80/",
            "https://hooks example/",
            "https://hooks.example/\n",
            "https://hökse.example/",
            "https://[::1",
            "https://[a]/",
            "https://%65vil/",
        ] {
            assert!(matches!(WebhookUrl::parse(url), Err(WebhookUrlError::Form(_))), "{url}");
        }
        assert!(WebhookUrl::parse(&format!("https://a/{}", "x".repeat(URL_BYTES_MAX))).is_err());
    }
}
