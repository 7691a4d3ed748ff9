//! A person works at the bench: requests wait.

use serde::{Deserialize, Serialize};
use std::io;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// Who works at the bench, and since when.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pause {
    /// Who and why, such as `aligning, Ada`.
    pub reason: String,
    /// Begin \[s since 1970\].
    pub since_unix_s: u64,
}

impl Pause {
    /// A pause that begins now.
    #[must_use]
    pub fn now(reason: &str) -> Self {
        let since_unix_s = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
        Self { reason: reason.to_owned(), since_unix_s }
    }

    /// The pause in words.
    #[must_use]
    pub fn in_words(&self) -> String {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
        let minutes = now.saturating_sub(self.since_unix_s) / 60;
        format!("paused for {minutes} min: {}", self.reason)
    }
}

/// The files of a pause: what a person wants, and that the rig has seen it.
#[derive(Clone, Debug)]
pub struct PauseFile {
    wanted: PathBuf,
    seen: PathBuf,
}

impl PauseFile {
    /// The files in a rig's folder.
    #[must_use]
    pub fn in_folder(folder: &Path) -> Self {
        Self { wanted: folder.join("pause"), seen: folder.join("paused") }
    }

    /// The pause, if there is one. A file that cannot be read counts: somebody wanted a pause.
    #[must_use]
    pub fn read(&self) -> Option<Pause> {
        match std::fs::read(&self.wanted) {
            Ok(bytes) => {
                let unknown = Pause { reason: "the file `pause` is there".to_owned(), since_unix_s: 0 };
                Some(serde_json::from_slice(&bytes).unwrap_or(unknown))
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => Some(Pause { reason: format!("the file `pause` cannot be read: {error}"), since_unix_s: 0 }),
        }
    }

    /// Begins a pause.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub fn begin(&self, pause: &Pause) -> io::Result<()> {
        if let Some(folder) = self.wanted.parent() {
            std::fs::create_dir_all(folder)?;
        }
        let text = serde_json::to_vec(pause).map_err(io::Error::other)?;
        lightpath::replace_file(&self.wanted, &text).map_err(io::Error::other)
    }

    /// Ends the pause. True if there was one.
    ///
    /// # Errors
    ///
    /// The file cannot be removed.
    pub fn end(&self) -> io::Result<bool> {
        removed(&self.wanted)
    }

    /// Says that the bench is safe, or is used again. A mark that cannot be written lets the person wait in vain, and is
    /// only logged: the bench is safe all the same.
    pub fn mark_seen(&self, is_paused: bool) {
        let marked = if is_paused { std::fs::write(&self.seen, "") } else { removed(&self.seen).map(|_| ()) };
        if let Err(error) = marked {
            crate::log::line(format_args!("{} cannot be changed: {error}", self.seen.display()));
        }
    }

    /// Whether the rig has seen the pause: the bench is safe.
    #[must_use]
    pub fn is_seen(&self) -> bool {
        self.seen.exists()
    }
}

fn removed(path: &Path) -> io::Result<bool> {
    match std::fs::remove_file(path) {
        Ok(()) => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}
