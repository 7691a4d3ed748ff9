//! Files and folders that only the user of the server can read and change. The data folder contains pictures of
//! customers, hashes of tokens, and the audit log.
//!
//! Each file gets its mode when it is created. A mask of the whole process would also change the files that other parts
//! of a program create.

use std::fs::{self, DirBuilder, File, OpenOptions, Permissions};
use std::io;
use std::os::unix::fs::{DirBuilderExt as _, OpenOptionsExt as _, PermissionsExt as _};
use std::path::{Path, PathBuf};

const FILE_MODE: u32 = 0o600;
const FOLDER_MODE: u32 = 0o700;
/// Permissions of the group and of all other users.
const OTHERS: u32 = 0o077;
/// Names of the folders in a data folder.
const FOLDERS: [&str; 4] = ["artifacts", "checkpoints", "tmp", "uploads"];
/// Names of the files in a data folder, or their beginnings: older audit logs and the database's log have longer names.
const FILES: [&str; 5] = ["audit.jsonl", "identity", "keep.lock", "lightpath.db", "lock"];

/// Options that create files with private modes. The caller adds how the file is opened.
#[must_use]
pub fn private_file() -> OpenOptions {
    let mut options = File::options();
    options.mode(FILE_MODE);
    options
}

/// Creates a private folder, and the missing folders above it with the usual mode. An existing folder keeps its mode,
/// because it may also be used for something else.
pub fn create_private_folder(path: &Path) -> io::Result<()> {
    if let Some(parent) = path.parent() {
        fs::create_dir_all(parent)?;
    }
    match DirBuilder::new().mode(FOLDER_MODE).create(path) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists && path.is_dir() => Ok(()),
        created => created,
    }
}

/// Takes the permissions of other users from everything in a data folder, as a program with another mask may have
/// created it. Returns the paths that changed. Files with other names are left as they are.
///
/// # Errors
///
/// The errors of the file system, for example if another user owns a file.
pub fn make_private(data_dir: &Path) -> io::Result<Vec<PathBuf>> {
    let mut changed = Vec::new();
    for entry in fs::read_dir(data_dir)? {
        let entry = entry?;
        let (name, metadata) = (entry.file_name(), entry.metadata()?);
        let is_folder = metadata.is_dir() && FOLDERS.iter().any(|folder| name == *folder);
        let is_file = metadata.is_file() && FILES.iter().any(|file| name.to_string_lossy().starts_with(file));
        if (is_folder || is_file) && metadata.permissions().mode() & OTHERS != 0 {
            let mode = if is_folder { FOLDER_MODE } else { FILE_MODE };
            fs::set_permissions(entry.path(), Permissions::from_mode(mode))?;
            changed.push(entry.path());
        }
    }
    Ok(changed)
}
