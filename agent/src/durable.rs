//! Changes of files that are complete or absent after a power cut.
//!
//! A fail point stands before each flush, rename and removal, so that tests can end the process there.

use crate::regular_file;
use lightpath_fail_points as fail;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::Path;

/// Ending of the names of files that are being written. The next start removes those that a kill has left.
pub(crate) const TEMPORARY: &str = ".tmp";

/// Replaces a file. After a power cut it has its old or its new bytes.
pub(crate) fn write_file(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let temporary = path.with_added_extension(&TEMPORARY[1..]);
    let write = || -> io::Result<()> {
        let mut file = regular_file::create_anew(&temporary)?;
        fail::point("file.write")?;
        file.write_all(bytes)?;
        fail::point("file.flush")?;
        file.sync_all()
    };
    let replaced = write().and_then(|()| rename(&temporary, path));
    if replaced.is_err() {
        // The first error is reported. The next start removes a file that remains.
        let _ = fs::remove_file(&temporary);
    }
    replaced
}

/// Gives a flushed file another name, in the same folder.
pub(crate) fn rename(from: &Path, to: &Path) -> io::Result<()> {
    fail::point("file.rename")?;
    fs::rename(from, to)?;
    flush_folder_of(to)
}

/// Lets a symbolic link lead to another target, in one step.
pub(crate) fn replace_link(link: &Path, target: &str) -> io::Result<()> {
    let temporary = link.with_added_extension(&TEMPORARY[1..]);
    remove(&temporary)?;
    fail::point("link.create")?;
    std::os::unix::fs::symlink(target, &temporary)?;
    fail::point("link.rename")?;
    fs::rename(&temporary, link)?;
    flush_folder_of(link)
}

/// Removes a file or a link, if it exists.
pub(crate) fn remove(path: &Path) -> io::Result<()> {
    if fs::symlink_metadata(path).is_err_and(|error| error.kind() == io::ErrorKind::NotFound) {
        return Ok(());
    }
    fail::point("file.remove")?;
    fs::remove_file(path)?;
    flush_folder_of(path)
}

/// Flushes the entries of the folder in which a file lies.
pub(crate) fn flush_folder_of(path: &Path) -> io::Result<()> {
    fail::point("folder.flush")?;
    File::open(path.parent().unwrap_or(Path::new(".")))?.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_and_links_are_replaced_and_nothing_is_left_beside_them() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("state"), folder.path().join("current"));
        for text in ["one", "two"] {
            write_file(&file, text.as_bytes()).unwrap();
            assert_eq!(fs::read_to_string(&file).unwrap(), text);
            replace_link(&link, text).unwrap();
            assert_eq!(fs::read_link(&link).unwrap(), Path::new(text));
        }
        remove(&link).unwrap();
        remove(&link).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
