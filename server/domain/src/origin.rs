//! Origins of addresses: scheme, name and port.

use std::sync::Arc;

/// Limit on the origins of a list: each request or delivery is compared with all of them.
const ORIGINS_MAX: usize = 32;

/// A list of origins that an operator allows, each by itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origins(Arc<[String]>);

/// Why a text is no list of origins.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OriginError {
    /// An entry is no origin.
    #[error(
        "has {0:?}, which is no origin; an origin is the beginning of an address, in small letters and without a path, such \
         as https://dash.example or http://localhost:8000"
    )]
    Form(String),
    /// There are too many entries.
    #[error("has {0} origins, but may have {ORIGINS_MAX}")]
    Count(usize),
}

impl Origins {
    /// Reads origins separated by commas. Each must be written as browsers send it: in small letters, without the usual
    /// port.
    ///
    /// # Errors
    ///
    /// [`OriginError`] for an entry in another form, and for too many.
    pub fn parse(text: &str) -> Result<Self, OriginError> {
        let entries: Vec<&str> = text.split(',').map(str::trim).filter(|entry| !entry.is_empty()).collect();
        if entries.len() > ORIGINS_MAX {
            return Err(OriginError::Count(entries.len()));
        }
        match entries.iter().find(|entry| origin_of(entry).as_deref() != Some(**entry)) {
            Some(entry) => Err(OriginError::Form((*entry).to_owned())),
            None => Ok(Self(entries.into_iter().map(str::to_owned).collect())),
        }
    }

    /// Whether the list has this origin.
    #[must_use]
    pub fn contains(&self, origin: &str) -> bool {
        self.0.iter().any(|allowed| allowed == origin)
    }

    /// The origins, for messages; `None`: there are none.
    #[must_use]
    pub fn list(&self) -> Option<String> {
        (!self.0.is_empty()).then(|| self.0.join(", "))
    }
}

/// The origin of an address: scheme, name and port in small letters, without the usual port. `None` for what clients
/// of HTTP could read in different ways.
pub(crate) fn origin_of(text: &str) -> Option<String> {
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

    #[test]
    fn only_exact_origins_are_allowed() {
        let origins = Origins::parse("https://dash.example, http://localhost:8000,").unwrap();
        assert!(origins.contains("https://dash.example") && origins.contains("http://localhost:8000"));
        for other in [
            "http://dash.example",
            "https://dash.example:8443",
            "https://evil.dash.example",
            "https://dash.example.evil",
            "https://dash.example/",
            "http://localhost",
            "null",
            "",
        ] {
            assert!(!origins.contains(other), "{other}");
        }
        assert!(!Origins::parse("").unwrap().contains("https://dash.example"));
        assert_eq!(Origins::parse("").unwrap().list(), None);
        assert_eq!(origins.list().as_deref(), Some("https://dash.example, http://localhost:8000"));
    }

    #[test]
    fn what_browsers_never_send_is_refused() {
        for wrong in [
            "*",
            "null",
            "dash.example",
            "https://*.dash.example",
            "https://dash.example/",
            "https://dash.example/page",
            "https://dash.example:443",
            "http://dash.example:80",
            "https://ada@dash.example",
            "HTTPS://dash.example",
            "https://Dash.example",
            "file:///tmp/page.html",
            "ws://dash.example",
            "https://*.example",
        ] {
            assert_eq!(Origins::parse(wrong).unwrap_err(), OriginError::Form(wrong.to_owned()));
        }
        let many = vec!["https://dash.example"; ORIGINS_MAX + 1].join(",");
        assert_eq!(Origins::parse(&many).unwrap_err(), OriginError::Count(ORIGINS_MAX + 1));
    }
}
