//! What the agent remembers over restarts: a text file, replaced in one step.
//!
//! ```text
//! lightpath-agent state 1
//! display pluto
//! roots 3d4017c3…                  root keys that were pinned when the keyring was accepted
//! keyring 3
//! generation 7
//! kernel c7b87820… 515nm-150mm     digest of the optics, id of the kernel that the server has for them
//! earliest 2026-11-23T18:00:00Z
//! confirmed 2026-11-23T18:00:00Z 2026-11-30T18:00:00Z
//! etag "0f…"
//! rejected 13 7 sha256-… the self-test refused version 13: …
//! loss sha256-… 0.0123
//! check 92a009a9f0d4cab8
//! ```
//!
//! Lines of things that the agent does not know are absent. `check` has the first eight bytes of the SHA-256 of all lines
//! before it, so that a damaged file is not believed.

use crate::problem::Problem;
use crate::{durable, log, regular_file};
use lightpath_manifest::{Manifest, Time};
use sha2::{Digest as _, Sha256};
use std::fmt::Write as _;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

const HEAD: &str = "lightpath-agent state 1";
/// Limit on the size of the file \[bytes\]: far above what the agent writes.
const FILE_BYTES_MAX: u64 = 64 << 10;
/// Limit on the length of an ETag \[bytes\]. The server's have 34.
const ETAG_BYTES_MAX: usize = 256;

/// A version that the agent gave up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Rejected {
    pub(crate) version: u32,
    pub(crate) generation: u64,
    pub(crate) digest: String,
    /// The cause, in one line.
    pub(crate) message: String,
}

impl Rejected {
    /// Whether the manifest offers what was given up. Another version, generation or file is a new chance.
    pub(crate) fn is_of(&self, manifest: &Manifest) -> bool {
        (self.version, self.generation, &self.digest) == (manifest.version, manifest.generation, &manifest.digest)
    }
}

/// The times of a manifest that was accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Confirmed {
    pub(crate) issued: Time,
    pub(crate) expires: Time,
}

/// What the agent remembers.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct State {
    /// Display that the generation belongs to.
    pub(crate) display: String,
    /// Digest of optics, and the id of the display's kernel that the server named for them.
    pub(crate) kernel: Option<(String, String)>,
    /// Root keys that were pinned, separated by commas.
    pub(crate) roots: String,
    /// Highest version of a keyring that was accepted.
    pub(crate) keyring: u32,
    /// Highest generation of a manifest that was accepted.
    pub(crate) generation: u64,
    /// The latest time at which an accepted document was issued: it is this time or later.
    pub(crate) earliest: Option<Time>,
    /// Times of the manifest that was accepted last. Until its end the server may answer that nothing has changed.
    pub(crate) confirmed: Option<Confirmed>,
    /// ETag of the manifest that was dealt with last; empty: none.
    pub(crate) etag: String,
    pub(crate) rejected: Option<Rejected>,
    /// Digest of a kernel and the loss that its self-test printed.
    pub(crate) loss: Option<(String, f64)>,
}

impl State {
    fn text(&self) -> String {
        let mut text = format!("{HEAD}\ndisplay {}\nroots {}\n", self.display, self.roots);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "keyring {}\ngeneration {}", self.keyring, self.generation);
        if let Some((optics, id)) = &self.kernel {
            let _ = writeln!(text, "kernel {optics} {id}");
        }
        if let Some(earliest) = self.earliest {
            let _ = writeln!(text, "earliest {earliest}");
        }
        if let Some(Confirmed { issued, expires }) = self.confirmed {
            let _ = writeln!(text, "confirmed {issued} {expires}");
        }
        if !self.etag.is_empty() {
            let _ = writeln!(text, "etag {}", self.etag);
        }
        if let Some(Rejected { version, generation, digest, message }) = &self.rejected {
            let _ = writeln!(text, "rejected {version} {generation} {digest} {message}");
        }
        if let Some((digest, loss)) = &self.loss {
            let _ = writeln!(text, "loss {digest} {loss}");
        }
        let check = check_of(&text);
        text + "check " + &check + "\n"
    }

    fn parse(text: &str) -> Option<Self> {
        let (lines, check) = text.strip_suffix('\n')?.rsplit_once("\ncheck ")?;
        let mut state = Self::default();
        if check_of(&format!("{lines}\n")) != check {
            return None;
        }
        let mut lines = lines.lines();
        if lines.next() != Some(HEAD) {
            return None;
        }
        for line in lines {
            let (name, value) = line.split_once(' ')?;
            match name {
                "display" => state.display = value.to_owned(),
                "kernel" => {
                    let (optics, id) = value.split_once(' ')?;
                    state.kernel = Some((optics.to_owned(), id.to_owned()));
                }
                "roots" => state.roots = value.to_owned(),
                "keyring" => state.keyring = value.parse().ok()?,
                "generation" => state.generation = value.parse().ok()?,
                "earliest" => state.earliest = Some(Time::parse(value)?),
                "confirmed" => {
                    let (issued, expires) = value.split_once(' ')?;
                    state.confirmed = Some(Confirmed { issued: Time::parse(issued)?, expires: Time::parse(expires)? });
                }
                "etag" => state.etag = value.to_owned(),
                "rejected" => {
                    let mut words = value.splitn(4, ' ');
                    let (version, generation) = (words.next()?.parse().ok()?, words.next()?.parse().ok()?);
                    let (digest, message) = (words.next()?.to_owned(), words.next()?.to_owned());
                    state.rejected = Some(Rejected { version, generation, digest, message });
                }
                "loss" => {
                    let (digest, loss) = value.split_once(' ')?;
                    state.loss = Some((digest.to_owned(), loss.parse().ok()?));
                }
                // A newer agent wrote the line before it was replaced by this one.
                _ => {}
            }
        }
        Some(state)
    }
}

/// What a server must prove before the state of another server or display is overwritten. Settings that were wrong for one
/// start so cost nothing: the generation of the right display is remembered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Proof {
    /// A keyring that the pinned root keys signed.
    Keyring,
    /// A manifest for the display of the settings.
    Manifest,
}

/// The state and the file that holds it.
#[derive(Debug)]
pub(crate) struct StateFile {
    path: PathBuf,
    saved: State,
    /// What must come before the file is written again; `None`: nothing.
    awaited: Option<Proof>,
    pub(crate) state: State,
}

impl StateFile {
    /// Reads the file. A missing or damaged one counts as empty: the manifest in the slots still says which generation
    /// was accepted.
    pub(crate) fn open(path: PathBuf) -> Self {
        let saved = match read(&path) {
            Ok(Some(state)) => state,
            Ok(None) => {
                log::line(format_args!("the agent ignores {}, because the file is damaged", path.display()));
                State::default()
            }
            Err(error) => {
                if error.kind() != io::ErrorKind::NotFound {
                    log::line(format_args!("the agent cannot read {}: {error}", path.display()));
                }
                State::default()
            }
        };
        Self { path, state: saved.clone(), awaited: None, saved }
    }

    /// Begins anew, in memory alone until the proof is there.
    pub(crate) fn begin_anew(&mut self, state: State, awaited: Proof) {
        (self.state, self.awaited) = (state, Some(awaited));
    }

    /// Notes a proof, after which the file may be written.
    pub(crate) fn note(&mut self, proof: Proof) {
        self.awaited = self.awaited.filter(|awaited| *awaited != proof);
    }

    /// Writes the state, if it has changed and nothing is awaited.
    pub(crate) fn save(&mut self) -> Result<(), Problem> {
        if self.state == self.saved || self.awaited.is_some() {
            return Ok(());
        }
        durable::write_file(&self.path, self.state.text().as_bytes()).map_err(Problem::disk("write", &self.path))?;
        self.saved = self.state.clone();
        Ok(())
    }

    /// Remembers the ETag of a manifest that was dealt with. An ETag that cannot be written into a line is left out.
    pub(crate) fn set_etag(&mut self, etag: Option<&str>) {
        let is_plain = |etag: &&str| etag.len() <= ETAG_BYTES_MAX && etag.bytes().all(|byte| byte.is_ascii_graphic());
        self.state.etag = etag.filter(is_plain).unwrap_or_default().to_owned();
    }
}

/// Reads a state without the right to change it; `None` if the file is damaged.
pub(crate) fn read(path: &Path) -> io::Result<Option<State>> {
    let mut bytes = Vec::new();
    regular_file::open(path)?.take(FILE_BYTES_MAX + 1).read_to_end(&mut bytes)?;
    let whole = Some(bytes).filter(|bytes| bytes.len() as u64 <= FILE_BYTES_MAX);
    Ok(whole.and_then(|bytes| String::from_utf8(bytes).ok()).and_then(|text| State::parse(&text)))
}

fn check_of(text: &str) -> String {
    Sha256::digest(text)[..8].iter().fold(String::new(), |hex, byte| hex + &format!("{byte:02x}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state() -> State {
        State {
            display: "pluto".to_owned(),
            kernel: Some(("00".repeat(32), "515nm-150mm".to_owned())),
            roots: "00".repeat(32),
            keyring: 3,
            generation: 7,
            earliest: Time::from_unix_s(3),
            confirmed: Time::from_unix_s(1)
                .zip(Time::from_unix_s(2))
                .map(|(issued, expires)| Confirmed { issued, expires }),
            etag: "\"0f\"".to_owned(),
            rejected: Some(Rejected {
                version: 13,
                generation: 7,
                digest: "sha256-0f".to_owned(),
                message: "exit status 3: too blurred".to_owned(),
            }),
            loss: Some(("sha256-00".to_owned(), 0.0123)),
        }
    }

    #[test]
    fn state_is_read_back_and_damaged_files_are_not_believed() {
        for state in [state(), State::default()] {
            assert_eq!(State::parse(&state.text()), Some(state));
        }
        let text = state().text();
        for end in 0..text.len() {
            assert_eq!(State::parse(&text[..end]), None, "{end}");
        }
        assert_eq!(State::parse(&text.replace("generation 7", "generation 6")), None);
    }

    #[test]
    fn file_is_written_only_when_something_has_changed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state");
        let mut file = StateFile::open(path.clone());
        file.save().unwrap();
        assert!(!path.exists());
        file.state = state();
        file.set_etag(Some("\"with\nline\""));
        assert_eq!(file.state.etag, "");
        file.save().unwrap();
        assert_eq!(StateFile::open(path).state, file.state);
    }
}
