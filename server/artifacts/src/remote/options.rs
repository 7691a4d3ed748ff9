//! Settings of a remote.

use super::answers::BoundedConnector;
use crate::error::{ArtifactError, Result};
use object_store::ClientOptions;
use object_store::aws::{AmazonS3, AmazonS3Builder, Checksum, S3ConditionalPut};
use object_store::path::Path;
use object_store::{BackoffConfig, RetryConfig};
use std::fmt;
use std::time::Duration;

/// Time for which a connection may take to be made.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(3);
/// Time for which one request may take. Each carries at most a part of 8 MiB, so 0.5 MB/s are enough.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(20);
/// Time from the first attempt of a request after which it is not sent again.
const RETRY_TIMEOUT: Duration = Duration::from_secs(5);
/// Number of times that a request is sent again.
const RETRIES_MAX: usize = 6;

/// Where a remote is, and how much of it is kept on the local disk.
#[derive(Clone, PartialEq, Eq)]
pub struct RemoteOptions {
    /// Bucket, and the beginning of all keys in it: `s3://bucket/prefix`, or `s3://bucket`.
    pub url: String,
    /// Address of a server that is not Amazon's, such as `https://s3.example.org`.
    pub endpoint: Option<String>,
    /// Region of the bucket, such as `eu-central-1`.
    pub region: String,
    /// Name of the key that signs requests.
    pub access_key_id: String,
    /// The key that signs requests.
    pub secret_access_key: String,
    /// Whether the endpoint may be `http://`: then the bytes of artifacts pass the network unencrypted.
    pub allow_http: bool,
    /// Size that the local copies of artifacts and checkpoints may have together \[bytes\]. The newest copy is kept
    /// whatever its size. Files that are being written come on top.
    pub cache_bytes_max: u64,
}

impl fmt::Debug for RemoteOptions {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The secret key is left out: settings are logged.
        formatter.debug_struct("RemoteOptions").field("url", &self.url).field("endpoint", &self.endpoint).finish()
    }
}

impl RemoteOptions {
    /// Client of the bucket, and the beginning of all keys.
    pub(super) fn connect(&self) -> Result<(AmazonS3, Path)> {
        let bad = |problem: &str| ArtifactError::BadRemote { problem: problem.to_owned() };
        let rest = self.url.strip_prefix("s3://").ok_or_else(|| bad("its URL must begin with s3://"))?;
        let (bucket, prefix) = rest.trim_end_matches('/').split_once('/').unwrap_or((rest.trim_end_matches('/'), ""));
        if bucket.is_empty() {
            return Err(bad("its URL must name a bucket, as s3://bucket/prefix does"));
        }
        let prefix = Path::parse(prefix).map_err(|error| bad(&format!("its prefix is malformed: {error}")))?;
        if self.access_key_id.is_empty() || self.secret_access_key.is_empty() {
            return Err(bad("it needs an access key id and a secret access key"));
        }
        let scheme = |scheme| self.endpoint.as_ref().is_some_and(|endpoint| endpoint.starts_with(scheme));
        if self.endpoint.is_some() && !scheme("https://") && !scheme("http://") {
            return Err(bad("its endpoint must begin with https://"));
        }
        if scheme("http://") && !self.allow_http {
            return Err(bad("its endpoint is http://, which must be allowed: the bytes would pass unencrypted"));
        }
        // Another part of the program may have chosen the same provider already.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let client = ClientOptions::new()
            .with_connect_timeout(CONNECT_TIMEOUT)
            .with_timeout(REQUEST_TIMEOUT)
            .with_allow_http(self.allow_http);
        let backoff = BackoffConfig {
            init_backoff: Duration::from_millis(100),
            max_backoff: Duration::from_secs(1),
            ..BackoffConfig::default()
        };
        let retry = RetryConfig { backoff, max_retries: RETRIES_MAX, retry_timeout: RETRY_TIMEOUT };
        let mut builder = AmazonS3Builder::new()
            .with_bucket_name(bucket)
            .with_region(&self.region)
            .with_access_key_id(&self.access_key_id)
            .with_secret_access_key(&self.secret_access_key)
            .with_checksum_algorithm(Checksum::SHA256)
            .with_conditional_put(S3ConditionalPut::ETagMatch)
            .with_http_connector(BoundedConnector)
            .with_client_options(client)
            .with_retry(retry);
        if let Some(endpoint) = &self.endpoint {
            builder = builder.with_endpoint(endpoint);
        }
        let store = builder.build().map_err(|error| bad(&error.to_string()))?;
        Ok((store, prefix))
    }
}
