//! One attempt over HTTP.

use crate::message::Message;
use lightpath_store::WEBHOOKS_MAX;
use std::io::Read as _;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Semaphore;
use tokio::task::spawn_blocking;
use ureq::Agent;
use ureq::http::header;
use ureq::tls::{Certificate, RootCerts, TlsConfig};

/// Time limit of an attempt. A receiver should answer first and work then.
const TIMEOUT: Duration = Duration::from_secs(10);
/// Attempts at the same time, each in a thread of its own: one for each webhook that there may be, so that receivers that
/// hang make no other one wait.
const ATTEMPTS_MAX: usize = WEBHOOKS_MAX as usize;
/// Limit on the part of an answer that is kept \[bytes\].
const ANSWER_BYTES_MAX: u64 = 200;
/// Limit on the size of an answer's head \[bytes\].
const HEAD_BYTES_MAX: usize = 16 << 10;

/// What came of an attempt.
#[derive(Debug)]
pub(crate) struct Answer {
    accepted: bool,
    text: String,
}

impl Answer {
    /// The receiver accepted the delivery.
    pub(crate) fn accepted(status: u16) -> Self {
        Self { accepted: true, text: format!("HTTP {status}") }
    }

    /// The receiver did not accept it, or could not be reached.
    pub(crate) fn refused(text: String) -> Self {
        Self { accepted: false, text }
    }

    pub(crate) fn is_accepted(&self) -> bool {
        self.accepted
    }

    /// The answer for people.
    pub(crate) fn text(&self) -> &str {
        &self.text
    }
}

/// Sends messages.
#[derive(Debug)]
pub(crate) struct Sender {
    agent: Agent,
    attempts: Arc<Semaphore>,
}

impl Sender {
    /// A sender that trusts the certificate authorities of the system.
    pub(crate) fn new() -> Self {
        let found = rustls_native_certs::load_native_certs();
        for error in found.errors {
            tracing::warn!(%error, "a certificate authority of the system cannot be read; webhooks do without it");
        }
        let roots: Vec<_> = found.certs.iter().map(|root| Certificate::from_der(root).to_owned()).collect();
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let tls = TlsConfig::builder()
            .root_certs(RootCerts::new_with_certs(&roots))
            .unversioned_rustls_crypto_provider(provider)
            .build();
        let agent = Agent::config_builder()
            .http_status_as_error(false)
            // A redirect could lead to an address that the operator does not allow.
            .max_redirects(0)
            .max_redirects_will_error(false)
            // A proxy of the environment would see what is sent, and its answer would count.
            .proxy(None)
            .user_agent(concat!("lightpathd/", env!("CARGO_PKG_VERSION")))
            .accept_encoding("")
            .timeout_global(Some(TIMEOUT))
            .max_response_header_size(HEAD_BYTES_MAX)
            .tls_config(tls)
            .build()
            .new_agent();
        Self { agent, attempts: Arc::new(Semaphore::new(ATTEMPTS_MAX)) }
    }

    /// Sends a message once.
    pub(crate) async fn send(&self, url: &str, message: Message) -> Answer {
        let (agent, url, attempts) = (self.agent.clone(), url.to_owned(), Arc::clone(&self.attempts));
        // The permit moves into the thread, which works on if this future is dropped.
        let Ok(permit) = attempts.acquire_owned().await else { return Answer::refused("stopping".to_owned()) };
        let sent = spawn_blocking(move || {
            let answer = post(&agent, &url, &message);
            drop(permit);
            answer
        });
        sent.await.unwrap_or_else(|_| Answer::refused("the attempt failed within the server".to_owned()))
    }
}

fn post(agent: &Agent, url: &str, message: &Message) -> Answer {
    let Message { id, timestamp, signature, body } = message;
    let request = agent
        .post(url)
        .header(header::CONTENT_TYPE, "application/json")
        .header("webhook-id", id)
        .header("webhook-timestamp", timestamp)
        .header("webhook-signature", signature);
    match request.send(body.as_str()) {
        Ok(response) if response.status().is_success() => Answer::accepted(response.status().as_u16()),
        Ok(mut response) => {
            let mut text = Vec::new();
            // What arrived of the message is better than none.
            let _ = response.body_mut().as_reader().take(ANSWER_BYTES_MAX).read_to_end(&mut text);
            let text = one_line(&String::from_utf8_lossy(&text));
            let colon = if text.is_empty() { "" } else { ": " };
            Answer::refused(format!("HTTP {}{colon}{text}", response.status().as_u16()))
        }
        Err(error) => Answer::refused(one_line(&error.to_string())),
    }
}

/// A text without line feeds and control characters, which could change what a terminal shows.
fn one_line(text: &str) -> String {
    let plain: String = text.chars().map(|character| if character.is_control() { ' ' } else { character }).collect();
    plain.split_whitespace().collect::<Vec<_>>().join(" ")
}
