//! A server that does what its script says.

use crate::material::{SIGNER, digest, key, keyring, manifest, signed};
use std::collections::{HashMap, VecDeque};
use std::io::{BufRead as _, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex};
use std::thread;
use std::time::{Duration, Instant};

/// How the server sends a file.
#[derive(Clone, Debug)]
pub(crate) enum Sending {
    Whole,
    /// The connection ends after this many bytes of the body.
    CutAfter(usize),
    /// Nothing comes after this many bytes of the body, and the connection stays open.
    StallAfter(usize),
    /// Other bytes than those of the file.
    Instead(Vec<u8>),
    /// Other bytes, without saying how many.
    InsteadInChunks(Vec<u8>),
    /// All bytes, though some were asked for.
    IgnoringRange,
    /// A part from the first byte on, though a later one was asked for.
    WrongPart,
    /// Pieces with a pause after each.
    Slow {
        piece_bytes: usize,
        pause: Duration,
    },
    Status(u16),
}

/// What the server has and does.
#[derive(Clone, Debug)]
pub(crate) struct Script {
    pub(crate) keyring: String,
    pub(crate) manifest: String,
    /// Manifests of the kernels with these ids, instead of that one.
    pub(crate) manifests: HashMap<&'static str, String>,
    /// Ids of the kernels in every list; the list is this text instead, if it begins with `<`.
    pub(crate) kernels: Vec<&'static str>,
    /// Files by their digest.
    pub(crate) files: HashMap<String, Arc<Vec<u8>>>,
    /// How the next files are sent.
    pub(crate) next: VecDeque<Sending>,
    /// How all files after these are sent.
    pub(crate) sending: Sending,
    /// Status instead of a manifest.
    pub(crate) refusal: Option<(u16, &'static str)>,
    /// Whether every question for a manifest is answered with 304: a server without keys can do this.
    pub(crate) says_unchanged: bool,
    /// Pause after each byte of documents and messages.
    pub(crate) drip: Option<Duration>,
    pub(crate) report_status: u16,
    pub(crate) poll_after_s: u64,
}

/// A request that the server received.
#[derive(Clone, Debug)]
pub(crate) struct Request {
    pub(crate) method: String,
    pub(crate) path: String,
    pub(crate) headers: HashMap<String, String>,
    pub(crate) body: String,
    pub(crate) at: Instant,
}

#[derive(Debug)]
struct Shared {
    script: Mutex<Script>,
    requests: Mutex<Vec<Request>>,
    received: Condvar,
    is_stopped: AtomicBool,
}

#[derive(Debug)]
pub(crate) struct Server {
    address: SocketAddr,
    shared: Arc<Shared>,
}

impl Server {
    pub(crate) fn start() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let script = Script {
            keyring: signed(&keyring(1)),
            manifest: String::new(),
            manifests: HashMap::new(),
            kernels: vec!["515nm-150mm"],
            files: HashMap::new(),
            next: VecDeque::new(),
            sending: Sending::Whole,
            refusal: None,
            says_unchanged: false,
            drip: None,
            report_status: 200,
            poll_after_s: 60,
        };
        let shared = Arc::new(Shared {
            script: Mutex::new(script),
            requests: Mutex::default(),
            received: Condvar::new(),
            is_stopped: AtomicBool::new(false),
        });
        let server = Self { address, shared: Arc::clone(&shared) };
        thread::spawn(move || {
            for stream in listener.incoming() {
                if shared.is_stopped.load(Ordering::SeqCst) {
                    return;
                }
                let shared = Arc::clone(&shared);
                // A client that has gone is what many tests are about.
                thread::spawn(move || {
                    let stream = stream.unwrap();
                    // Head and body are sent one after the other.
                    stream.set_nodelay(true).unwrap();
                    drop(answer(&shared, stream));
                });
            }
        });
        server
    }

    pub(crate) fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    pub(crate) fn change(&self, change: impl FnOnce(&mut Script)) {
        change(&mut self.shared.script.lock().unwrap());
    }

    /// Offers a kernel as the active version.
    pub(crate) fn offer(&self, version: u32, generation: u64, kernel: &[u8]) {
        let document = manifest(version, generation, kernel).signed(&key(SIGNER));
        self.change(|script| {
            script.files.insert(digest(kernel), Arc::new(kernel.to_vec()));
            script.manifest = document;
        });
    }

    /// The requests since the last call of this function.
    pub(crate) fn take_requests(&self) -> Vec<Request> {
        std::mem::take(&mut self.shared.requests.lock().unwrap())
    }

    /// Waits until the requests since the last call of [`Self::take_requests`] satisfy a condition, and returns them.
    pub(crate) fn wait_for(&self, is_enough: impl Fn(&[Request]) -> bool) -> Vec<Request> {
        let requests = self.shared.requests.lock().unwrap();
        let limit = Duration::from_secs(30);
        let (requests, waited) =
            self.shared.received.wait_timeout_while(requests, limit, |requests| !is_enough(requests)).unwrap();
        assert!(!waited.timed_out(), "{requests:?}");
        requests.clone()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.shared.is_stopped.store(true, Ordering::SeqCst);
        let _ = TcpStream::connect(self.address);
    }
}

impl Request {
    /// Reads a request; `None` at the end of the connection.
    fn read(stream: &mut BufReader<impl Read>) -> Option<Self> {
        let mut line = String::new();
        stream.read_line(&mut line).ok()?;
        let mut words = line.split_whitespace();
        let (method, path) = (words.next()?.to_owned(), words.next()?.to_owned());
        let mut headers = HashMap::new();
        loop {
            let mut line = String::new();
            stream.read_line(&mut line).ok()?;
            let Some((name, value)) = line.trim_end().split_once(": ") else { break };
            headers.insert(name.to_lowercase(), value.to_owned());
        }
        let length = headers.get("content-length").map_or(0, |length| length.parse().unwrap());
        let mut body = vec![0; length];
        stream.read_exact(&mut body).ok()?;
        Some(Self { method, path, headers, body: String::from_utf8(body).ok()?, at: Instant::now() })
    }

    pub(crate) fn is_for_file(&self) -> bool {
        self.path.contains("/versions/")
    }

    pub(crate) fn is_for_manifest(&self) -> bool {
        self.path.contains("/manifest?")
    }

    pub(crate) fn is_for_list(&self) -> bool {
        self.path.contains("/kernels?")
    }

    /// Whether it names a kernel that a list has. Requests that name none do.
    fn is_for_one_of(&self, kernels: &[&str]) -> bool {
        let named = self.path.split_once("/kernels/").map(|(_, rest)| rest);
        named.and_then(|rest| rest.split('/').next()).is_none_or(|id| kernels.contains(&id))
    }

    pub(crate) fn is_report(&self) -> bool {
        self.method == "POST"
    }
}

/// Answers the requests of a connection, until the client closes it or the script cuts it.
fn answer(shared: &Shared, stream: impl Read + Write) -> std::io::Result<()> {
    let mut reader = BufReader::new(stream);
    while let Some(request) = Request::read(&mut reader) {
        if !answer_on(shared, &request, reader.get_mut())? {
            break;
        }
    }
    Ok(())
}

/// Answers the requests of a connection that was accepted elsewhere.
pub(crate) fn answer_over(server: &Server, stream: impl Read + Write) {
    let _ = answer(&server.shared, stream);
}

/// Notes a request and answers it. Returns whether the connection goes on.
fn answer_on(shared: &Shared, request: &Request, stream: &mut impl Write) -> std::io::Result<bool> {
    // Note it before the answer: a test looks for it as soon as its agent has the answer.
    shared.requests.lock().unwrap().push(request.clone());
    shared.received.notify_all();
    let (script, sending) = {
        let mut script = shared.script.lock().unwrap();
        let next = if request.is_for_file() { script.next.pop_front() } else { None };
        let sending = next.unwrap_or_else(|| script.sending.clone());
        (script.clone(), sending)
    };
    let sent = if request.is_report() {
        head(stream, script.report_status, "content-type: application/json\r\ncontent-length: 2\r\n")
            .and_then(|()| stream.write_all(b"{}"))
    } else if request.is_for_file() {
        send_file(&script, &sending, request, stream)
    } else {
        send_document(&script, request, stream)
    };
    sent.and_then(|()| stream.flush())?;
    Ok(!request.is_for_file() || !matches!(sending, Sending::CutAfter(_) | Sending::StallAfter(_)))
}

fn head(stream: &mut impl Write, status: u16, fields: &str) -> std::io::Result<()> {
    write!(stream, "HTTP/1.1 {status} Status\r\n{fields}\r\n")
}

fn send_document(script: &Script, request: &Request, stream: &mut impl Write) -> std::io::Result<()> {
    if request.is_for_list() {
        let list = list(script, request);
        head(stream, 200, &format!("content-length: {}\r\n", list.len()))?;
        return send_text(script, &list, stream);
    }
    if request.is_for_manifest() && !request.is_for_one_of(&script.kernels) {
        return head(stream, 404, "content-length: 0\r\n");
    }
    if let Some((status, message)) = script.refusal.filter(|_| request.is_for_manifest()) {
        let body = format!("{{\"detail\": \"{message}\"}}");
        head(stream, status, &format!("content-length: {}\r\n", body.len()))?;
        return send_text(script, &body, stream);
    }
    let of_id = script.manifests.iter().find(|(id, _)| request.is_for_one_of(&[*id])).map(|(_, text)| text);
    let text = match request.is_for_manifest() {
        true => of_id.unwrap_or(&script.manifest),
        false => &script.keyring,
    };
    let etag = format!("\"{}\"", &digest(text.as_bytes())[7..39]);
    let fields = format!("etag: {etag}\r\nlightpath-poll-after-s: {}\r\n", script.poll_after_s);
    let is_unchanged = script.says_unchanged && request.is_for_manifest();
    if is_unchanged || request.headers.get("if-none-match") == Some(&etag) {
        return head(stream, 304, &fields);
    }
    head(stream, 200, &format!("{fields}content-length: {}\r\n", text.len()))?;
    send_text(script, text, stream)
}

/// The kernels of the display, all of them at 515 nm and 150 mm: a question for others finds none.
fn list(script: &Script, request: &Request) -> String {
    let is_asked = !request.path.contains("wavelengthM")
        || request.path.ends_with("/kernels?wavelengthM=515000e-12&place.distanceM=150000000e-9");
    let kernel = |id: &&str| match id.starts_with('<') {
        true => (*id).to_owned(),
        false => format!(
            r#"{{"name": "displays/pluto/kernels/{id}", "wavelengthM": 5.15e-7, "place": {{"distanceM": 0.15}}}}"#
        ),
    };
    let kernels: Vec<String> = script.kernels.iter().filter(|_| is_asked).map(kernel).collect();
    match kernels.first() {
        Some(page) if page.starts_with('<') => page.clone(),
        _ => format!("{{\"kernels\": [{}]}}", kernels.join(", ")),
    }
}

fn send_text(script: &Script, text: &str, stream: &mut impl Write) -> std::io::Result<()> {
    match script.drip {
        Some(pause) => send_body(text.as_bytes(), &Sending::Slow { piece_bytes: 1, pause }, stream),
        None => stream.write_all(text.as_bytes()),
    }
}

fn send_file(script: &Script, sending: &Sending, request: &Request, stream: &mut impl Write) -> std::io::Result<()> {
    let digest = request.path.rsplit('/').next().unwrap();
    let Some(file) = script.files.get(digest) else { return head(stream, 404, "content-length: 0\r\n") };
    let size = file.len();
    let mut first = match request.headers.get("range") {
        Some(range) => {
            assert!(!request.headers.contains_key("if-range"), "web servers for files have other ETags");
            range.strip_prefix("bytes=").and_then(|range| range.strip_suffix('-')).unwrap().parse().unwrap()
        }
        None => 0,
    };
    if first >= size && first > 0 {
        return head(stream, 416, &format!("content-range: bytes */{size}\r\ncontent-length: 0\r\n"));
    }
    match sending {
        Sending::Status(status) => return head(stream, *status, "content-length: 0\r\n"),
        Sending::Instead(bytes) => {
            head(stream, 200, &format!("content-length: {}\r\n", bytes.len()))?;
            return stream.write_all(bytes);
        }
        Sending::InsteadInChunks(bytes) => {
            head(stream, 200, "transfer-encoding: chunked\r\n")?;
            write!(stream, "{:x}\r\n", bytes.len())?;
            stream.write_all(bytes)?;
            return stream.write_all(b"\r\n0\r\n\r\n");
        }
        Sending::IgnoringRange => first = 0,
        _ => {}
    }
    let length = format!("content-length: {}\r\n", size - first);
    let said = if matches!(sending, Sending::WrongPart) { 0 } else { first };
    match first {
        0 => head(stream, 200, &length)?,
        _ => head(stream, 206, &format!("{length}content-range: bytes {said}-{}/{size}\r\n", size - 1))?,
    }
    send_body(&file[first..], sending, stream)
}

fn send_body(body: &[u8], sending: &Sending, stream: &mut impl Write) -> std::io::Result<()> {
    match *sending {
        Sending::CutAfter(bytes) => stream.write_all(&body[..bytes.min(body.len())]),
        Sending::StallAfter(bytes) => {
            stream.write_all(&body[..bytes.min(body.len())])?;
            stream.flush()?;
            thread::sleep(Duration::from_secs(5));
            Ok(())
        }
        Sending::Slow { piece_bytes, pause } => {
            for piece in body.chunks(piece_bytes) {
                stream.write_all(piece)?;
                stream.flush()?;
                thread::sleep(pause);
            }
            Ok(())
        }
        _ => stream.write_all(body),
    }
}
