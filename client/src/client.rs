//! The connection to a server.

use crate::v1::artifact_service_client::ArtifactServiceClient;
use crate::v1::dataset_service_client::DatasetServiceClient;
use crate::v1::device_service_client::DeviceServiceClient;
use crate::v1::display_service_client::DisplayServiceClient;
use crate::v1::event_service_client::EventServiceClient;
use crate::v1::job_service_client::JobServiceClient;
use crate::v1::kernel_service_client::KernelServiceClient;
use crate::v1::photo_service_client::PhotoServiceClient;
use crate::v1::rig_service_client::RigServiceClient;
use crate::v1::rollout_service_client::RolloutServiceClient;
use crate::v1::server_service_client::ServerServiceClient;
use crate::v1::webhook_service_client::WebhookServiceClient;
use crate::{Error, Result};
use std::fmt;
use std::net::IpAddr;
use std::time::Duration;
use tonic::metadata::{Ascii, MetadataValue};
use tonic::service::Interceptor;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::{Certificate, Channel, ClientTlsConfig, Endpoint, Identity};

/// Time limit for connecting. A server that takes longer counts as unreachable.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// Interval between probes of a silent connection. They let a watch notice that the server's machine is gone.
const KEEP_ALIVE_INTERVAL: Duration = Duration::from_secs(20);

/// Time limit for the answer to a probe. Without an answer the connection is closed.
const KEEP_ALIVE_TIMEOUT: Duration = Duration::from_secs(10);

/// Time limit for the answer to a call that does not stream.
pub(crate) const CALL_TIMEOUT: Duration = Duration::from_secs(60);

/// Longest wait for the answer of a call that first makes all files that devices will need, or measures photographs.
pub(crate) const PREPARING_TIMEOUT: Duration = Duration::from_secs(600);

/// Largest accepted answer. A page of 1000 jobs with their loss histories fits; the limit bounds the client's memory.
const MESSAGE_BYTES_MAX: usize = 64 << 20;

/// A client of one Lightpath server. Cheap to clone; clones share one connection.
///
/// The first call connects. Later calls reconnect if the connection was lost.
#[derive(Clone)]
pub struct Client {
    url: String,
    transport: Transport,
}

pub(crate) type Transport = InterceptedService<Channel, Bearer>;

/// Credentials that a server may require. The default is none.
#[derive(Clone, Default)]
pub struct Credentials {
    /// Access token. The client sends it with each call.
    pub token: Option<String>,
    /// Certificate (PEM) of the authority that signed the server's certificate. Needed if the system does not trust it
    /// already.
    pub authority_pem: Option<Vec<u8>>,
    /// Certificate and private key (PEM) of the client, for a server that requires a client certificate.
    pub certificate_and_key_pem: Option<(Vec<u8>, Vec<u8>)>,
    /// Whether the token may go unencrypted to another machine, because nobody else is on the network.
    pub token_over_http: bool,
}

/// Hides the token and the key.
impl fmt::Debug for Credentials {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Credentials").finish_non_exhaustive()
    }
}

/// Adds the token to each call.
#[derive(Clone)]
pub(crate) struct Bearer {
    authorization: Option<MetadataValue<Ascii>>,
}

impl Client {
    /// Creates a client of the server at `url`, for example `http://127.0.0.1:7070` or `https://lab:7070`.
    ///
    /// Call it on a Tokio runtime. The client connects with its first call.
    ///
    /// # Errors
    ///
    /// [`Error::Url`] when `url` is not an `http://` or `https://` address.
    pub fn connect(url: &str) -> Result<Self> {
        Self::connect_as(url, &Credentials::default())
    }

    /// Creates a client like [`Self::connect`] that sends `token` as the bearer token of each call.
    ///
    /// # Errors
    ///
    /// [`Error::Url`] when `url` is not an `http://` or `https://` address. [`Error::Token`] when the token is empty or
    /// has characters other than printable ASCII. [`Error::OpenToken`] for `http://` to another machine.
    pub fn connect_with_token(url: &str, token: &str) -> Result<Self> {
        Self::connect_as(url, &Credentials { token: Some(token.to_owned()), ..Credentials::default() })
    }

    /// Creates a client like [`Self::connect`] that uses `credentials`.
    ///
    /// # Errors
    ///
    /// [`Error::Url`] when `url` is malformed or a certificate cannot be used. [`Error::Token`] when the token is empty
    /// or has characters other than printable ASCII. [`Error::OpenToken`] when it would go unencrypted to another
    /// machine.
    pub fn connect_as(url: &str, credentials: &Credentials) -> Result<Self> {
        let authorization = credentials.token.as_deref().map(authorization).transpose()?;
        let endpoint = endpoint(url, credentials)?;
        let is_encrypted = endpoint.uri().scheme_str() == Some("https");
        if authorization.is_some() && !credentials.token_over_http && !is_encrypted && !is_local(endpoint.uri().host())
        {
            return Err(Error::OpenToken { url: url.to_owned() });
        }
        let channel = endpoint.connect_lazy();
        Ok(Self { url: url.to_owned(), transport: InterceptedService::new(channel, Bearer { authorization }) })
    }

    /// The server's address, as the caller gave it.
    #[must_use]
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Converts the status of a failed call into an error.
    pub(crate) fn error(&self, status: tonic::Status) -> Error {
        Error::from_status(&self.url, status)
    }
}

/// The generated clients of the services.
macro_rules! services {
    ($($name:ident: $client:ident;)*) => {
        impl Client {
            $(pub(crate) fn $name(&self) -> $client<Transport> {
                $client::new(self.transport.clone()).max_decoding_message_size(MESSAGE_BYTES_MAX)
            })*
        }
    };
}

services! {
    artifacts: ArtifactServiceClient;
    datasets: DatasetServiceClient;
    devices: DeviceServiceClient;
    displays: DisplayServiceClient;
    events: EventServiceClient;
    jobs: JobServiceClient;
    kernels: KernelServiceClient;
    photos: PhotoServiceClient;
    rigs: RigServiceClient;
    rollouts: RolloutServiceClient;
    webhooks: WebhookServiceClient;
    server: ServerServiceClient;
}

fn authorization(token: &str) -> Result<MetadataValue<Ascii>> {
    let token = token.trim();
    if token.is_empty() || !token.bytes().all(|byte| byte.is_ascii_graphic()) {
        return Err(Error::Token);
    }
    let mut authorization = MetadataValue::try_from(format!("Bearer {token}")).map_err(|_| Error::Token)?;
    authorization.set_sensitive(true);
    Ok(authorization)
}

/// Wraps a message in a request with a time limit.
pub(crate) fn with_timeout<T>(message: T, limit: Duration) -> tonic::Request<T> {
    let mut request = tonic::Request::new(message);
    request.set_timeout(limit);
    request
}

fn endpoint(url: &str, credentials: &Credentials) -> Result<Endpoint> {
    let url_error = |reason: String| Error::Url { url: url.to_owned(), reason };
    let is_tls = match url.split_once("://") {
        Some(("http", rest)) if !rest.is_empty() => false,
        Some(("https", rest)) if !rest.is_empty() => true,
        Some(_) => return Err(url_error("must look like http://127.0.0.1:7070".to_owned())),
        None => return Err(url_error(format!("has no scheme: write http://{url}"))),
    };
    let mut endpoint = Endpoint::from_shared(url.to_owned())
        .and_then(|endpoint| endpoint.user_agent(concat!("lightpath/", env!("CARGO_PKG_VERSION"))))
        .map_err(|error| url_error(format!("is malformed ({error}): write http://127.0.0.1:7070")))?;
    if is_tls {
        let tls = tls(credentials);
        endpoint = endpoint.tls_config(tls).map_err(|error| url_error(format!("cannot be reached by TLS: {error}")))?;
    }
    Ok(endpoint
        .connect_timeout(CONNECT_TIMEOUT)
        .http2_keep_alive_interval(KEEP_ALIVE_INTERVAL)
        .keep_alive_timeout(KEEP_ALIVE_TIMEOUT))
}

/// Whether a host is this machine.
fn is_local(host: Option<&str>) -> bool {
    let host = host.unwrap_or_default().trim_start_matches('[').trim_end_matches(']');
    host.eq_ignore_ascii_case("localhost") || host.parse().is_ok_and(|address: IpAddr| address.is_loopback())
}

/// TLS settings: the authorities that the system trusts, plus the credentials.
fn tls(credentials: &Credentials) -> ClientTlsConfig {
    let mut tls = ClientTlsConfig::new().with_enabled_roots();
    if let Some(authority) = &credentials.authority_pem {
        tls = tls.ca_certificate(Certificate::from_pem(authority));
    }
    if let Some((certificate, key)) = &credentials.certificate_and_key_pem {
        tls = tls.identity(Identity::from_pem(certificate, key));
    }
    tls
}

impl Interceptor for Bearer {
    fn call(&mut self, mut request: tonic::Request<()>) -> std::result::Result<tonic::Request<()>, tonic::Status> {
        if let Some(authorization) = &self.authorization {
            request.metadata_mut().insert("authorization", authorization.clone());
        }
        Ok(request)
    }
}

/// Hides the token.
impl fmt::Debug for Client {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Client").field("url", &self.url).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn bad_addresses_are_refused_before_connecting() {
        for (url, hint) in [
            ("127.0.0.1:7070", "write http://127.0.0.1:7070"),
            ("https://", "must look like"),
            ("ftp://lab", "must look like"),
            ("http://", "must look like"),
            ("http://a b", "malformed"),
        ] {
            let error = Client::connect(url).unwrap_err().to_string();
            assert!(error.contains(hint) && error.contains(url), "{url}: {error}");
        }
        assert_eq!(Client::connect("http://127.0.0.1:7070").unwrap().url(), "http://127.0.0.1:7070");
    }

    #[tokio::test]
    async fn bad_tokens_are_refused_and_tokens_are_never_shown() {
        let client = Client::connect_with_token("http://127.0.0.1:7070", "secret\n").unwrap();
        assert!(!format!("{client:?}").contains("secret"));
        for bad in ["", " \n", "two words", "ümlaut"] {
            assert!(matches!(Client::connect_with_token("http://127.0.0.1:7070", bad), Err(Error::Token)), "{bad:?}");
        }
    }
    #[tokio::test]
    async fn tokens_go_unencrypted_to_the_same_machine_only() {
        for url in ["http://localhost:7070", "http://127.0.0.2:7070", "http://[::1]:7070", "https://lab:7070"] {
            assert!(Client::connect_with_token(url, "secret").is_ok(), "{url}");
        }
        for url in ["http://lab:7070", "http://192.168.0.7:7070", "http://127.0.0.1.example:7070"] {
            let refused = Client::connect_with_token(url, "secret").unwrap_err();
            assert!(
                matches!(&refused, Error::OpenToken { .. }) && !refused.to_string().contains("secret"),
                "{refused}"
            );
            assert!(Client::connect(url).is_ok(), "no token is sent");
            let allowed = Credentials { token: Some("secret".into()), token_over_http: true, ..Credentials::default() };
            assert!(Client::connect_as(url, &allowed).is_ok());
        }
    }
}
