//! The directory of the agent: two slots, and a link to the one in use.

use crate::durable::{self, TEMPORARY};
use crate::problem::{BodyProblem, Problem};
use crate::vouching::{installed_manifest, read_document};
use crate::{Settings, download, log};
use lightpath_manifest::Manifest;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

const CURRENT: &str = "current";
/// Beginning of the name of a file that is being fetched. The digest of the whole file follows.
const PART: &str = "part-";

/// One of the two places for a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slot {
    /// `DIR/a`.
    A,
    /// `DIR/b`.
    B,
}

impl Slot {
    /// Both slots.
    pub const BOTH: [Self; 2] = [Self::A, Self::B];

    /// Name of the slot's folder.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::A => "a",
            Self::B => "b",
        }
    }

    /// The other slot.
    #[must_use]
    pub fn other(self) -> Self {
        match self {
            Self::A => Self::B,
            Self::B => Self::A,
        }
    }
}

/// Keeps other agents out of a directory until it is dropped.
#[derive(Debug)]
pub(crate) struct Lock(File);

impl Drop for Lock {
    fn drop(&mut self) {
        // A program that another thread starts at this moment has a copy of the file for some time. Closing it here
        // would leave the directory locked until then.
        let _ = self.0.unlock();
    }
}

/// The directory.
#[derive(Clone, Debug)]
pub(crate) struct Slots {
    root: PathBuf,
}

impl Slots {
    /// The directory at a path, for reading.
    pub(crate) fn at(root: &Path) -> Self {
        Self { root: root.to_owned() }
    }

    /// Makes the directory. The returned lock keeps other agents out. It is on the directory itself: this needs no file,
    /// so it works on a disk that became read-only.
    pub(crate) fn open(root: &Path) -> Result<(Self, Lock), Problem> {
        let slots = Self::at(root);
        if !root.is_dir() {
            fs::create_dir_all(root).map_err(Problem::disk("create", root))?;
        }
        let lock = File::open(root).map_err(Problem::disk("open", root))?;
        lock.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => Problem::Locked { path: root.to_owned() },
            TryLockError::Error(error) => Problem::disk("lock", root)(error),
        })?;
        Ok((slots, Lock(lock)))
    }

    pub(crate) fn root(&self) -> &Path {
        &self.root
    }

    pub(crate) fn file(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    pub(crate) fn folder(&self, slot: Slot) -> PathBuf {
        self.root.join(slot.name())
    }

    pub(crate) fn kernel(&self, slot: Slot) -> PathBuf {
        self.folder(slot).join("kernel")
    }

    /// Path of the file that is being fetched.
    pub(crate) fn part(&self, slot: Slot, digest: &str) -> PathBuf {
        self.folder(slot).join(format!("{PART}{digest}"))
    }

    /// The slot that the application uses.
    pub(crate) fn current(&self) -> Option<Slot> {
        let target = fs::read_link(self.file(CURRENT)).ok()?;
        Slot::BOTH.into_iter().find(|slot| target == Path::new(slot.name()))
    }

    /// Lets the application use a slot.
    pub(crate) fn use_slot(&self, slot: Slot) -> Result<(), Problem> {
        let link = self.file(CURRENT);
        durable::replace_link(&link, slot.name()).map_err(Problem::disk("replace", &link))
    }

    /// Leaves the application without a kernel, because none is good.
    pub(crate) fn use_none(&self) -> Result<(), Problem> {
        let link = self.file(CURRENT);
        durable::remove(&link).map_err(Problem::disk("remove", &link))
    }

    /// The manifest of a slot whose kernel is whole, and the reason if it is not. `Ok(None)`: the slot is empty.
    pub(crate) fn verified(&self, slot: Slot, settings: &Settings) -> Result<Option<Manifest>, String> {
        let manifest = self.vouched(slot, settings)?;
        if let Some(manifest) = &manifest {
            self.check_kernel(slot, manifest)?;
        }
        Ok(manifest)
    }

    /// The manifest of a slot, whose kernel was not checked yet.
    pub(crate) fn vouched(&self, slot: Slot, settings: &Settings) -> Result<Option<Manifest>, String> {
        let folder = self.folder(slot);
        let read = |name: &str| read_document(&folder.join(name)).map_err(|error| format!("{name}: {error}"));
        if !self.kernel(slot).exists() {
            return Ok(None);
        }
        let (manifest, keyring) = (read("manifest")?, read("keyring")?);
        let manifest = installed_manifest(&manifest, &keyring, &settings.wanted(0));
        manifest.map(Some).map_err(|distrust| distrust.to_string())
    }

    /// Checks a slot's kernel against a manifest.
    pub(crate) fn check_kernel(&self, slot: Slot, manifest: &Manifest) -> Result<(), String> {
        let found = download::digest_of_file(&self.kernel(slot)).map_err(|error| format!("kernel: {error}"))?;
        if found == manifest.digest {
            return Ok(());
        }
        Err(format!("kernel: {}", BodyProblem::Digest { found, wanted: manifest.digest.clone() }))
    }

    /// Puts what vouches for the next kernel into a slot that is not in use. Until the kernel follows, the slot counts
    /// as damaged, so that no old kernel is taken for the new one.
    pub(crate) fn vouch(&self, slot: Slot, manifest: &[u8], keyring: &[u8]) -> Result<(), Problem> {
        for (name, bytes) in [("keyring", keyring), ("manifest", manifest)] {
            let path = self.folder(slot).join(name);
            durable::write_file(&path, bytes).map_err(Problem::disk("write", &path))?;
        }
        Ok(())
    }

    /// Makes a complete and flushed part the kernel of its slot.
    pub(crate) fn complete(&self, slot: Slot, digest: &str) -> Result<(), Problem> {
        let (part, kernel) = (self.part(slot, digest), self.kernel(slot));
        durable::rename(&part, &kernel).map_err(Problem::disk("replace", &kernel))
    }

    /// Makes the folder of a slot, if it is missing.
    pub(crate) fn create(&self, slot: Slot) -> Result<(), Problem> {
        let folder = self.folder(slot);
        if folder.is_dir() {
            return Ok(());
        }
        fs::create_dir(&folder)
            .and_then(|()| durable::flush_folder_of(&folder))
            .map_err(Problem::disk("create", &folder))
    }

    /// Removes the kernel of a slot that is not in use. Parts stay.
    pub(crate) fn empty(&self, slot: Slot) -> Result<(), Problem> {
        for name in ["kernel", "manifest", "keyring"] {
            let path = self.folder(slot).join(name);
            durable::remove(&path).map_err(Problem::disk("remove", &path))?;
        }
        Ok(())
    }

    /// Removes the parts of all other files than the one with this digest.
    pub(crate) fn remove_other_parts(&self, slot: Slot, digest: Option<&str>) -> Result<(), Problem> {
        let kept = digest.map(|digest| format!("{PART}{digest}"));
        self.remove_if(&self.folder(slot), |name| name.starts_with(PART) && kept.as_deref() != Some(name))
    }

    /// Removes files that a kill left half written.
    pub(crate) fn remove_temporary(&self) -> Result<(), Problem> {
        for folder in [self.root.clone(), self.folder(Slot::A), self.folder(Slot::B)] {
            self.remove_if(&folder, |name| name.ends_with(TEMPORARY))?;
        }
        Ok(())
    }

    fn remove_if(&self, folder: &Path, is_unwanted: impl Fn(&str) -> bool) -> Result<(), Problem> {
        let entries = match fs::read_dir(folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(Problem::disk("read", folder)(error)),
        };
        for entry in entries {
            let entry = entry.map_err(Problem::disk("read", folder))?;
            if entry.file_name().to_str().is_some_and(&is_unwanted) {
                durable::remove(&entry.path()).map_err(Problem::disk("remove", &entry.path()))?;
                log::line(format_args!("the agent removed {}, which was left behind", entry.path().display()));
            }
        }
        Ok(())
    }
}
