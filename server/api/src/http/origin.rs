//! Protects the server from web pages of other sites that a user's browser shows.
//!
//! A browser lets every page send requests to `localhost`. Two checks keep pages of other sites out:
//!
//! - Browsers name the page's site in the header `Origin`. It must be the server itself, or one of the origins that the
//!   operator allows (see [`super::cors`]).
//! - A site can let its own name point to 127.0.0.1 (DNS rebinding), so that the page seems to come from the server. So a
//!   server that requires no tokens answers only to its own names: IP addresses, `localhost`, and the setting `host_names`.
//!   A server with tokens needs no such check, because such a page has no token.

use crate::{fixes, status};
use axum::extract::Request;
use axum::http::header;
use axum::http::uri::Authority;
use lightpath_domain::origin::Origins;
use std::net::{Ipv4Addr, Ipv6Addr};
use tonic::{Code, Status};

/// The names to which a server answers, and the pages that may call it.
#[derive(Clone, Debug)]
pub struct Hosts {
    /// Names besides IP addresses and `localhost`, in lower case; `None`: all names.
    names: Option<Vec<String>>,
    /// Pages of other sites that may call the server.
    pages: Origins,
}

impl Hosts {
    /// Answers to all names.
    #[must_use]
    pub fn all() -> Self {
        Self { names: None, pages: Origins::default() }
    }

    /// Answers to IP addresses, to `localhost`, and to these names.
    #[must_use]
    pub fn only(names: impl IntoIterator<Item = String>) -> Self {
        let names = names.into_iter().map(|name| name.to_ascii_lowercase()).collect();
        Self { names: Some(names), pages: Origins::default() }
    }

    /// The same, with pages of other sites that may call the server.
    #[must_use]
    pub fn with_pages(self, pages: Origins) -> Self {
        Self { pages, ..self }
    }

    /// Pages of other sites that may call the server.
    pub(super) fn pages(&self) -> &Origins {
        &self.pages
    }

    /// Refuses a request to a name that is not the server's, and a request from a page of another site.
    ///
    /// # Errors
    ///
    /// PERMISSION_DENIED with the fix.
    pub(super) fn check(&self, request: &Request) -> Result<(), Status> {
        let given = host(request);
        let Some(host) = given.as_ref().and_then(|host| host.parse::<Authority>().ok()) else {
            let message = "the request has no valid Host header, so its server is unknown".to_owned();
            return Err(status::plain(Code::PermissionDenied, "WRONG_HOST", message, "send the header Host"));
        };
        if !self.contains(host.host()) {
            let message = format!(
                "this server requires no tokens, so it does not answer to the name {:?}, which another site may own; {}",
                host.host(),
                fixes::HOST
            );
            return Err(status::plain(Code::PermissionDenied, "WRONG_HOST", message, fixes::HOST));
        }
        let origins = request.headers().get_all(header::ORIGIN);
        let may_call = |origin: &str| is_same_site(origin, &host) || self.pages.contains(origin);
        if origins.iter().all(|origin| may_call(origin.to_str().unwrap_or_default())) {
            return Ok(());
        }
        let message = "the request comes from a web page of another site, whose Origin is not this server";
        let message = format!("{message}; {}", fixes::ORIGIN);
        Err(status::plain(Code::PermissionDenied, "WRONG_ORIGIN", message, fixes::ORIGIN))
    }

    fn contains(&self, host: &str) -> bool {
        let Some(names) = &self.names else { return true };
        let host = host.to_ascii_lowercase();
        let address = host.trim_start_matches('[').trim_end_matches(']');
        address.parse::<Ipv4Addr>().is_ok()
            || address.parse::<Ipv6Addr>().is_ok()
            || host == "localhost"
            || host.ends_with(".localhost")
            || names.contains(&host)
    }
}

/// The server's name in the request, with its port: `:authority` of HTTP/2, or the header `Host`. HTTP/1.1 requests may
/// have both, and then they must agree.
fn host(request: &Request) -> Option<String> {
    let mut headers = request.headers().get_all(header::HOST).iter();
    let header = headers.next().map(|value| value.to_str().map(str::to_owned));
    if headers.next().is_some() {
        return None;
    }
    match (request.uri().authority().map(Authority::to_string), header) {
        (Some(authority), None) => Some(authority),
        (None, Some(Ok(host))) => Some(host),
        (Some(authority), Some(Ok(host))) if authority.eq_ignore_ascii_case(&host) => Some(authority),
        _ => None,
    }
}

/// Whether the origin of a page, `scheme://host:port`, is the server that the page calls.
fn is_same_site(origin: &str, host: &Authority) -> bool {
    origin.split_once("://").is_some_and(|(_, site)| site.eq_ignore_ascii_case(host.as_str()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::body::Body;

    fn check(hosts: &Hosts, host: &str, origin: Option<&str>) -> bool {
        let request = Request::builder().uri("/v1/jobs").header("host", host);
        let request = origin.into_iter().fold(request, |request, origin| request.header("origin", origin));
        hosts.check(&request.body(Body::empty()).unwrap()).is_ok()
    }

    #[test]
    fn a_server_without_tokens_answers_to_its_own_names() {
        let hosts = Hosts::only(["Lab-Server".to_owned()]);
        for own in [
            "127.0.0.1:7070",
            "10.0.0.7",
            "[::1]:7070",
            "localhost:7070",
            "a.localhost",
            "lab-server:7070",
            "LOCALHOST",
        ] {
            assert!(check(&hosts, own, None), "{own}");
        }
        for other in [
            "evil.example:7070",
            "localhost.evil.example",
            "127.0.0.1.evil.example",
            "lab-server.evil.example",
            "",
            "a b",
        ] {
            assert!(!check(&hosts, other, None), "{other}");
        }
        assert!(check(&Hosts::all(), "lightpath.lab.example", None));
    }

    #[test]
    fn pages_of_other_sites_are_refused() {
        for hosts in [Hosts::all(), Hosts::only([])] {
            assert!(check(&hosts, "localhost:7070", Some("http://localhost:7070")));
            for other in [
                "http://evil.example",
                "null",
                "http://localhost:8080",
                "http://localhost",
                "https://127.0.0.1:7070",
                "",
            ] {
                assert!(!check(&hosts, "localhost:7070", Some(other)), "{other}");
            }
        }
    }

    #[test]
    fn contradicting_names_are_refused() {
        let request = |uri: &str, hosts: &[&str]| {
            let request = Request::builder().uri(uri);
            let request = hosts.iter().fold(request, |request, host| request.header("host", *host));
            Hosts::only([]).check(&request.body(Body::empty()).unwrap()).is_ok()
        };
        assert!(request("http://localhost:7070/v1/jobs", &[]) && request("http://localhost/v1/jobs", &["localhost"]));
        assert!(!request("http://localhost/v1/jobs", &["evil.example"]));
        assert!(!request("/v1/jobs", &["localhost", "evil.example"]) && !request("/v1/jobs", &[]));
    }
}
