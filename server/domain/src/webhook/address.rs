//! Addresses of webhooks, and the origins to which an operator lets them go.

use std::fmt;

/// Limit on the length of an address \[bytes\].
const URL_BYTES_MAX: usize = 2048;
/// Limit on the origins of the setting.
const ORIGINS_MAX: usize = 32;

/// The address of a webhook: `http` or `https`, a site, and a path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WebhookUrl {
    text: String,
    origin: String,
}

/// Why a text is no address of a webhook, or no list of origins.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WebhookUrlError {
    /// The text is no address.
    #[error("is {0:?}, but must be an address such as https://hooks.example/lightpath, without a user and without #")]
    Form(String),
    /// An entry of a list is no origin.
    #[error("has {0:?}, which is no origin; an origin is an address without a path, such as https://hooks.example")]
    Origin(String),
    /// There are too many origins.
    #[error("has {0} origins, but may have {ORIGINS_MAX}")]
    Count(usize),
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

/// The origins to which an operator lets webhooks go.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WebhookOrigins(Vec<String>);

impl WebhookOrigins {
    /// Reads origins separated by commas.
    ///
    /// # Errors
    ///
    /// [`WebhookUrlError::Origin`] for an entry with a path, and [`WebhookUrlError::Count`] for too many entries.
    pub fn parse(text: &str) -> Result<Self, WebhookUrlError> {
        let entries: Vec<&str> = text.split(',').map(str::trim).filter(|entry| !entry.is_empty()).collect();
        if entries.len() > ORIGINS_MAX {
            return Err(WebhookUrlError::Count(entries.len()));
        }
        let origins = entries.into_iter().map(|entry| {
            let site = entry.split_once("://").map_or("", |(_, site)| site);
            let origin = origin_of(entry).filter(|_| !site.contains(['/', '?']));
            origin.ok_or_else(|| WebhookUrlError::Origin(entry.to_owned()))
        });
        origins.collect::<Result<_, _>>().map(Self)
    }

    /// Whether webhooks may go to this address.
    #[must_use]
    pub fn allow(&self, url: &WebhookUrl) -> bool {
        self.0.contains(&url.origin)
    }

    /// The origins, for messages; `None`: there are none.
    #[must_use]
    pub fn list(&self) -> Option<String> {
        (!self.0.is_empty()).then(|| self.0.join(", "))
    }
}

/// The origin of an address: scheme, name and port in small letters, without the usual port. `None` for what clients
/// of HTTP could read in different ways.
fn origin_of(text: &str) -> Option<String> {
    if !text.bytes().all(|byte| byte.is_ascii_graphic() && !b"\\#\"<>^`{|}".contains(&byte)) {
        return None;
    }
    let (scheme, rest) = text.split_once("://")?;
    let scheme = scheme.to_ascii_lowercase();
    let usual_port = match scheme.as_str() {
        "http" => 80,
        "https" => 443,
        _ => return None,
    };
    let site = rest.split(['/', '?']).next()?.to_ascii_lowercase();
    let (name, port) = match site.rsplit_once(':') {
        Some((name, port)) if !port.ends_with(']') => (name, port.parse::<u16>().ok().filter(|port| *port != 0)?),
        _ => (site.as_str(), usual_port),
    };
    let is_name = |name: &str| name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b".-_".contains(&byte));
    let is_ipv6 = |name: &str| {
        let inner = name.strip_prefix('[').and_then(|name| name.strip_suffix(']'));
        inner.is_some_and(|inner| inner.parse::<core::net::Ipv6Addr>().is_ok())
    };
    if name.is_empty() || !(is_name(name) || is_ipv6(name)) {
        return None;
    }
    Some(if port == usual_port { format!("{scheme}://{name}") } else { format!("{scheme}://{name}:{port}") })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn allows(origins: &str, url: &str) -> bool {
        WebhookUrl::parse(url).is_ok_and(|url| WebhookOrigins::parse(origins).unwrap().allow(&url))
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

    #[test]
    fn setting_has_origins_alone() {
        for wrong in ["hooks.example", "https://hooks.example/", "https://hooks.example/a", "https://*.example", "*"] {
            let refused = WebhookOrigins::parse(wrong).unwrap_err();
            assert_eq!(refused, WebhookUrlError::Origin(wrong.to_owned()));
        }
        let many = vec!["https://a"; ORIGINS_MAX + 1].join(",");
        assert_eq!(WebhookOrigins::parse(&many), Err(WebhookUrlError::Count(ORIGINS_MAX + 1)));
        assert_eq!(WebhookOrigins::parse("").unwrap().list(), None);
    }
}
