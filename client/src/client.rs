//! One channel to a server.

use crate::v1::artifact_service_client::ArtifactServiceClient;
use crate::v1::dataset_service_client::DatasetServiceClient;
use crate::v1::display_service_client::DisplayServiceClient;
use crate::v1::job_service_client::JobServiceClient;
use crate::v1::kernel_service_client::KernelServiceClient;
use crate::{Error, Result};
use std::fmt;
use std::time::Duration;
use tonic::metadata::{Ascii, MetadataValue};
use tonic::service::Interceptor;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::{Certificate, Channel, ClientTlsConfig, Endpoint, Identity};

/// A server that takes longer to accept a connection counts as unreachable.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// A silent connection is probed this often, so that a watch notices when the server's machine is gone.
const KEEP_ALIVE_INTERVAL: Duration = Duration::from_secs(20);

/// A probe without an answer for this long ends the connection.
const KEEP_ALIVE_TIMEOUT: Duration = Duration::from_secs(10);

/// Longest wait for the answer of a call that does not stream.
const CALL_TIMEOUT: Duration = Duration::from_secs(60);

/// Largest answer taken: a page of 1000 jobs with their loss histories fits, a runaway server does not.
const MESSAGE_BYTES_MAX: usize = 64 << 20;

/// A connection to a Lightpath server. Cheap to clone; clones share the connection.
///
/// The connection is made by the first call, and made again after a break.
#[derive(Clone)]
pub struct Client {
    url: String,
    transport: Transport,
}

pub(crate) type Transport = InterceptedService<Channel, Bearer>;

/// What a guarded server wants. The default: nothing.
#[derive(Clone, Default)]
pub struct Credentials {
    /// Sent with each call.
    pub token: Option<String>,
    /// The authority of the server's certificate, PEM, where it is not one of the system's.
    pub authority_pem: Option<Vec<u8>>,
    /// The client's own certificate and key, PEM, where the server asks for one.
    pub certificate_and_key_pem: Option<(Vec<u8>, Vec<u8>)>,
}

/// Never shows the token or the key.
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
    /// A client of the server at `url`, for example `http://127.0.0.1:7070` or `https://lab:7070`. Must be called on a Tokio runtime;
    /// connects with the first call.
    ///
    /// # Errors
    ///
    /// [`Error::Url`] when `url` is no `http://` or `https://` address.
    pub fn connect(url: &str) -> Result<Self> {
        Self::connect_as(url, &Credentials::default())
    }

    /// Like [`Self::connect`], and every call carries `token` as its bearer token.
    ///
    /// # Errors
    ///
    /// [`Error::Url`] as above; [`Error::Token`] when the token is empty or has characters outside printable ASCII.
    pub fn connect_with_token(url: &str, token: &str) -> Result<Self> {
        Self::connect_as(url, &Credentials { token: Some(token.to_owned()), ..Credentials::default() })
    }

    /// Like [`Self::connect`], with all that a guarded server wants.
    ///
    /// # Errors
    ///
    /// [`Error::Url`] where `url` is malformed or the certificates cannot be used; [`Error::Token`] as above.
    pub fn connect_as(url: &str, credentials: &Credentials) -> Result<Self> {
        let authorization = credentials.token.as_deref().map(authorization).transpose()?;
        let channel = endpoint(url, credentials)?.connect_lazy();
        Ok(Self { url: url.to_owned(), transport: InterceptedService::new(channel, Bearer { authorization }) })
    }

    /// The server's address, as given.
    #[must_use]
    pub fn url(&self) -> &str {
        &self.url
    }

    pub(crate) fn artifacts(&self) -> ArtifactServiceClient<Transport> {
        ArtifactServiceClient::new(self.transport.clone()).max_decoding_message_size(MESSAGE_BYTES_MAX)
    }

    pub(crate) fn datasets(&self) -> DatasetServiceClient<Transport> {
        DatasetServiceClient::new(self.transport.clone()).max_decoding_message_size(MESSAGE_BYTES_MAX)
    }

    pub(crate) fn displays(&self) -> DisplayServiceClient<Transport> {
        DisplayServiceClient::new(self.transport.clone()).max_decoding_message_size(MESSAGE_BYTES_MAX)
    }

    pub(crate) fn jobs(&self) -> JobServiceClient<Transport> {
        JobServiceClient::new(self.transport.clone()).max_decoding_message_size(MESSAGE_BYTES_MAX)
    }

    pub(crate) fn kernels(&self) -> KernelServiceClient<Transport> {
        KernelServiceClient::new(self.transport.clone()).max_decoding_message_size(MESSAGE_BYTES_MAX)
    }

    /// The error of a call that ended with `status`.
    pub(crate) fn error(&self, status: tonic::Status) -> Error {
        Error::from_status(&self.url, status)
    }
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

/// A request that must be answered within [`CALL_TIMEOUT`].
pub(crate) fn bounded<T>(message: T) -> tonic::Request<T> {
    let mut request = tonic::Request::new(message);
    request.set_timeout(CALL_TIMEOUT);
    request
}

fn endpoint(url: &str, credentials: &Credentials) -> Result<Endpoint> {
    let refused = |reason: String| Error::Url { url: url.to_owned(), reason };
    let is_tls = match url.split_once("://") {
        Some(("http", rest)) if !rest.is_empty() => false,
        Some(("https", rest)) if !rest.is_empty() => true,
        Some(_) => return Err(refused("must look like http://127.0.0.1:7070".to_owned())),
        None => return Err(refused(format!("has no scheme: write http://{url}"))),
    };
    let mut endpoint = Endpoint::from_shared(url.to_owned())
        .and_then(|endpoint| endpoint.user_agent(concat!("lightpath/", env!("CARGO_PKG_VERSION"))))
        .map_err(|error| refused(format!("is malformed ({error}): write http://127.0.0.1:7070")))?;
    if is_tls {
        let tls = tls(credentials);
        endpoint = endpoint.tls_config(tls).map_err(|error| refused(format!("cannot be reached by TLS: {error}")))?;
    }
    Ok(endpoint
        .connect_timeout(CONNECT_TIMEOUT)
        .http2_keep_alive_interval(KEEP_ALIVE_INTERVAL)
        .keep_alive_timeout(KEEP_ALIVE_TIMEOUT))
}

/// The system's authorities, and what the credentials add.
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

/// Never shows the token.
impl fmt::Debug for Client {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Client").field("url", &self.url).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn addresses_are_checked_before_anything_is_sent() {
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
    async fn a_token_is_checked_and_never_shown() {
        let client = Client::connect_with_token("http://127.0.0.1:7070", "secret\n").unwrap();
        assert!(!format!("{client:?}").contains("secret"));
        for bad in ["", " \n", "two words", "ümlaut"] {
            assert!(matches!(Client::connect_with_token("http://127.0.0.1:7070", bad), Err(Error::Token)), "{bad:?}");
        }
    }
}
