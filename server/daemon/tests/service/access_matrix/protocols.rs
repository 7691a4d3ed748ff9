//! Requests with any method, content type and HTTP version, over connections that are used again.

use crate::serving::Serving;
use std::net::SocketAddr;
use tokio::io::{AsyncBufReadExt as _, AsyncReadExt as _, AsyncWriteExt as _, BufReader};
use tokio::net::TcpStream;
use tonic::Code;
use tonic::body::Body;
use tonic::codegen::{Service as _, http};
use tonic::transport::Channel;

/// A gRPC message without compression and without bytes. It is a valid message of every method.
const EMPTY_MESSAGE: &str = "\0\0\0\0\0";

/// What a request is, besides its path and its token.
#[derive(Clone, Copy, Debug)]
pub(super) struct Form {
    pub(super) method: &'static str,
    pub(super) content_type: Option<&'static str>,
}

impl Form {
    /// Body of such a request.
    fn body(self) -> &'static str {
        match (self.method, self.content_type) {
            ("POST" | "PUT", Some("application/json")) => "{}",
            ("POST", _) => EMPTY_MESSAGE,
            _ => "",
        }
    }
}

/// An answer.
#[derive(Clone, Debug, Default)]
pub(super) struct Answer {
    /// Status of HTTP.
    pub(super) http: u16,
    /// Status of gRPC, if the head has one.
    pub(super) grpc: Option<Code>,
    /// Message of gRPC.
    pub(super) message: String,
    /// The body, if it is no stream. It is read over HTTP/1.1 only.
    pub(super) body: Vec<u8>,
}

/// A client with one connection of each HTTP version.
pub(super) struct Client {
    two: Channel,
    address: SocketAddr,
    one: Option<BufReader<TcpStream>>,
    token: Option<String>,
}

impl Client {
    pub(super) fn new(serving: &Serving, token: Option<String>) -> Self {
        Self { two: serving.channel.clone(), address: serving.address, one: None, token }
    }

    /// Sends a request over HTTP/2, and returns the head of the answer. The rest of the answer is not read.
    pub(super) async fn http2(&mut self, path: &str, form: Form) -> Answer {
        let mut request = http::Request::builder().method(form.method).uri(path);
        if let Some(content_type) = form.content_type {
            request = request.header("content-type", content_type);
        }
        if let Some(token) = &self.token {
            request = request.header("authorization", format!("Bearer {token}"));
        }
        let request = request.body(Body::new(form.body().to_owned())).unwrap();
        std::future::poll_fn(|context| self.two.poll_ready(context)).await.unwrap();
        let answer = self.two.call(request).await.unwrap();
        let header = |name: &str| answer.headers().get(name).map(|value| value.to_str().unwrap().to_owned());
        Answer {
            http: answer.status().as_u16(),
            grpc: header("grpc-status").map(|code| Code::from_bytes(code.as_bytes())),
            message: header("grpc-message").unwrap_or_default(),
            body: Vec::new(),
        }
    }

    /// Sends a request over HTTP/1.1, and returns the answer. The connection is used again unless the answer
    /// is a stream.
    pub(super) async fn http1(&mut self, path: &str, form: Form) -> Answer {
        let mut request = format!("{} {path} HTTP/1.1\r\nhost: localhost\r\n", form.method);
        if let Some(content_type) = form.content_type {
            request += &format!("content-type: {content_type}\r\n");
        }
        if let Some(token) = &self.token {
            request += &format!("authorization: Bearer {token}\r\n");
        }
        request += &format!("content-length: {}\r\n\r\n{}", form.body().len(), form.body());
        let mut stream = match self.one.take() {
            Some(stream) => stream,
            None => BufReader::new(connect(self.address).await),
        };
        stream.write_all(request.as_bytes()).await.unwrap();
        let (mut answer, length) = head(&mut stream).await;
        if let Some(length) = length {
            answer.body.resize(length, 0);
            stream.read_exact(&mut answer.body).await.unwrap();
            self.one = Some(stream);
        }
        answer
    }
}

async fn connect(address: SocketAddr) -> TcpStream {
    let stream = TcpStream::connect(address).await.unwrap();
    stream.set_nodelay(true).unwrap();
    stream
}

/// Reads the head of an answer over HTTP/1.1. Returns it, and the length of the body unless the body is a stream.
async fn head(stream: &mut BufReader<TcpStream>) -> (Answer, Option<usize>) {
    let mut line = String::new();
    stream.read_line(&mut line).await.unwrap();
    let http = line.split(' ').nth(1).unwrap_or_else(|| panic!("the server closed the connection")).parse().unwrap();
    let (mut answer, mut length) = (Answer { http, ..Answer::default() }, None);
    loop {
        line.clear();
        stream.read_line(&mut line).await.unwrap();
        let Some((name, value)) = line.trim_end().split_once(": ") else { return (answer, length) };
        match name {
            "grpc-status" => answer.grpc = Some(Code::from_bytes(value.as_bytes())),
            "grpc-message" => answer.message = value.to_owned(),
            "content-length" => length = Some(value.parse().unwrap()),
            _ => {}
        }
    }
}
