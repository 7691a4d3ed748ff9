//! The directory of the agent: two slots, and a link to the one in use.

use crate::durable::{self, TEMPORARY};
use crate::problem::{BodyProblem, Problem};
use crate::vouching::{installed_manifest, read_document};
use crate::{Settings, download, log};
use lightpath_manifest::Manifest;
use rustix::fs::Access;
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
    /// Folder within each slot; `None`: the slot itself.
    member: Option<String>,
}

impl Slots {
    /// The directory at a path, for reading.
    pub(crate) fn at(root: &Path) -> Self {
        Self { root: root.to_owned(), member: None }
    }

    /// The places of one kernel in a directory whose slots have several, each in a folder of its own.
    pub(crate) fn of_member(root: &Path, name: &str) -> Self {
        Self { root: root.to_owned(), member: Some(name.to_owned()) }
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
        let folder = self.root.join(slot.name());
        self.member.as_ref().map_or_else(|| folder.clone(), |member| folder.join(member))
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
        if !self.has_kernel(slot)? {
            return Ok(None);
        }
        let (manifest, keyring) = self.documents(slot)?;
        let manifest = installed_manifest(&manifest, &keyring, &settings.wanted(0));
        manifest.map(Some).map_err(|distrust| distrust.to_string())
    }

    /// Whether something stands where the kernel of a slot is, and the reason why the slot cannot have one.
    pub(crate) fn has_kernel(&self, slot: Slot) -> Result<bool, String> {
        if !self.is_own(slot).map_err(|problem| problem.to_string())? {
            return Ok(false);
        }
        match fs::symlink_metadata(self.kernel(slot)) {
            Ok(_) => Ok(true),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
            Err(error) => Err(format!("kernel: {error}")),
        }
    }

    /// The manifest and the keyring of a slot.
    pub(crate) fn documents(&self, slot: Slot) -> Result<(Vec<u8>, Vec<u8>), String> {
        let read =
            |name: &str| read_document(&self.folder(slot).join(name)).map_err(|error| format!("{name}: {error}"));
        Ok((read("manifest")?, read("keyring")?))
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

    /// Makes the folder of a slot, if it is missing, and checks that the agent can put a kernel there.
    pub(crate) fn prepare(&self, slot: Slot, digest: &str) -> Result<(), Problem> {
        let folder = self.folder(slot);
        self.make(slot)?;
        rustix::fs::access(&folder, Access::READ_OK | Access::WRITE_OK | Access::EXEC_OK)
            .map_err(|error| Problem::disk("write", &folder)(error.into()))?;
        let files = ["kernel", "manifest", "keyring"].map(|name| folder.join(name));
        for path in files.into_iter().chain([self.part(slot, digest)]) {
            if fs::symlink_metadata(&path).is_ok_and(|metadata| metadata.is_dir()) {
                return Err(Problem::Foreign { path, found: "a folder stands in the place of a file" });
            }
        }
        Ok(())
    }

    /// Makes the folder of a slot, if it is missing.
    pub(crate) fn make(&self, slot: Slot) -> Result<(), Problem> {
        let folder = self.folder(slot);
        if self.is_own(slot)? {
            return Ok(());
        }
        let made = fs::create_dir(&folder).and_then(|()| durable::flush_folder_of(&folder));
        made.map_err(Problem::disk("create", &folder))
    }

    /// Whether the folder of a slot is there. Anything else in its place is an error, links too: what the agent wrote or
    /// removed there would be another's.
    fn is_own(&self, slot: Slot) -> Result<bool, Problem> {
        let path = self.folder(slot);
        match fs::symlink_metadata(&path) {
            Ok(metadata) if metadata.is_dir() => Ok(true),
            Ok(_) => Err(Problem::Foreign { path, found: "it is not a folder" }),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
            Err(error) => Err(Problem::disk("read", &path)(error)),
        }
    }

    /// Removes the kernel of a slot that is not in use. Parts stay.
    pub(crate) fn empty(&self, slot: Slot) -> Result<(), Problem> {
        if !self.is_own(slot)? {
            return Ok(());
        }
        for name in ["kernel", "manifest", "keyring"] {
            let path = self.folder(slot).join(name);
            durable::remove(&path).map_err(Problem::disk("remove", &path))?;
        }
        Ok(())
    }

    /// Removes the parts of all other files than the one with this digest.
    pub(crate) fn remove_other_parts(&self, slot: Slot, digest: Option<&str>) -> Result<(), Problem> {
        let kept = digest.map(|digest| format!("{PART}{digest}"));
        match self.is_own(slot) {
            Ok(true) => remove_if(&self.folder(slot), |name| name.starts_with(PART) && kept.as_deref() != Some(name)),
            // Nothing of the agent's is there. What is in the way is named when the slot is needed.
            _ => Ok(()),
        }
    }

    /// Removes files that a kill left half written. Problems are logged.
    pub(crate) fn remove_temporary(&self) {
        let own = Slot::BOTH.into_iter().filter(|slot| matches!(self.is_own(*slot), Ok(true)));
        let folders = own.map(|slot| self.folder(slot));
        for folder in [self.root.clone()].into_iter().chain(folders) {
            if let Err(problem) = remove_if(&folder, |name| name.ends_with(TEMPORARY)) {
                log::line(problem);
            }
        }
    }
}

/// Removes files. Folders stay: the agent makes none with such names.
fn remove_if(folder: &Path, is_unwanted: impl Fn(&str) -> bool) -> Result<(), Problem> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        // A slot that the agent may not read has none of its parts.
        Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::PermissionDenied) => {
            return Ok(());
        }
        Err(error) => return Err(Problem::disk("read", folder)(error)),
    };
    for entry in entries {
        let entry = entry.map_err(Problem::disk("read", folder))?;
        let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
        if !is_folder && entry.file_name().to_str().is_some_and(&is_unwanted) {
            durable::remove(&entry.path()).map_err(Problem::disk("remove", &entry.path()))?;
            log::line(format_args!("the agent removed {}, which was left behind", entry.path().display()));
        }
    }
    Ok(())
}
