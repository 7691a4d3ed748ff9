//! Pages of other sites that an operator allows to call the server (CORS).
//!
//! A browser asks the server before it sends most calls of such a page (a *preflight*), and hands an answer to the page
//! only if the server names the page's origin. The server names the origins of the setting `cors_origins`, each by
//! itself. It never accepts cookies or other credentials that a browser adds: a page sends its token itself.

use axum::extract::{Request, State};
use axum::http::{HeaderValue, Method, StatusCode, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::sync::Arc;

/// Largest number of origins: each request with an origin is compared with all of them.
const ORIGINS_MAX: usize = 32;
const METHODS: &str = "GET, HEAD, POST, PUT, DELETE";
/// Fields that calls of the API and of gRPC-Web have, besides those that browsers always allow.
const REQUEST_FIELDS: &str = "authorization, content-type, content-range, grpc-timeout, if-none-match, last-event-id, \
                              range, x-grpc-web, x-user-agent";
/// Fields of answers that pages may read, besides those that browsers always show.
const ANSWER_FIELDS: &str = "accept-ranges, content-range, etag, grpc-message, grpc-status, grpc-status-details-bin, \
                             picture-size, retry-after, x-request-id";
/// Time for which a browser may remember the answer to a preflight \[s\]. A changed setting counts after it.
const REMEMBERED_S: &str = "600";

/// Origins of pages of other sites that may call the server.
#[derive(Clone, Debug, Default)]
pub struct Origins {
    allowed: Arc<[String]>,
}

/// Why a text is no list of origins.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OriginError {
    /// An entry is no origin.
    #[error(
        "has {0:?}, which is no origin; an origin is the beginning of a page's address, in small letters and without a \
         path, such as https://dash.example or http://localhost:8000"
    )]
    Form(String),
    /// There are too many entries.
    #[error("has {0} origins, but may have {ORIGINS_MAX}")]
    Count(usize),
}

impl Origins {
    /// Reads origins separated by commas.
    ///
    /// # Errors
    ///
    /// [`OriginError`] for an entry that browsers never send as an origin, and for too many.
    pub fn parse(text: &str) -> Result<Self, OriginError> {
        let entries: Vec<&str> = text.split(',').map(str::trim).filter(|entry| !entry.is_empty()).collect();
        if entries.len() > ORIGINS_MAX {
            return Err(OriginError::Count(entries.len()));
        }
        match entries.iter().find(|entry| !is_origin(entry)) {
            Some(entry) => Err(OriginError::Form((*entry).to_owned())),
            None => Ok(Self { allowed: entries.into_iter().map(str::to_owned).collect() }),
        }
    }

    /// Whether a page of this origin may call the server.
    pub(super) fn contains(&self, origin: &str) -> bool {
        self.allowed.iter().any(|allowed| allowed == origin)
    }
}

/// Whether browsers could send this text as an origin. They leave out the usual port.
fn is_origin(text: &str) -> bool {
    let Ok(uri) = text.parse::<Uri>() else { return false };
    let usual_port = match uri.scheme_str() {
        Some("http") => 80,
        Some("https") => 443,
        _ => return false,
    };
    let Some(authority) = uri.authority() else { return false };
    let scheme_and_site = text.split_once("://").map(|(_, site)| site);
    scheme_and_site == Some(authority.as_str())
        && !authority.as_str().contains(['@', '*'])
        && authority.port_u16() != Some(usual_port)
        && text == text.to_ascii_lowercase()
}

/// Answers the preflights of allowed pages, and lets their browsers hand them the answers to their calls. Other requests
/// pass as they are: the gate refuses those of other pages.
pub(super) async fn with_cors(State(origins): State<Origins>, request: Request, next: Next) -> Response {
    let origin = request.headers().get(header::ORIGIN).cloned();
    let allowed = origin.filter(|origin| origin.to_str().is_ok_and(|origin| origins.contains(origin)));
    let is_preflight =
        request.method() == Method::OPTIONS && request.headers().contains_key(header::ACCESS_CONTROL_REQUEST_METHOD);
    let mut response = match allowed.is_some() && is_preflight {
        true => preflight(),
        false => next.run(request).await,
    };
    let fields = response.headers_mut();
    if !origins.allowed.is_empty() {
        // A browser must not hand a page what it keeps from a call of another page.
        fields.append(header::VARY, HeaderValue::from_static("origin"));
    }
    if let Some(origin) = allowed {
        fields.insert(header::ACCESS_CONTROL_ALLOW_ORIGIN, origin);
        fields.insert(header::ACCESS_CONTROL_EXPOSE_HEADERS, HeaderValue::from_static(ANSWER_FIELDS));
    }
    response
}

fn preflight() -> Response {
    let fields = [
        (header::ACCESS_CONTROL_ALLOW_METHODS, METHODS),
        (header::ACCESS_CONTROL_ALLOW_HEADERS, REQUEST_FIELDS),
        (header::ACCESS_CONTROL_MAX_AGE, REMEMBERED_S),
    ];
    (StatusCode::NO_CONTENT, fields).into_response()
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
        ] {
            assert_eq!(Origins::parse(wrong).unwrap_err(), OriginError::Form(wrong.to_owned()));
        }
        let many = vec!["https://dash.example"; ORIGINS_MAX + 1].join(",");
        assert_eq!(Origins::parse(&many).unwrap_err(), OriginError::Count(ORIGINS_MAX + 1));
    }
}
