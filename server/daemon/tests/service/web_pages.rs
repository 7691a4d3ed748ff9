//! Tests that web pages of other sites can do nothing. A page can send these requests from the browser of a user whose
//! machine runs a server without tokens.

use crate::access::Guarded;
use crate::manifests::curl;
use crate::serving::Serving;
use lightpath_proto::v1;
use lightpath_server::config::Config;
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

/// Starts a server that pages from `https://dash.example` may call.
async fn serving_for_a_page() -> Serving {
    Serving::start_with(|config| config.cors_origins = "https://dash.example, http://localhost:8000".into()).await
}

#[tokio::test]
async fn pages_of_allowed_origins_may_call_the_server_and_no_others() {
    let serving = serving_for_a_page().await;
    let ask = |origin: &'static str| {
        let serving = &serving;
        async move {
            let fields = format!("origin: {origin}");
            let method = "access-control-request-method: POST";
            curl(serving, "/v1/jobs", &["--request", "OPTIONS", "--header", &fields, "--header", method]).await
        }
    };
    let agreed = ask("https://dash.example").await;
    assert_eq!(agreed.status, 204, "{}", agreed.text());
    assert_eq!(agreed.field("access-control-allow-origin"), Some("https://dash.example"));
    assert!(agreed.field("access-control-allow-headers").unwrap().contains("authorization"));
    assert!(agreed.field("access-control-allow-methods").unwrap().contains("DELETE"));
    assert_eq!(agreed.field("access-control-allow-credentials"), None, "no cookies");
    let answer = curl(&serving, "/v1/jobs", &["--header", "origin: https://dash.example"]).await;
    assert_eq!(answer.field("access-control-allow-origin"), Some("https://dash.example"));
    assert_eq!((answer.status, answer.field("vary")), (200, Some("origin")));
    assert!(answer.field("access-control-expose-headers").unwrap().contains("etag"));
    let own = curl(&serving, "/v1/jobs", &[]).await;
    assert_eq!((own.field("access-control-allow-origin"), own.field("vary")), (None, Some("origin")));
    let missing = curl(&serving, "/v1/jobs/none", &["--header", "origin: http://localhost:8000"]).await;
    assert_eq!(missing.field("access-control-allow-origin"), Some("http://localhost:8000"), "errors can be read");
    assert_eq!(missing.status, 404);

    for other in ["https://evil.example", "https://dash.example:8443", "http://dash.example", "null"] {
        let refused = ask(other).await;
        assert_eq!((refused.status, refused.field("access-control-allow-origin")), (403, None), "{other}");
        let refused = curl(&serving, "/v1/jobs", &["--header", &format!("origin: {other}")]).await;
        assert_eq!((refused.status, refused.field("access-control-allow-origin")), (403, None), "{other}");
        assert!(refused.text().contains("cors_origins"), "{}", refused.text());
    }
}

#[tokio::test]
async fn an_allowed_page_needs_a_token_and_the_servers_own_name() {
    let serving = serving_for_a_page().await;
    let page = ("origin", "https://dash.example");
    assert_eq!(status(&serving, "GET /v1/jobs", &[("host", "localhost:7070"), page], b"").await, 200);
    assert_eq!(status(&serving, "GET /v1/jobs", &[("host", "evil.example:7070"), page], b"").await, 403);
    let guarded = Guarded::start_with(|config| config.cors_origins = "https://dash.example".into()).await;
    let call = |token: &str| [format!("authorization: Bearer {token}"), "origin: https://dash.example".to_owned()];
    let [bearer, origin] = call(&guarded.tokens["viewer"]);
    let read = curl(&guarded.serving, "/v1/jobs", &["--header", &bearer, "--header", &origin]).await;
    assert_eq!(read.status, 200, "{}", read.text());
    let without = curl(&guarded.serving, "/v1/jobs", &["--header", &origin]).await;
    assert_eq!(without.status, 401, "{}", without.text());
}

#[tokio::test]
async fn a_wrong_origin_in_the_settings_is_refused_with_the_fix() {
    for wrong in ["*", "https://dash.example/", "dash.example"] {
        let config = Config { cors_origins: wrong.to_owned(), ..Config::default() };
        let refused = config.hosts(false).unwrap_err().to_string();
        assert!(refused.starts_with("cors_origins has") && refused.contains("https://dash.example or"), "{refused}");
    }
}

/// The frames of an answer of gRPC-Web, each with its first byte: 0 for a message, 128 for the trailers.
fn frames(mut body: &[u8]) -> Vec<(u8, &[u8])> {
    let mut frames = Vec::new();
    while let [kind, a, b, c, d, rest @ ..] = body {
        let (frame, after) = rest.split_at(u32::from_be_bytes([*a, *b, *c, *d]) as usize);
        frames.push((*kind, frame));
        body = after;
    }
    frames
}

#[tokio::test]
async fn grpc_web_calls_methods_and_receives_their_errors_as_frames() {
    let serving = serving_for_a_page().await;
    serving.display("lab").await;
    let call = |id: &'static str, origin: &'static str| {
        let serving = &serving;
        async move {
            let request = serving.config.data_dir.join("request");
            std::fs::write(&request, framed(&v1::GetDisplayRequest { name: format!("displays/{id}") })).unwrap();
            let body = format!("@{}", request.display());
            let fields = ["content-type: application/grpc-web+proto", "x-grpc-web: 1", origin];
            let [kind, web, origin] = fields;
            let more = ["--header", kind, "--header", web, "--header", origin, "--data-binary", &body];
            curl(serving, "/lightpath.v1.DisplayService/GetDisplay", &more).await
        }
    };
    let found = call("lab", "origin: https://dash.example").await;
    assert_eq!((found.status, found.field("content-type")), (200, Some("application/grpc-web+proto")));
    assert_eq!(found.field("access-control-allow-origin"), Some("https://dash.example"));
    let answer = frames(&found.body);
    let [(0, message), (128, trailers)] = answer[..] else { panic!("{answer:?}") };
    assert_eq!(v1::Display::decode(message).unwrap().name, "displays/lab");
    assert_eq!(std::str::from_utf8(trailers).unwrap().trim(), "grpc-status:0");

    let missing = call("none", "origin: https://dash.example").await;
    assert_eq!(missing.field("grpc-status"), Some("5"), "{}", missing.text());
    let forged = call("lab", "origin: https://evil.example").await;
    assert_eq!((forged.field("grpc-status"), forged.body.len()), (Some("7"), 0), "{}", forged.text());
}
