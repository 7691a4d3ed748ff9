//! A small S3 server that answers as it should, or without an end.

use super::options::RemoteOptions;
use super::tests::MIB;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use uuid::Uuid;

/// What is wrong with the answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wrong {
    Nothing,
    /// Each page of a list is full and names a next one.
    EndlessPages,
    /// Each page of a list is empty and names a next one.
    EmptyPages,
    /// A page of a list has no end.
    EndlessPage,
    /// A page of a list announces 2^62 bytes.
    LongPage,
    /// Each request has this status, and a text without an end.
    EndlessError(u16),
    /// Each request has the status 404, and a text that announces 2^62 bytes.
    LongError,
    /// An object has more bytes than were asked for.
    LongObject,
    /// A list gives each object this size \[bytes\].
    Sizes(u64),
}

pub(super) struct HostileServer {
    address: String,
    state: Arc<State>,
}

struct State {
    wrong: Mutex<Wrong>,
    objects: Mutex<BTreeMap<String, Vec<u8>>>,
    sent_bytes: AtomicU64,
}

struct Request {
    method: String,
    /// Path and query.
    target: String,
    /// Names in lower case.
    headers: BTreeMap<String, String>,
    body: Vec<u8>,
}

impl HostileServer {
    pub(super) fn start() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("http://{}", listener.local_addr().unwrap());
        let state =
            State { wrong: Mutex::new(Wrong::Nothing), objects: Mutex::default(), sent_bytes: AtomicU64::default() };
        let state = Arc::new(state);
        let of_thread = Arc::clone(&state);
        thread::spawn(move || {
            for stream in listener.incoming() {
                let (stream, state) = (stream.unwrap(), Arc::clone(&of_thread));
                // An error means that the client has hung up.
                thread::spawn(move || drop(serve(stream, &state)));
            }
        });
        Self { address, state }
    }

    pub(super) fn options(&self) -> RemoteOptions {
        RemoteOptions {
            url: "s3://bucket/lab".into(),
            endpoint: Some(self.address.clone()),
            region: "us-east-1".into(),
            access_key_id: "id".into(),
            secret_access_key: "key".into(),
            allow_http: true,
            cache_bytes_max: 1 << 40,
        }
    }

    /// From now on, answers are wrong in this way, and the sent bytes are counted from 0.
    pub(super) fn set(&self, wrong: Wrong) {
        *self.state.wrong.lock().unwrap() = wrong;
        self.state.sent_bytes.store(0, Ordering::SeqCst);
    }

    /// Bytes that the connections have taken.
    pub(super) fn sent_bytes(&self) -> u64 {
        self.state.sent_bytes.load(Ordering::SeqCst)
    }
}

fn serve(stream: TcpStream, state: &State) -> io::Result<()> {
    let mut reader = BufReader::new(stream.try_clone()?);
    while let Some(request) = read(&mut reader)? {
        let wrong = *state.wrong.lock().unwrap();
        let is_list = request.target.contains("list-type=2");
        let mut connection = Connection { stream: stream.try_clone()?, state };
        match wrong {
            Wrong::EndlessError(status) => connection.endless(status)?,
            Wrong::LongError => connection.announce(404)?,
            Wrong::EndlessPage if is_list => connection.endless(200)?,
            Wrong::LongPage if is_list => connection.announce(200)?,
            Wrong::EndlessPages if is_list => {
                let page: String = (0..1000).map(|_| entry(&object_key(), 1)).collect();
                connection.answer(200, "", list(&page, true).as_bytes())?;
            }
            Wrong::EmptyPages if is_list => connection.answer(200, "", list("", true).as_bytes())?,
            Wrong::LongObject if request.method == "GET" && !is_list => {
                let headers = format!("Content-Range: bytes 0-3/4\r\n{LAST_MODIFIED}");
                connection.answer(206, &headers, &vec![0; MIB])?;
            }
            Wrong::Sizes(size_bytes) if is_list => connection.list(&request, Some(size_bytes))?,
            _ => connection.answer_well(&request)?,
        }
    }
    Ok(())
}

const LAST_MODIFIED: &str = "Last-Modified: Wed, 01 Jan 2025 00:00:00 GMT\r\n";

fn read(reader: &mut BufReader<TcpStream>) -> io::Result<Option<Request>> {
    let mut line = String::new();
    if reader.read_line(&mut line)? == 0 {
        return Ok(None);
    }
    let mut words = line.split(' ').map(str::to_owned);
    let (method, target) = (words.next().unwrap(), words.next().unwrap());
    let mut headers = BTreeMap::new();
    loop {
        let mut line = String::new();
        reader.read_line(&mut line)?;
        let Some((name, value)) = line.trim_end().split_once(": ") else { break };
        headers.insert(name.to_lowercase(), value.to_owned());
    }
    let length = headers.get("content-length").map_or(0, |length| length.parse().unwrap());
    let mut body = vec![0; length];
    reader.read_exact(&mut body)?;
    Ok(Some(Request { method, target, headers, body }))
}

fn object_key() -> String {
    let digest = format!("sha256-{}", "a".repeat(64));
    format!("lab/artifacts/aa/{digest}/{}", Uuid::now_v7())
}

fn entry(key: &str, size_bytes: u64) -> String {
    format!(
        "<Contents><Key>{key}</Key><LastModified>2025-01-01T00:00:00.000Z</LastModified><Size>{size_bytes}</Size></Contents>"
    )
}

fn list(entries: &str, is_endless: bool) -> String {
    let mut page = String::from("<ListBucketResult>");
    page.push_str(entries);
    if is_endless {
        write!(page, "<NextContinuationToken>{}</NextContinuationToken>", Uuid::now_v7()).unwrap();
    }
    page.push_str("</ListBucketResult>");
    page
}

struct Connection<'a> {
    stream: TcpStream,
    state: &'a State,
}

impl Connection<'_> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.write_all(bytes)?;
        self.state.sent_bytes.fetch_add(bytes.len() as u64, Ordering::SeqCst);
        Ok(())
    }

    fn begin(&mut self, status: u16, headers: &str) -> io::Result<()> {
        self.send(format!("HTTP/1.1 {status} -\r\n{headers}\r\n").as_bytes())
    }

    fn answer(&mut self, status: u16, headers: &str, body: &[u8]) -> io::Result<()> {
        self.begin(status, &format!("{headers}Content-Length: {}\r\n", body.len()))?;
        self.send(body)
    }

    /// Sends a body without an end.
    fn endless(&mut self, status: u16) -> io::Result<()> {
        self.begin(status, "Transfer-Encoding: chunked\r\n")?;
        let chunk = vec![b' '; MIB];
        loop {
            self.send(format!("{:x}\r\n", chunk.len()).as_bytes())?;
            self.send(&chunk)?;
            self.send(b"\r\n")?;
        }
    }

    /// Announces 2^62 bytes, and sends some of them.
    fn announce(&mut self, status: u16) -> io::Result<()> {
        self.begin(status, &format!("Content-Length: {}\r\n", 1_u64 << 62))?;
        loop {
            self.send(&[b' '; 4096])?;
        }
    }

    fn list(&mut self, request: &Request, size_bytes: Option<u64>) -> io::Result<()> {
        let prefix = request.target.split("prefix=").nth(1).unwrap().replace("%2F", "/");
        let objects = self.state.objects.lock().unwrap();
        let below = objects.iter().filter(|(key, _)| key.starts_with(&prefix));
        let entries: String = below.map(|(key, bytes)| entry(key, size_bytes.unwrap_or(bytes.len() as u64))).collect();
        drop(objects);
        self.answer(200, "", list(&entries, false).as_bytes())
    }

    fn answer_well(&mut self, request: &Request) -> io::Result<()> {
        if request.target.contains("list-type=2") {
            return self.list(request, None);
        }
        let key = request.target.trim_start_matches("/bucket/").split('?').next().unwrap().to_owned();
        let found = self.state.objects.lock().unwrap().get(&key).cloned();
        match (request.method.as_str(), found) {
            ("PUT", Some(_)) if request.headers.contains_key("if-none-match") => self.answer(412, "", b""),
            ("PUT", _) => {
                self.state.objects.lock().unwrap().insert(key, request.body.clone());
                self.answer(200, "ETag: \"1\"\r\n", b"")
            }
            // A removal of keys that the body lists.
            ("POST", _) => {
                let body = String::from_utf8_lossy(&request.body);
                let key = body.split("<Key>").nth(1).unwrap().split('<').next().unwrap();
                self.state.objects.lock().unwrap().remove(key);
                let removed = format!("<DeleteResult><Deleted><Key>{key}</Key></Deleted></DeleteResult>");
                self.answer(200, "", removed.as_bytes())
            }
            (_, None) => self.answer(404, "", b"<Error><Code>NoSuchKey</Code></Error>"),
            (_, Some(bytes)) => match request.headers.get("range") {
                None => self.answer(200, LAST_MODIFIED, &bytes),
                Some(range) => {
                    let (start, end) = range.trim_start_matches("bytes=").split_once('-').unwrap();
                    let (start, end): (usize, usize) = (start.parse().unwrap(), end.parse().unwrap());
                    let last = end.min(bytes.len() - 1);
                    let range = format!("Content-Range: bytes {start}-{last}/{}\r\n{LAST_MODIFIED}", bytes.len());
                    self.answer(206, &range, &bytes[start..=last])
                }
            },
        }
    }
}
