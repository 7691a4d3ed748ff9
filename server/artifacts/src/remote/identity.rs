//! To whom a remote belongs, and whether its server keeps the promises that artifacts need.

use super::Remote;
use crate::error::{ArtifactError, Result};
use crate::folder::flush_folder;
use crate::private::private_file;
use object_store::{ObjectStoreExt as _, PutMode, PutPayload};
use std::fs;
use std::io::{self, Write as _};
use std::path::Path;
use uuid::Uuid;

/// Key of the object that names the installation of a remote.
const OBJECT: &str = "lightpath-store";
/// File in the data folder with the name of the installation, and the one that becomes it.
const FILE: &str = "remote";
const NEW_FILE: &str = "remote.new";

/// Reads the name of the installation whose objects are in the remote, and gives it one if it is new. A data folder that
/// has kept a name is not used with a remote that has another.
pub(super) fn agree(remote: &Remote, data_dir: &Path) -> Result<String> {
    probe(remote)?;
    let offered = Uuid::now_v7().to_string();
    let path = remote.prefix.clone().join(OBJECT);
    let created = remote.put(&path, offered.clone().into_bytes().into(), PutMode::Create);
    match created {
        Ok(()) | Err(object_store::Error::AlreadyExists { .. }) => {}
        Err(error) => return Err(ArtifactError::remote("name the installation", error)),
    }
    let found = named(remote)?;
    match kept(data_dir).map_err(|error| ArtifactError::io("read the remote's name", error))? {
        Some(kept) if kept != found => Err(ArtifactError::OtherRemote { kept, found }),
        _ => Ok(found),
    }
}

/// The name that the remote has.
pub(super) fn named(remote: &Remote) -> Result<String> {
    let found = match remote.get_small(&remote.prefix.clone().join(OBJECT)) {
        Ok(found) => found,
        Err(object_store::Error::NotFound { .. }) => return Err(unfit("no server has kept artifacts there")),
        Err(error) => return Err(ArtifactError::remote("read the installation's name", error)),
    };
    let found = String::from_utf8(found).ok().filter(|name| Uuid::parse_str(name).is_ok());
    found.ok_or_else(|| unfit("the object lightpath-store has another content"))
}

/// Creates an object twice, reads it, and removes it: the second creation must fail.
fn probe(remote: &Remote) -> Result<()> {
    let path = remote.prefix.clone().join("probe").join(Uuid::now_v7().to_string());
    let create = |bytes: &'static [u8]| remote.put(&path, PutPayload::from_static(bytes), PutMode::Create);
    create(b"first").map_err(|error| ArtifactError::remote("create an object", error))?;
    let again = create(b"second");
    let read = remote.get_small(&path);
    let store = std::sync::Arc::clone(&remote.store);
    let removed = remote.thread.wait(async move { store.delete(&path).await });
    match again {
        Err(object_store::Error::AlreadyExists { .. }) => {}
        Ok(()) => return Err(unfit("it creates an object twice under one key")),
        Err(error) => return Err(ArtifactError::remote("create an object", error)),
    }
    let read = read.map_err(|error| ArtifactError::remote("read an object", error))?;
    if read != b"first" {
        return Err(unfit("it returns other bytes than it received"));
    }
    removed.map_err(|error| ArtifactError::remote("remove an object", error))
}

fn unfit(problem: &str) -> ArtifactError {
    ArtifactError::UnfitRemote { problem: problem.to_owned() }
}

/// The name that the data folder has kept.
pub(super) fn kept(data_dir: &Path) -> io::Result<Option<String>> {
    match fs::read_to_string(data_dir.join(FILE)) {
        Ok(name) => Ok(Some(name)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

/// Keeps the name in the data folder.
pub(super) fn keep(data_dir: &Path, name: &str) -> io::Result<()> {
    let new = data_dir.join(NEW_FILE);
    let mut file = private_file().write(true).create(true).truncate(true).open(&new)?;
    file.write_all(name.as_bytes())?;
    file.sync_all()?;
    fs::rename(new, data_dir.join(FILE))?;
    flush_folder(data_dir)
}
