//! Calls of the server.

use crate::problem::Problem;
use crate::settings::Settings;
use crate::tls;
use lightpath_manifest::{DOCUMENT_BYTES_MAX, Manifest};
use std::cell::RefCell;
use std::fmt;
use std::fs;
use std::io::Read as _;
use std::net::IpAddr;
use std::time::Duration;
use ureq::http::{HeaderMap, Response, header};
use ureq::{Agent, Body};

/// Size of the pieces in which bytes come from the network and go to the disk \[bytes\].
pub(crate) const PIECE_BYTES: usize = 32 << 10;
/// Time after which to ask again when the server names none.
const POLL_AFTER_DEFAULT: Duration = Duration::from_secs(60);
/// Limits on the time that a server may name \[s\]. They are those of its setting `poll_interval_s`.
const POLL_AFTER_S: (u64, u64) = (1, 86_400);
/// Limit on the size of a list of kernels \[bytes\]: at most ten, of less than a kilobyte each.
const LIST_BYTES_MAX: u64 = 64 << 10;
/// Limit on the size of an error that is read \[bytes\].
const ERROR_BYTES_MAX: u64 = 8 << 10;
/// Limit on the length of a server's message in the log \[characters\].
const MESSAGE_CHARS_MAX: usize = 300;
/// Limit on the size of an answer's head \[bytes\].
const HEAD_BYTES_MAX: usize = 16 << 10;

/// A document of the server, as it was received.
#[derive(Debug)]
pub(crate) struct Document {
    pub(crate) bytes: Vec<u8>,
    pub(crate) etag: Option<String>,
}

/// Answer to a question for the manifest.
#[derive(Debug)]
pub(crate) struct Answer {
    /// `None`: nothing has changed.
    pub(crate) document: Option<Document>,
    /// Time after which to ask again.
    pub(crate) poll_after: Duration,
}

/// The server.
pub(crate) struct Http {
    settings: Settings,
    connections: RefCell<Connections>,
}

/// Connections, and the files that they were made with.
struct Connections {
    files: tls::Files,
    agent: Agent,
}

impl fmt::Debug for Http {
    // Without the private key.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Http").field("settings", &self.settings).finish_non_exhaustive()
    }
}

impl Http {
    pub(crate) fn new(settings: &Settings) -> Result<Self, Problem> {
        require_private(settings)?;
        let connections = Connections::new(tls::Files::read(settings)?, settings)?;
        Ok(Self { settings: settings.clone(), connections: RefCell::new(connections) })
    }

    /// Asks for the manifest, unless it is still the one with this ETag; empty: in any case. The server may wait for a
    /// change.
    pub(crate) fn manifest(&self, kernel: &str, etag: &str, wait: Duration) -> Result<Answer, Problem> {
        let Settings { display, format, device, .. } = &self.settings;
        let wait_s = wait.as_secs();
        let path =
            format!("/v1/displays/{display}/kernels/{kernel}/manifest?format={format}&device={device}&wait_s={wait_s}");
        let headers: &[_] = if etag.is_empty() { &[] } else { &[(header::IF_NONE_MATCH, etag.to_owned())] };
        let response = self.get(&path, headers, wait, wait + self.settings.pace.answer)?;
        let poll_after = poll_after(response.headers());
        if response.status() == 304 {
            if etag.is_empty() {
                return Err(Problem::Unasked);
            }
            return Ok(Answer { document: None, poll_after });
        }
        Ok(Answer { document: Some(self.document("the manifest", response)?), poll_after })
    }

    /// Asks for the keyring.
    pub(crate) fn keyring(&self) -> Result<Document, Problem> {
        let response = self.get("/v1/keyring", &[], Duration::ZERO, self.settings.pace.answer)?;
        self.document("the keyring", response)
    }

    /// Asks for the display's kernels that a query names.
    pub(crate) fn kernels(&self, query: &str) -> Result<Vec<serde_json::Value>, Problem> {
        let path = format!("/v1/displays/{}/kernels?{query}", self.settings.display);
        let mut response = self.get(&path, &[], Duration::ZERO, self.settings.pace.answer)?;
        if response.status() != 200 {
            return Err(self.refusal("the list of kernels", response));
        }
        let mut bytes = Vec::new();
        let mut body = response.body_mut().as_reader().take(LIST_BYTES_MAX);
        body.read_to_end(&mut bytes).map_err(|error| self.unreachable(&error.into()))?;
        let answer: Option<serde_json::Value> = serde_json::from_slice(&bytes).ok();
        let answer = answer.filter(serde_json::Value::is_object);
        let mut answer = answer.ok_or_else(|| Problem::NoList { server: self.settings.server.clone() })?;
        match answer["kernels"].take() {
            serde_json::Value::Array(kernels) => Ok(kernels),
            _ => Ok(Vec::new()),
        }
    }

    /// Asks for the bytes of a file from `first` on. The answer has status 200, 206 or 416, and ends within `limit`.
    pub(crate) fn file(
        &self,
        kernel: &str,
        manifest: &Manifest,
        first: u64,
        limit: Duration,
    ) -> Result<Response<Body>, Problem> {
        let Manifest { version, format, digest, .. } = manifest;
        let display = &self.settings.display;
        let path = format!("/v1/displays/{display}/kernels/{kernel}/versions/{version}/{format}/{digest}");
        // The path names the bytes. A web server for files, which knows no digests, would refuse one in If-Range.
        let range = [(header::RANGE, format!("bytes={first}-"))];
        let response = self.get(&path, if first == 0 { &[] } else { &range }, Duration::ZERO, limit)?;
        match response.status().as_u16() {
            200 | 206 | 416 => Ok(response),
            _ => Err(self.refusal("the file", response)),
        }
    }

    /// Tells the server what the device uses.
    pub(crate) fn report(&self, json: &str) -> Result<(), Problem> {
        let Settings { server, display, device, .. } = &self.settings;
        let mut request = self
            .agent()?
            .post(format!("{server}/v1/displays/{display}/devices/{device}:report"))
            .header(header::CONTENT_TYPE, "application/json");
        if let Some(token) = self.token()? {
            request = request.header(header::AUTHORIZATION, token);
        }
        let request = request.config().timeout_per_call(Some(self.settings.pace.answer)).build();
        let response = request.send(json).map_err(|error| self.unreachable(&error))?;
        if response.status().is_success() { Ok(()) } else { Err(self.refusal("the report", response)) }
    }

    /// Asks for something. The answer begins within `wait` and the time in which nothing may arrive, and all of it is there
    /// within `limit`, however slowly its bytes come.
    fn get(
        &self,
        path: &str,
        headers: &[(header::HeaderName, String)],
        wait: Duration,
        limit: Duration,
    ) -> Result<Response<Body>, Problem> {
        let mut request = self.agent()?.get(format!("{}{path}", self.settings.server));
        for (name, value) in headers {
            request = request.header(name, value);
        }
        if let Some(token) = self.token()? {
            request = request.header(header::AUTHORIZATION, token);
        }
        let silence = Some(wait + self.settings.pace.stall);
        let config = request.config().timeout_recv_response(silence).timeout_per_read(silence);
        config.timeout_per_call(Some(limit)).build().call().map_err(|error| self.unreachable(&error))
    }

    /// The connections, made anew if the files of certificates have changed.
    fn agent(&self) -> Result<Agent, Problem> {
        let files = tls::Files::read(&self.settings)?;
        let mut connections = self.connections.borrow_mut();
        if connections.files != files {
            *connections = Connections::new(files, &self.settings)?;
        }
        Ok(connections.agent.clone())
    }

    fn document(&self, what: &'static str, mut response: Response<Body>) -> Result<Document, Problem> {
        if response.status() != 200 {
            return Err(self.refusal(what, response));
        }
        let etag = response.headers().get(header::ETAG).and_then(|etag| etag.to_str().ok()).map(str::to_owned);
        let mut bytes = Vec::new();
        // One byte more is enough for the check of the size to refuse it.
        let mut body = response.body_mut().as_reader().take(DOCUMENT_BYTES_MAX as u64 + 1);
        body.read_to_end(&mut bytes).map_err(|error| self.unreachable(&error.into()))?;
        Ok(Document { bytes, etag })
    }

    /// The header with the token.
    fn token(&self) -> Result<Option<String>, Problem> {
        let Some(path) = &self.settings.token_file else { return Ok(None) };
        let wrong = |reason: String| Problem::Setting(format!("the token file {} {reason}", path.display()));
        let text = fs::read_to_string(path).map_err(|error| wrong(format!("cannot be read: {error}")))?;
        let token = text.trim();
        if token.is_empty() || !token.bytes().all(|byte| byte.is_ascii_graphic()) {
            return Err(wrong("must have one line with the token".to_owned()));
        }
        Ok(Some(format!("Bearer {token}")))
    }

    fn unreachable(&self, error: &ureq::Error) -> Problem {
        let reason = reason_of(error);
        // TLS 1.3 and 1.2 name the refusal of a client without a certificate differently.
        let is_asked = reason.contains("CertificateRequired") || reason.contains("HandshakeFailure");
        let fix = match &self.settings.client {
            None if is_asked => "; it may ask for a client certificate: give --client-cert and --client-key",
            _ => "",
        };
        Problem::Unreachable { server: self.settings.server.clone(), reason: reason + fix }
    }

    fn refusal(&self, what: &'static str, mut response: Response<Body>) -> Problem {
        let status = response.status().as_u16();
        let retry_after =
            response.headers().get(header::RETRY_AFTER).and_then(|value| value.to_str().ok()?.parse().ok());
        let retry_after = retry_after.map(|seconds: u64| Duration::from_secs(seconds.min(POLL_AFTER_S.1)));
        let mut body = Vec::new();
        // What arrived of the message is better than none.
        let _ = response.body_mut().as_reader().take(ERROR_BYTES_MAX).read_to_end(&mut body);
        let message = message_of(&body);
        match status {
            401 | 403 => Problem::Token { status, message, fix: self.fix() },
            _ => Problem::Refused { what, status, message, retry_after },
        }
    }

    fn fix(&self) -> String {
        let Settings { device, display, token_file, .. } = &self.settings;
        let file = match token_file {
            Some(path) => format!("put it into {}", path.display()),
            None => "name its file with --token-file".to_owned(),
        };
        format!(
            "make one on the server with `lightpathd token create {device} --role firmware --display {display}`, \
             and {file}"
        )
    }
}

impl Connections {
    fn new(files: tls::Files, settings: &Settings) -> Result<Self, Problem> {
        let pace = settings.pace;
        let mut config = Agent::config_builder()
            .http_status_as_error(false)
            // No address of this server leads elsewhere, and the token must not go elsewhere.
            .max_redirects(0)
            .user_agent(user_agent())
            .accept_encoding("")
            .timeout_connect(Some(pace.connect))
            .timeout_resolve(Some(pace.connect))
            .timeout_per_read(Some(pace.stall))
            .timeout_per_write(Some(pace.stall))
            .max_response_header_size(HEAD_BYTES_MAX)
            .input_buffer_size(PIECE_BYTES)
            .output_buffer_size(4 << 10)
            .max_idle_connections(1);
        if settings.server.starts_with("https:") {
            config = config.tls_config(files.config(settings)?);
        }
        Ok(Self { files, agent: config.build().new_agent() })
    }
}

/// Why a call failed, in words.
pub(crate) fn reason_of(error: &ureq::Error) -> String {
    match error {
        ureq::Error::Timeout(ureq::Timeout::PerCall) => "timeout: the whole answer took too long".to_owned(),
        ureq::Error::Timeout(ureq::Timeout::PerRead | ureq::Timeout::RecvResponse) => {
            "timeout: nothing came for too long".to_owned()
        }
        _ => error.to_string(),
    }
}

/// Name and version of the agent.
pub(crate) fn user_agent() -> &'static str {
    concat!("lightpath-agent ", env!("CARGO_PKG_VERSION"))
}

fn poll_after(headers: &HeaderMap) -> Duration {
    let seconds = headers.get("lightpath-poll-after-s").and_then(|value| value.to_str().ok()?.parse::<u64>().ok());
    seconds.map_or(POLL_AFTER_DEFAULT, |seconds| Duration::from_secs(seconds.clamp(POLL_AFTER_S.0, POLL_AFTER_S.1)))
}

/// The message of an error, in one line of printable characters.
fn message_of(body: &[u8]) -> String {
    let json: Option<serde_json::Value> = serde_json::from_slice(body).ok();
    let message = json.as_ref().and_then(|json| json["detail"].as_str()).map(str::to_owned);
    let message = message.unwrap_or_else(|| String::from_utf8_lossy(body).into_owned());
    one_line(&message, MESSAGE_CHARS_MAX)
}

/// A text without line feeds and control characters, cut to a length.
pub(crate) fn one_line(text: &str, chars_max: usize) -> String {
    let plain: String = text.chars().map(|character| if character.is_control() { ' ' } else { character }).collect();
    let words: Vec<&str> = plain.split_whitespace().collect();
    words.join(" ").chars().take(chars_max).collect()
}

/// Refuses to send a token where everybody on the way could read it, and a certificate where nobody asks for it.
fn require_private(settings: &Settings) -> Result<(), Problem> {
    let Some(rest) = settings.server.strip_prefix("http://") else { return Ok(()) };
    if settings.client.is_some() {
        return Err(Problem::Setting(format!(
            "{} has no TLS, which the certificate of --client-cert is for: use https://, or leave it out",
            settings.server
        )));
    }
    let authority = rest.split('/').next().unwrap_or("");
    let host = match authority.strip_prefix('[') {
        Some(bracketed) => bracketed.split(']').next().unwrap_or(""),
        None => authority.split(':').next().unwrap_or(""),
    };
    let is_local = host == "localhost" || host.parse::<IpAddr>().is_ok_and(|address| address.is_loopback());
    match &settings.token_file {
        Some(path) if !is_local => Err(Problem::Setting(format!(
            "{} would send the token of {} unencrypted to {host}: use https://, or leave out --token-file",
            settings.server,
            path.display()
        ))),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::{Cli, Task};

    #[test]
    fn a_token_goes_unencrypted_to_this_machine_only() {
        let root = "3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c";
        for (server, token, is_accepted) in [
            ("https://lab:7070", true, true),
            ("http://lab:7070", false, true),
            ("http://lab:7070", true, false),
            ("http://127.0.0.1.example.org", true, false),
            ("http://10.0.0.7/mirror", true, false),
            ("http://localhost:7070", true, true),
            ("http://127.0.0.5:7070/path", true, true),
            ("http://[::1]:7070", true, true),
            ("http://[2001:db8::1]:7070", true, false),
        ] {
            let mut line = format!(
                "lightpath-agent --server {server} --display pluto --device bench-7 --wavelength 515nm --distance 150mm \
                 --root {root} --directory /x"
            );
            if token {
                line += " --token-file /etc/token";
            }
            let Ok(Task::Run(arguments)) = Cli::task(line.split_whitespace().map(Into::into)) else { panic!("{line}") };
            let found = require_private(&arguments.settings().unwrap()[0]);
            assert_eq!(found.is_ok(), is_accepted, "{server}: {found:?}");
            if let Err(problem) = found {
                assert!(problem.to_string().contains("use https://"), "{problem}");
            }
        }
    }

    #[test]
    fn messages_of_a_server_are_one_line() {
        assert_eq!(message_of(b"{\"detail\": \"no\\nkernel\"}"), "no kernel");
        assert_eq!(message_of(b"<html>\r\n\x1b[1mbad gateway"), "<html> [1mbad gateway");
        assert_eq!(message_of(&[b'x'; 4000]).len(), MESSAGE_CHARS_MAX);
    }

    #[test]
    fn server_names_the_next_poll_within_limits() {
        for (value, seconds) in [("7", 7), ("0", 1), ("999999999", 86_400), ("soon", 60), ("-1", 60)] {
            let headers: HeaderMap =
                [("lightpath-poll-after-s".parse().unwrap(), value.parse().unwrap())].into_iter().collect();
            assert_eq!(poll_after(&headers).as_secs(), seconds, "{value}");
        }
        assert_eq!(poll_after(&HeaderMap::new()), POLL_AFTER_DEFAULT);
    }
}
