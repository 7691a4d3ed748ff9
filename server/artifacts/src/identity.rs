//! The identity of a data folder. A database on another machine records it, so that nobody uses it with the files of
//! another folder.

use crate::error::{ArtifactError, Result};
use crate::private::private_file;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::Path;
use uuid::Uuid;

/// Name of the file in a data folder.
const IDENTITY: &str = "identity";

/// The identity of `data_dir`, a UUID. A folder without one gets one. The caller holds the lock of the folder.
pub(crate) fn identity_of(data_dir: &Path) -> Result<String> {
    match kept_in(data_dir)? {
        Some(identity) => Ok(identity),
        None => create(data_dir, &data_dir.join(IDENTITY))
            .map_err(|error| ArtifactError::io("write the identity of the data folder", error)),
    }
}

/// The identity that `data_dir` has got.
pub(crate) fn kept_in(data_dir: &Path) -> Result<Option<String>> {
    let failed = |error| ArtifactError::io("read the identity of the data folder", error);
    match fs::read_to_string(data_dir.join(IDENTITY)) {
        Ok(text) => match Uuid::parse_str(text.trim()) {
            Ok(identity) => Ok(Some(identity.to_string())),
            Err(error) => Err(failed(io::Error::other(error))),
        },
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(failed(error)),
    }
}

/// Writes a new identity. The name appears after the content is on disk, so that no crash leaves half a file.
fn create(data_dir: &Path, path: &Path) -> io::Result<String> {
    let identity = Uuid::now_v7().to_string();
    let partial = data_dir.join("tmp").join(IDENTITY);
    let mut file = private_file().create(true).truncate(true).write(true).open(&partial)?;
    writeln!(file, "{identity}")?;
    file.sync_all()?;
    fs::rename(&partial, path)?;
    File::open(data_dir)?.sync_all()?;
    Ok(identity)
}
