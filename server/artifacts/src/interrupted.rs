//! Uploads that were interrupted: their stored parts wait for a call that continues them. They are the first to go when
//! room is needed, and none waits longer than [`UPLOAD_AGE_MAX`].

use crate::digest::digest_of;
use crate::error::{ArtifactError, Result};
use sha2::Sha256;
use std::collections::HashMap;
use std::fs;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};

/// Time after which an interrupted upload that has not grown is removed: a broken network is mended, or a computer that
/// slept over night goes on.
pub const UPLOAD_AGE_MAX: Duration = Duration::from_secs(24 * 3600);

/// Limit on the interrupted uploads of one owner, so that nobody fills the folder with tiny files. Beyond it, the
/// owner's oldest one goes.
const PER_OWNER_MAX: usize = 100;

/// The interrupted uploads of one data folder.
#[derive(Debug)]
pub(crate) struct Interrupted {
    folder: PathBuf,
    /// By the names of their files. Whoever removes a file holds this lock, so that no call continues it meanwhile.
    kept: Mutex<HashMap<String, Kept>>,
}

/// The stored part of an upload.
#[derive(Clone, Debug)]
pub(crate) struct Kept {
    pub(crate) size_bytes: u64,
    pub(crate) since: SystemTime,
    /// State of the hash of the part; `None` if an earlier process received it.
    pub(crate) hasher: Option<Sha256>,
}

impl Interrupted {
    /// The interrupted uploads in `folder`. Removes those that nobody can continue or that are too old.
    pub(crate) fn open(folder: PathBuf) -> Result<Self> {
        let mut kept = HashMap::new();
        let mut read = || -> std::io::Result<()> {
            for file in fs::read_dir(&folder)? {
                let (name, metadata) =
                    (file.as_ref().map(fs::DirEntry::file_name), file.as_ref().map(fs::DirEntry::metadata));
                let (Ok(name), Ok(metadata)) = (name, metadata) else { continue };
                let (name, metadata) = (name.to_string_lossy().into_owned(), metadata?);
                match is_continuable(&name) {
                    true => {
                        let since = metadata.modified()?;
                        kept.insert(name, Kept { size_bytes: metadata.len(), since, hasher: None });
                    }
                    false => fs::remove_file(folder.join(&name))?,
                }
            }
            Ok(())
        };
        read().map_err(|error| ArtifactError::io("read the interrupted uploads", error))?;
        let interrupted = Self { folder, kept: Mutex::new(kept) };
        interrupted.remove_old(SystemTime::now());
        Ok(interrupted)
    }

    /// Takes an upload out, because a call continues it.
    pub(crate) fn take(&self, file_name: &str) -> Option<Kept> {
        self.kept().remove(file_name)
    }

    /// Keeps the part of an upload that has ended early.
    pub(crate) fn keep(&self, file_name: &str, part: Kept) {
        let mut kept = self.kept();
        kept.insert(file_name.to_owned(), part);
        let of_owner = owner_of(file_name);
        if kept.keys().filter(|name| owner_of(name) == of_owner).count() > PER_OWNER_MAX {
            self.remove_oldest(&mut kept, |name| owner_of(name) == of_owner);
        }
    }

    /// Size of all interrupted uploads \[bytes\].
    pub(crate) fn bytes(&self) -> u64 {
        self.kept().values().map(|part| part.size_bytes).sum()
    }

    /// Size of the interrupted uploads of an owner \[bytes\].
    pub(crate) fn bytes_of(&self, owner: &str) -> u64 {
        let owner = digest_of(owner.as_bytes());
        let kept = self.kept();
        kept.iter().filter(|(name, _)| owner_of(name) == Some(&owner)).map(|(_, part)| part.size_bytes).sum()
    }

    /// Removes the oldest upload; `false` if there is none.
    pub(crate) fn remove_one(&self) -> bool {
        self.remove_oldest(&mut self.kept(), |_| true)
    }

    /// Removes the oldest upload of an owner; `false` if there is none.
    pub(crate) fn remove_one_of(&self, owner: &str) -> bool {
        let owner = digest_of(owner.as_bytes());
        self.remove_oldest(&mut self.kept(), |name| owner_of(name) == Some(&owner))
    }

    /// Removes the uploads that have not grown for [`UPLOAD_AGE_MAX`] at the time `now`.
    pub(crate) fn remove_old(&self, now: SystemTime) {
        let mut kept = self.kept();
        let is_old = |part: &Kept| now.duration_since(part.since).is_ok_and(|age| age > UPLOAD_AGE_MAX);
        let old: Vec<String> = kept.iter().filter(|(_, part)| is_old(part)).map(|(name, _)| name.clone()).collect();
        old.iter().for_each(|name| self.remove(&mut kept, name));
    }

    fn remove_oldest(&self, kept: &mut HashMap<String, Kept>, is_meant: impl Fn(&str) -> bool) -> bool {
        let meant = kept.iter().filter(|(name, _)| is_meant(name));
        let Some(name) = meant.min_by_key(|(name, part)| (part.since, *name)).map(|(name, _)| name.clone()) else {
            return false;
        };
        self.remove(kept, &name);
        true
    }

    fn remove(&self, kept: &mut HashMap<String, Kept>, name: &str) {
        kept.remove(name);
        // If the removal fails, the next start finds the file again.
        drop(fs::remove_file(self.folder.join(name)));
    }

    fn kept(&self) -> MutexGuard<'_, HashMap<String, Kept>> {
        // The map is consistent even after a panic: each change of it is a single operation.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Name of the file of an owner's upload. Names of owners may contain any characters, so their hash stands for them.
pub(crate) fn file_name(digest: &str, owner: &str) -> String {
    format!("{digest}-{}.part", digest_of(owner.as_bytes()))
}

/// The hash of an owner's name in the name of a file of [`file_name`].
fn owner_of(file_name: &str) -> Option<&str> {
    file_name.strip_suffix(".part")?.get(DIGEST_LENGTH + 1..)
}

/// Whether the name of a file is one of [`file_name`]. Others were uploads without a digest.
fn is_continuable(name: &str) -> bool {
    name.len() == 2 * DIGEST_LENGTH + 1 + ".part".len() && name.starts_with("sha256-") && name.ends_with(".part")
}

/// Length of a digest: `sha256-` and 64 digits.
const DIGEST_LENGTH: usize = 7 + 64;
