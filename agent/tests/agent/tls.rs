//! HTTPS with an authority of its own, and with client certificates.

use crate::bench::{Bench, check, problem};
use crate::server::answer_over;
use lightpath_agent::Agent;
use rcgen::CertifiedKey;
use rustls::pki_types::PrivateKeyDer;
use rustls::server::WebPkiClientVerifier;
use rustls::{RootCertStore, ServerConfig, ServerConnection, StreamOwned};
use std::io::{Read as _, Write as _};
use std::net::{Shutdown, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread;

fn made() -> CertifiedKey<rcgen::KeyPair> {
    rcgen::generate_simple_self_signed(vec!["localhost".to_owned()]).unwrap()
}

/// Writes a certificate and its key to files with this name.
fn written(folder: &Path, name: &str, pair: &CertifiedKey<rcgen::KeyPair>) -> (PathBuf, PathBuf) {
    let paths = (folder.join(format!("{name}.pem")), folder.join(format!("{name}.key")));
    std::fs::write(&paths.0, pair.cert.pem()).unwrap();
    std::fs::write(&paths.1, pair.signing_key.serialize_pem()).unwrap();
    paths
}

/// Puts the server of a bench behind TLS, and returns its address. With `clients` it asks for this certificate.
fn behind_tls(
    bench: &Arc<Bench>,
    pair: &CertifiedKey<rcgen::KeyPair>,
    clients: Option<&CertifiedKey<rcgen::KeyPair>>,
) -> String {
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let key = PrivateKeyDer::try_from(pair.signing_key.serialize_der()).unwrap();
    let config =
        ServerConfig::builder_with_provider(Arc::clone(&provider)).with_safe_default_protocol_versions().unwrap();
    let config = match clients {
        Some(client) => {
            let mut roots = RootCertStore::empty();
            roots.add(client.cert.der().clone()).unwrap();
            let verifier = WebPkiClientVerifier::builder_with_provider(Arc::new(roots), provider).build().unwrap();
            config.with_client_cert_verifier(verifier)
        }
        None => config.with_no_client_auth(),
    };
    let config = Arc::new(config.with_single_cert(vec![pair.cert.der().clone()], key).unwrap());
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("https://localhost:{}", listener.local_addr().unwrap().port());
    let behind = Arc::clone(bench);
    thread::spawn(move || {
        for stream in listener.incoming() {
            let (config, behind) = (Arc::clone(&config), Arc::clone(&behind));
            thread::spawn(move || {
                let connection = ServerConnection::new(config).unwrap();
                let mut stream = StreamOwned::new(connection, stream.unwrap());
                answer_over(&behind.server, &mut stream);
                stream.conn.send_close_notify();
                let _ = stream.flush();
                // What the client still sends must not reset the connection before it has read why.
                let _ = stream.sock.shutdown(Shutdown::Write);
                let _ = stream.sock.read_to_end(&mut Vec::new());
            });
        }
    });
    address
}

#[test]
fn server_is_trusted_if_the_authority_of_the_device_vouches_for_it() {
    let bench = Arc::new(Bench::new());
    let (pair, other) = (made(), made());
    let (ca, _) = written(bench.folder.path(), "ca", &pair);
    let (wrong, _) = written(bench.folder.path(), "wrong", &other);
    let mut settings = bench.settings();
    settings.server = behind_tls(&bench, &pair, None);
    settings.ca_file = Some(wrong.clone());
    let mut agent = Agent::start(settings.clone()).unwrap();
    let text = problem(&mut agent);
    assert!(text.starts_with("could not reach https://localhost") && text.contains("certificate"), "{text}");
    // The file is read again before each call.
    std::fs::copy(&ca, &wrong).unwrap();
    check(&mut agent).unwrap();
    drop(agent);
    settings.ca_file = Some(bench.directory().join("missing.pem"));
    let text = Agent::start(settings.clone()).unwrap_err().to_string();
    assert!(text.contains("missing.pem cannot be read") && text.contains("correct --ca-file"), "{text}");
    settings.ca_file = Some(ca);
    check(&mut Agent::start(settings).unwrap()).unwrap();
    bench.assert_uses(1);
}

#[test]
fn device_shows_its_certificate_to_a_server_that_asks_for_one() {
    let bench = Arc::new(Bench::new());
    let folder = bench.folder.path();
    let (pair, device, other) = (made(), made(), made());
    let (ca, _) = written(folder, "ca", &pair);
    let good = written(folder, "device", &device);
    let wrong = written(folder, "other", &other);
    let mut settings = bench.settings();
    settings.server = behind_tls(&bench, &pair, Some(&device));
    settings.ca_file = Some(ca);
    let text = problem(&mut Agent::start(settings.clone()).unwrap());
    assert!(text.contains("could not reach") && text.contains("give --client-cert and --client-key"), "{text}");
    settings.client = Some(wrong.clone());
    let mut agent = Agent::start(settings.clone()).unwrap();
    assert!(problem(&mut agent).starts_with("could not reach"));
    // A new certificate counts at the next poll, and a half replaced pair says so until then.
    std::fs::copy(&good.0, &wrong.0).unwrap();
    let text = problem(&mut agent);
    assert!(text.contains("other.key does not belong to the certificate in") && text.contains("other.pem"), "{text}");
    std::fs::copy(&good.1, &wrong.1).unwrap();
    check(&mut agent).unwrap();
    bench.assert_uses(1);
}

#[test]
fn certificates_that_cannot_be_used_are_named_with_the_fix() {
    let bench = Bench::new();
    let folder = bench.folder.path();
    let (certificate, key) = written(folder, "device", &made());
    let (ca, _) = written(folder, "ca", &made());
    let (empty, locked) = (folder.join("empty.pem"), folder.join("locked.key"));
    std::fs::write(&empty, "").unwrap();
    std::fs::write(&locked, "-----BEGIN ENCRYPTED PRIVATE KEY-----\nMC4C\n-----END ENCRYPTED PRIVATE KEY-----\n")
        .unwrap();
    let mut settings = bench.settings();
    settings.ca_file = Some(ca);
    "https://localhost:1".clone_into(&mut settings.server);
    let missing = folder.join("missing");
    for (pair, parts) in [
        ((&missing, &key), ["missing cannot be read", "correct --client-cert"]),
        ((&certificate, &missing), ["missing cannot be read", "correct --client-key"]),
        ((&empty, &key), ["empty.pem has no certificate", "-----BEGIN CERTIFICATE-----"]),
        ((&certificate, &empty), ["empty.pem has no private key", "-----BEGIN PRIVATE KEY-----"]),
        ((&certificate, &locked), ["locked.key needs a passphrase", "`openssl pkey -in"]),
        ((&key, &certificate), ["device.key has no certificate", "correct --client-cert"]),
    ] {
        settings.client = Some((pair.0.clone(), pair.1.clone()));
        let text = Agent::start(settings.clone()).unwrap_err().to_string();
        assert!(parts.iter().all(|part| text.contains(part)), "{parts:?}: {text}");
    }
    settings.client = Some((certificate, key));
    "http://localhost:1".clone_into(&mut settings.server);
    let text = Agent::start(settings).unwrap_err().to_string();
    assert!(text.contains("no TLS") && text.contains("use https://"), "{text}");
}
