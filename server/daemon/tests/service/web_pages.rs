//! Tests that web pages of other sites can do nothing. A page can send these requests from the browser of a user whose
//! machine runs a server without tokens.

use crate::serving::Serving;
use lightpath_proto::v1;
use prost::Message;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;

/// Sends a request over HTTP/1.1, and returns the status of the answer.
async fn status(serving: &Serving, request_line: &str, headers: &[(&str, &str)], body: &[u8]) -> u16 {
    let mut stream = TcpStream::connect(serving.address).await.unwrap();
    let mut request = format!("{request_line} HTTP/1.1\r\nconnection: close\r\ncontent-length: {}\r\n", body.len());
    for (name, value) in headers {
        request += &format!("{name}: {value}\r\n");
    }
    stream.write_all(&[request.as_bytes(), b"\r\n", body].concat()).await.unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).await.unwrap();
    String::from_utf8_lossy(&answer).split(' ').nth(1).unwrap().parse().unwrap()
}

/// A message as gRPC frames it.
fn framed(message: &impl Message) -> Vec<u8> {
    let bytes = message.encode_to_vec();
    [&[0], &(bytes.len() as u32).to_be_bytes()[..], &bytes].concat()
}

#[tokio::test]
async fn pages_of_other_sites_change_nothing() {
    let serving = Serving::start().await;
    serving.display("lab").await;
    let delete = framed(&v1::DeleteDisplayRequest { name: "displays/lab".to_owned() });
    let line = "POST /lightpath.v1.DisplayService/DeleteDisplay";
    let own = ("host", "localhost:7070");
    let evil = ("origin", "http://evil.example");
    let attempts: [&[(&str, &str)]; 9] = [
        // What a page may send without asking.
        &[own, evil, ("content-type", "text/plain")],
        &[own, evil, ("content-type", "application/x-www-form-urlencoded")],
        &[own, evil, ("content-type", "multipart/form-data; boundary=x")],
        &[own, evil],
        // Browsers that send no origin.
        &[own, ("content-type", "text/plain")],
        // What a page might send if the browser let it.
        &[own, evil, ("content-type", "application/grpc")],
        &[own, ("origin", "null"), ("content-type", "application/grpc")],
        // A page whose site's name points to this machine.
        &[("host", "evil.example:7070"), ("content-type", "application/grpc")],
        &[("host", "evil.example:7070"), ("origin", "http://evil.example:7070"), ("content-type", "application/grpc")],
    ];
    for headers in attempts {
        let status = status(&serving, line, headers, &delete).await;
        // gRPC answers a refusal with the status 200 and a code in a header.
        assert!([200, 400, 403].contains(&status), "{headers:?}: {status}");
        let get = v1::GetDisplayRequest { name: "displays/lab".to_owned() };
        serving.displays().get_display(get).await.unwrap_or_else(|error| panic!("{headers:?} deleted it: {error}"));
    }
    // The same request from a program is accepted.
    status(&serving, line, &[own, ("content-type", "application/grpc")], &delete).await;
    let get = v1::GetDisplayRequest { name: "displays/lab".to_owned() };
    assert!(serving.displays().get_display(get).await.is_err());
}

#[tokio::test]
async fn pages_of_other_sites_read_nothing() {
    let serving = Serving::start_with(|config| config.host_names = "lab-server, lab-server.example".into()).await;
    for path in ["/v1/jobs", "/metrics", "/v1/jobs/0193"] {
        for headers in [
            [("host", "evil.example"), ("accept", "*/*")],
            [("host", "localhost"), ("origin", "http://evil.example")],
            [("host", "lab-server.evil.example"), ("accept", "*/*")],
        ] {
            assert_eq!(status(&serving, &format!("GET {path}"), &headers, b"").await, 403, "{path} {headers:?}");
        }
    }
    for host in ["localhost:7070", "127.0.0.1", "lab-server:80", "lab-server.example"] {
        assert_eq!(status(&serving, "GET /v1/jobs", &[("host", host)], b"").await, 200, "{host}");
    }
    // A supervisor may use any name.
    assert_eq!(status(&serving, "GET /healthz", &[("host", "any.example")], b"").await, 200);
}
