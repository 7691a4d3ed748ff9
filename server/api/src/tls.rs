//! TLS with a certificate, a key and optionally an authority for client certificates. Changed files are read again.

use lightpath_domain::causes::with_causes;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::{Duration, SystemTime};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::{self, PemObject as _};
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};
use tokio_rustls::rustls::server::{VerifierBuilderError, WebPkiClientVerifier};
use tokio_rustls::rustls::{self, RootCertStore, ServerConfig};

/// Interval between checks for changed files.
pub const CHECK_INTERVAL: Duration = Duration::from_secs(10);

/// Paths of the files for TLS.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TlsFiles {
    /// PEM file with the certificate of the server, followed by those up to its authority.
    pub certificate: PathBuf,
    /// PEM file with the private key of the certificate.
    pub key: PathBuf,
    /// PEM file with authorities: clients must present a certificate of one of them. `None`: clients need no
    /// certificate.
    pub client_authority: Option<PathBuf>,
}

/// Why TLS cannot be set up; the messages say what each means.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs)]
pub enum TlsError {
    #[error("cannot read {}", path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("{} must contain {what} in PEM form", path.display())]
    Pem { path: PathBuf, what: &'static str, source: pem::Error },
    /// The certificate does not match the key, or one of them is of an unsupported kind.
    #[error("certificate and key cannot be used")]
    Rustls(#[from] rustls::Error),
    #[error("the authority of client certificates cannot be used")]
    ClientAuthority(#[from] VerifierBuilderError),
}

/// The TLS configuration in use.
#[derive(Debug)]
pub struct Tls {
    files: TlsFiles,
    /// Locked only to copy a pointer.
    current: RwLock<(Arc<ServerConfig>, Stamp)>,
}

/// Times of the last changes of the files.
type Stamp = Vec<Option<SystemTime>>;

impl Tls {
    /// Reads the files and checks them.
    pub fn open(files: TlsFiles) -> Result<Self, TlsError> {
        let stamp = stamp(&files);
        let config = Arc::new(read(&files)?);
        Ok(Self { files, current: RwLock::new((config, stamp)) })
    }

    /// Acceptor for the next connection.
    pub fn acceptor(&self) -> TlsAcceptor {
        let current = self.current.read().unwrap_or_else(PoisonError::into_inner);
        TlsAcceptor::from(Arc::clone(&current.0))
    }

    /// Reads the files again if one of them has changed. If the new files cannot be used, logs the error and keeps the
    /// present configuration.
    pub fn reload_if_changed(&self) {
        let found = stamp(&self.files);
        let mut current = self.current.write().unwrap_or_else(PoisonError::into_inner);
        if found == current.1 {
            return;
        }
        match read(&self.files) {
            Ok(config) => {
                tracing::info!("the changed certificate and key are in use");
                *current = (Arc::new(config), found);
            }
            // The other file may be written soon: the stamp stays the same, so that the next check tries again.
            Err(error) => tracing::error!(error = with_causes(&error), "the changed certificate cannot be used yet"),
        }
    }
}

/// Reads the times of the last changes of the files.
fn stamp(files: &TlsFiles) -> Stamp {
    let paths = [Some(&files.certificate), Some(&files.key), files.client_authority.as_ref()];
    let changed = |path: &PathBuf| fs::metadata(path).and_then(|metadata| metadata.modified()).ok();
    paths.into_iter().map(|path| path.and_then(changed)).collect()
}

/// Reads the files and builds the configuration.
fn read(files: &TlsFiles) -> Result<ServerConfig, TlsError> {
    let provider = Arc::new(ring::default_provider());
    let certificates = certificates(&files.certificate)?;
    let key = PrivateKeyDer::from_pem_slice(&bytes(&files.key)?).map_err(wrong(&files.key, "a private key"))?;
    let builder = ServerConfig::builder_with_provider(Arc::clone(&provider)).with_safe_default_protocol_versions()?;
    let builder = match &files.client_authority {
        None => builder.with_no_client_auth(),
        Some(path) => {
            let mut roots = RootCertStore::empty();
            for authority in self::certificates(path)? {
                roots.add(authority)?;
            }
            let verifier = WebPkiClientVerifier::builder_with_provider(Arc::new(roots), provider).build()?;
            builder.with_client_cert_verifier(verifier)
        }
    };
    let mut config = builder.with_single_cert(certificates, key)?;
    config.alpn_protocols = vec![b"h2".to_vec(), b"http/1.1".to_vec()];
    Ok(config)
}

fn certificates(path: &Path) -> Result<Vec<CertificateDer<'static>>, TlsError> {
    let bytes = bytes(path)?;
    let found: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(&bytes).collect();
    match found.map_err(wrong(path, "a certificate"))? {
        none if none.is_empty() => Err(wrong(path, "a certificate")(pem::Error::NoItemsFound)),
        some => Ok(some),
    }
}

fn bytes(path: &Path) -> Result<Vec<u8>, TlsError> {
    fs::read(path).map_err(|source| TlsError::Read { path: path.to_owned(), source })
}

fn wrong(path: &Path, what: &'static str) -> impl Fn(pem::Error) -> TlsError {
    let path = path.to_owned();
    move |source| TlsError::Pem { path: path.clone(), what, source }
}
