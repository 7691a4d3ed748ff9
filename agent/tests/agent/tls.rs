//! HTTPS with an authority of its own.

use crate::bench::{Bench, check, problem};
use crate::server::answer_over;
use lightpath_agent::Agent;
use rustls::pki_types::PrivateKeyDer;
use rustls::{ServerConfig, ServerConnection, StreamOwned};
use std::net::TcpListener;
use std::sync::Arc;
use std::thread;

#[test]
fn server_is_trusted_if_the_authority_of_the_device_vouches_for_it() {
    let bench = Bench::new();
    let rcgen::CertifiedKey { cert, signing_key } =
        rcgen::generate_simple_self_signed(vec!["localhost".to_owned()]).unwrap();
    let other = rcgen::generate_simple_self_signed(vec!["localhost".to_owned()]).unwrap();
    let (ca, wrong) = (bench.folder.path().join("ca.pem"), bench.folder.path().join("wrong.pem"));
    std::fs::write(&ca, cert.pem()).unwrap();
    std::fs::write(&wrong, other.cert.pem()).unwrap();
    let key = PrivateKeyDer::try_from(signing_key.serialize_der()).unwrap();
    let config = ServerConfig::builder_with_provider(Arc::new(rustls::crypto::ring::default_provider()))
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_no_client_auth()
        .with_single_cert(vec![cert.der().clone()], key)
        .unwrap();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let mut settings = bench.settings();
    settings.server = format!("https://localhost:{}", listener.local_addr().unwrap().port());
    let (folder, server) = (bench.directory(), Arc::new(bench));
    let behind = Arc::clone(&server);
    let config = Arc::new(config);
    thread::spawn(move || {
        for stream in listener.incoming() {
            let connection = ServerConnection::new(Arc::clone(&config)).unwrap();
            let mut stream = StreamOwned::new(connection, stream.unwrap());
            answer_over(&behind.server, &mut stream);
            stream.conn.send_close_notify();
            let _ = std::io::Write::flush(&mut stream);
        }
    });
    settings.ca_file = Some(wrong);
    let text = problem(&mut Agent::start(settings.clone()).unwrap());
    assert!(text.starts_with("could not reach https://localhost") && text.contains("certificate"), "{text}");
    settings.ca_file = Some(folder.join("missing.pem"));
    assert!(Agent::start(settings.clone()).unwrap_err().to_string().contains("missing.pem cannot be read"));
    settings.ca_file = Some(ca);
    check(&mut Agent::start(settings).unwrap()).unwrap();
    server.assert_uses(1);
}
