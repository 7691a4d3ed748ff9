//! Fetches a file into a part on the disk, which continues after every interruption.

use crate::http::{Http, PIECE_BYTES, reason_of};
use crate::problem::{BodyProblem, Problem};
use crate::regular_file;
use crate::settings::Pace;
use lightpath_fail_points as fail;
use lightpath_manifest::Manifest;
use sha2::{Digest as _, Sha256};
use std::fs::File;
use std::io::{self, Read, Seek as _, SeekFrom, Write as _};
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};
use ureq::Body;
use ureq::http::{Response, header};

/// Limit on the cuts of one poll. After it, the agent asks for the manifest again, and pauses.
const CUTS_MAX: u32 = 20;

/// Fetches the file of a manifest to `path`, from the byte on at which an earlier try ended. Afterwards the file is
/// whole, right and flushed. A corrupt one is removed and fetched once more, from the start. After the time that
/// [`Pace`] gives a file, what has arrived stays for the next try.
pub(crate) fn fetch(http: &Http, pace: Pace, kernel: &str, manifest: &Manifest, path: &Path) -> Result<(), Problem> {
    let end = Instant::now() + pace.time_for_file(manifest.size_bytes);
    let part = Part { http, pace, kernel, manifest, path, end };
    match part.fetch_once() {
        Err(Problem::Body { .. }) => {
            part.remove()?;
            part.fetch_once().inspect_err(|problem| {
                if matches!(problem, Problem::Body { .. }) {
                    // The next poll begins again, even if this removal fails: then the digest is wrong again.
                    let _ = part.remove();
                }
            })
        }
        ended => ended,
    }
}

/// Takes the file of a manifest from the disk: copies `from` to `path`, and flushes it. Returns whether its bytes are those
/// of the manifest.
///
/// It is no second link to `from`: a bad sector, or a self-test that writes, must not reach the kernel in use.
pub(crate) fn copy(from: &Path, manifest: &Manifest, path: &Path) -> Result<bool, Problem> {
    let mut source = regular_file::open(from).map_err(Problem::disk("read", from))?;
    let written = Problem::disk("write", path);
    let mut write = || -> io::Result<String> {
        let mut received = Received::open(path)?;
        received.restart()?;
        let mut piece = vec![0; PIECE_BYTES];
        loop {
            let length = read(&mut source, &mut piece)?;
            if length == 0 {
                break;
            }
            received.write(&piece[..length])?;
        }
        fail::point("part.flush")?;
        received.file.sync_all()?;
        Ok(digest(received.hasher))
    };
    Ok(write().map_err(written)? == manifest.digest)
}

/// SHA-256 of a file, in the form of a manifest.
pub(crate) fn digest_of_file(path: &Path) -> io::Result<String> {
    let mut hasher = Sha256::new();
    hash_rest(&mut regular_file::open(path)?, &mut hasher)?;
    Ok(digest(hasher))
}

/// A file that is being fetched.
struct Part<'a> {
    http: &'a Http,
    pace: Pace,
    /// Id of the kernel in addresses.
    kernel: &'a str,
    manifest: &'a Manifest,
    path: &'a Path,
    /// When this try ends.
    end: Instant,
}

/// The bytes of a part so far.
struct Received {
    file: File,
    hasher: Sha256,
    bytes: u64,
}

impl Part<'_> {
    fn fetch_once(&self) -> Result<(), Problem> {
        let mut received = self.open().map_err(self.disk("write"))?;
        let before = received.bytes;
        let mut cuts = 0;
        while received.bytes < self.manifest.size_bytes {
            let begin = received.bytes;
            let Err((reason, problem)) = self.receive(&mut received) else { continue };
            if let Some(problem) = problem {
                return Err(problem);
            }
            cuts += 1;
            if received.bytes == begin || cuts == CUTS_MAX || self.left().is_zero() {
                return Err(Problem::Cut {
                    version: self.manifest.version,
                    bytes: received.bytes,
                    size_bytes: self.manifest.size_bytes,
                    has_progress: received.bytes > before,
                    reason,
                });
            }
            thread::sleep(self.pace.cut_pause);
        }
        let found = digest(received.hasher);
        if found != self.manifest.digest {
            return Err(self.wrong(BodyProblem::Digest { found, wanted: self.manifest.digest.clone() }));
        }
        fail::point("part.flush").and_then(|()| received.file.sync_all()).map_err(self.disk("flush"))
    }

    /// Opens the part, and hashes what an earlier try has left of it.
    fn open(&self) -> io::Result<Received> {
        let mut received = Received::open(self.path)?;
        if received.bytes > self.manifest.size_bytes {
            received.restart()?;
        }
        hash_rest(&mut received.file, &mut received.hasher)?;
        Ok(received)
    }

    /// Time that is left for this try.
    fn left(&self) -> Duration {
        self.end.saturating_duration_since(Instant::now())
    }

    /// Receives the rest of the file. An error without a problem is a cut.
    fn receive(&self, received: &mut Received) -> Result<(), (String, Option<Problem>)> {
        let is = |problem| (String::new(), Some(problem));
        let response = match self.http.file(self.kernel, self.manifest, received.bytes, self.left()) {
            Err(Problem::Unreachable { reason, .. }) => return Err((reason, None)),
            answer => answer.map_err(is)?,
        };
        self.place(&response, received).map_err(is)?;
        let mut body = response.into_body().into_reader();
        let mut piece = vec![0; PIECE_BYTES];
        loop {
            match read(&mut body, &mut piece) {
                Ok(0) => break,
                Ok(length) => self.write(&piece[..length], received).map_err(is)?,
                Err(error) => return Err((reason_of(&error.into()), None)),
            }
        }
        if received.bytes < self.manifest.size_bytes {
            return Err(("the server ended the body".to_owned(), None));
        }
        Ok(())
    }

    /// Checks which bytes an answer has, and goes there in the part.
    fn place(&self, response: &Response<Body>, received: &mut Received) -> Result<(), Problem> {
        let size_bytes = self.manifest.size_bytes;
        let field = |name| response.headers().get(name).and_then(|value: &header::HeaderValue| value.to_str().ok());
        match response.status().as_u16() {
            200 => {
                if received.bytes > 0 {
                    received.restart().map_err(self.disk("write"))?;
                }
            }
            206 => {
                let found = field(header::CONTENT_RANGE).unwrap_or_default();
                let rest = found.strip_prefix(&format!("bytes {}-", received.bytes));
                if !rest.is_some_and(|rest| rest.ends_with(&format!("/{size_bytes}"))) {
                    let found = crate::http::one_line(found, 100);
                    return Err(self.wrong(BodyProblem::Part { found, first: received.bytes, size_bytes }));
                }
            }
            // The file ends before the bytes that were asked for.
            _ => return Err(self.wrong(BodyProblem::Shorter { found_bytes: received.bytes, size_bytes })),
        }
        match field(header::CONTENT_LENGTH).and_then(|length| length.parse::<u64>().ok()) {
            Some(length) if length > size_bytes - received.bytes => Err(self.wrong(BodyProblem::Longer { size_bytes })),
            Some(length) if length < size_bytes - received.bytes => {
                let found_bytes = received.bytes + length;
                Err(self.wrong(BodyProblem::Shorter { found_bytes, size_bytes }))
            }
            _ => Ok(()),
        }
    }

    fn write(&self, bytes: &[u8], received: &mut Received) -> Result<(), Problem> {
        let size_bytes = self.manifest.size_bytes;
        if bytes.len() as u64 > size_bytes - received.bytes {
            return Err(self.wrong(BodyProblem::Longer { size_bytes }));
        }
        received.write(bytes).map_err(|error| {
            if Problem::is_no_space(&error) {
                // Other programs need the space more than an unfinished file.
                let _ = self.remove();
            }
            self.disk("write")(error)
        })
    }

    fn remove(&self) -> Result<(), Problem> {
        crate::durable::remove(self.path).map_err(self.disk("remove"))
    }

    fn wrong(&self, problem: BodyProblem) -> Problem {
        Problem::Body { version: self.manifest.version, problem }
    }

    fn disk(&self, action: &'static str) -> impl FnOnce(io::Error) -> Problem {
        Problem::disk(action, self.path)
    }
}

impl Received {
    /// Opens a part, or makes it.
    fn open(path: &Path) -> io::Result<Self> {
        let file = regular_file::open_for_writing(path)?;
        Ok(Self { hasher: Sha256::new(), bytes: file.metadata()?.len(), file })
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        fail::point("part.write")?;
        self.file.write_all(bytes)?;
        self.hasher.update(bytes);
        self.bytes += bytes.len() as u64;
        Ok(())
    }

    fn restart(&mut self) -> io::Result<()> {
        fail::point("part.truncate")?;
        self.file.set_len(0)?;
        self.file.seek(SeekFrom::Start(0))?;
        (self.hasher, self.bytes) = (Sha256::new(), 0);
        Ok(())
    }
}

/// Reads the next bytes.
fn read(source: &mut impl Read, piece: &mut [u8]) -> io::Result<usize> {
    loop {
        match source.read(piece) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            ended => return ended,
        }
    }
}

fn hash_rest(file: &mut File, hasher: &mut Sha256) -> io::Result<()> {
    let mut piece = vec![0; PIECE_BYTES];
    loop {
        let length = read(file, &mut piece)?;
        if length == 0 {
            return Ok(());
        }
        hasher.update(&piece[..length]);
    }
}

fn digest(hasher: Sha256) -> String {
    hasher.finalize().iter().fold("sha256-".to_owned(), |digest, byte| digest + &format!("{byte:02x}"))
}
