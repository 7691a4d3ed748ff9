//! TLS: whom the agent trusts as a server, and the certificate by which the server knows the device.

use crate::Settings;
use crate::problem::Problem;
use rustls::pki_types::pem::PemObject as _;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::sign::CertifiedKey;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use ureq::tls::{Certificate, ClientCert, PemItem, PrivateKey, RootCerts, TlsConfig, parse_pem};

/// The bytes of the files that the settings name. They are read before each call, as the token is, so that certificates
/// can be replaced at any time; connections are made anew when the bytes have changed.
#[derive(Default, PartialEq)]
pub(crate) struct Files {
    authorities: Option<Vec<u8>>,
    client: Option<(Vec<u8>, Vec<u8>)>,
}

impl Files {
    pub(crate) fn read(settings: &Settings) -> Result<Self, Problem> {
        let authorities = settings.ca_file.as_deref().map(|path| read(path, "--ca-file")).transpose()?;
        let client = match &settings.client {
            Some((certificate, key)) => Some((read(certificate, "--client-cert")?, read(key, "--client-key")?)),
            None => None,
        };
        Ok(Self { authorities, client })
    }

    /// What connections need.
    pub(crate) fn config(&self, settings: &Settings) -> Result<TlsConfig, Problem> {
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let authorities = match (&self.authorities, &settings.ca_file) {
            (Some(pem), Some(path)) => authorities(pem, path)?,
            _ => system_authorities()?,
        };
        let client = match (&self.client, &settings.client) {
            (Some((certificate, key)), Some(paths)) => Some(client(certificate, key, paths, &provider)?),
            _ => None,
        };
        let roots = RootCerts::new_with_certs(&authorities);
        let config = TlsConfig::builder().root_certs(roots).client_cert(client);
        Ok(config.unversioned_rustls_crypto_provider(provider).build())
    }
}

fn read(path: &Path, option: &str) -> Result<Vec<u8>, Problem> {
    let wrong = |error| format!("the file {} cannot be read: {error}; correct {option}", path.display());
    fs::read(path).map_err(|error| Problem::Setting(wrong(error)))
}

fn authorities(pem: &[u8], path: &Path) -> Result<Vec<Certificate<'static>>, Problem> {
    let certificates = certificates(pem, path)?;
    if certificates.is_empty() {
        return Err(no_authorities(&path.display().to_string()));
    }
    Ok(certificates)
}

fn system_authorities() -> Result<Vec<Certificate<'static>>, Problem> {
    let found = rustls_native_certs::load_native_certs().certs;
    if found.is_empty() {
        return Err(no_authorities("this system"));
    }
    Ok(found.iter().map(|certificate| Certificate::from_der(certificate).to_owned()).collect())
}

fn no_authorities(place: &str) -> Problem {
    Problem::Setting(format!("{place} has no certificate authorities: name a PEM file with --ca-file"))
}

/// The certificate of the device with its key, after a check that both can be used: the connection would only panic.
fn client(
    certificate: &[u8],
    key: &[u8],
    (certificate_path, key_path): &(impl AsRef<Path>, impl AsRef<Path>),
    provider: &rustls::crypto::CryptoProvider,
) -> Result<ClientCert, Problem> {
    let (certificate_path, key_path) = (certificate_path.as_ref(), key_path.as_ref());
    let chain = certificates(certificate, certificate_path)?;
    if chain.is_empty() {
        let place = certificate_path.display();
        return Err(Problem::Setting(format!(
            "{place} has no certificate: put the device's certificate there in PEM form (-----BEGIN CERTIFICATE-----), \
             then those of intermediate authorities, or correct --client-cert"
        )));
    }
    let der = chain.iter().map(|certificate| CertificateDer::from(certificate.der().to_vec())).collect();
    let usable = CertifiedKey::from_der(der, private_key(key, key_path)?, provider);
    usable.map_err(|error| {
        Problem::Setting(format!(
            "the key in {} does not belong to the certificate in {} ({error}): give the files that were made together \
             with --client-key and --client-cert",
            key_path.display(),
            certificate_path.display()
        ))
    })?;
    let key = PrivateKey::from_pem(key).map_err(|_| no_key(key_path))?;
    Ok(ClientCert::new_with_certs(&chain, key))
}

fn private_key(pem: &[u8], path: &Path) -> Result<PrivateKeyDer<'static>, Problem> {
    if pem.windows(ENCRYPTED.len()).any(|part| part == ENCRYPTED) {
        let place = path.display();
        return Err(Problem::Setting(format!(
            "the private key in {place} needs a passphrase, which nobody can type here: `openssl pkey -in {place} -out \
             NEW` writes it without one; let only the agent's user read it"
        )));
    }
    PrivateKeyDer::from_pem_slice(pem).map_err(|_| no_key(path))
}

/// What a PEM file says before a key with a passphrase.
const ENCRYPTED: &[u8] = b"ENCRYPTED";

fn no_key(path: &Path) -> Problem {
    Problem::Setting(format!(
        "{} has no private key in PEM form (-----BEGIN PRIVATE KEY-----): put the key of the device's certificate there, \
         or correct --client-key",
        path.display()
    ))
}

fn certificates(pem: &[u8], path: &Path) -> Result<Vec<Certificate<'static>>, Problem> {
    let items = parse_pem(pem).filter_map(|item| match item {
        Ok(PemItem::Certificate(certificate)) => Some(Ok(certificate)),
        Ok(_) => None,
        Err(error) => Some(Err(Problem::Setting(format!("the file {} is not in PEM form: {error}", path.display())))),
    });
    items.collect()
}
