//! Opens files that must be regular files, and never what a link leads to.

use rustix::fs::OFlags;
use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::{MetadataExt as _, OpenOptionsExt as _};
use std::path::Path;

/// Opens a file for reading. A pipe, a device, a folder or a link in its place is an error: opening a pipe would wait for
/// a writer, perhaps for ever.
pub(crate) fn open(path: &Path) -> io::Result<File> {
    let flags = OFlags::NOFOLLOW | OFlags::NONBLOCK;
    let file = OpenOptions::new().read(true).custom_flags(flags.bits().cast_signed()).open(path)?;
    if !file.metadata()?.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "it is not a regular file; remove it"));
    }
    Ok(file)
}

/// Opens a file for reading and writing, which keeps its bytes, or makes it. What stands in its place and is no regular file
/// of its own, such as a link or one of several names of a file elsewhere, is removed first: its bytes are another's.
pub(crate) fn open_for_writing(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    let flags = OFlags::NOFOLLOW | OFlags::NONBLOCK;
    options.read(true).write(true).custom_flags(flags.bits().cast_signed());
    let found = options.open(path);
    if let Ok(file) = found {
        let metadata = file.metadata()?;
        if metadata.is_file() && metadata.nlink() == 1 {
            return Ok(file);
        }
    }
    create_anew(path)
}

/// Makes a file in the place of what stands there. A folder is not removed: it is an error.
pub(crate) fn create_anew(path: &Path) -> io::Result<File> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    // It does not open what somebody puts there meanwhile.
    OpenOptions::new().read(true).write(true).create_new(true).open(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::fs::{CWD, FileType, Mode, mknodat};

    #[test]
    fn only_regular_files_are_opened_and_pipes_do_not_block() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("file"), "text").unwrap();
        std::os::unix::fs::symlink("file", path("link")).unwrap();
        mknodat(CWD, path("pipe"), FileType::Fifo, Mode::RUSR, 0).unwrap();
        assert!(open(&path("file")).is_ok());
        assert!(open(&path("pipe")).unwrap_err().to_string().contains("not a regular file"));
        assert!(open(folder.path()).unwrap_err().to_string().contains("not a regular file"));
        assert!(open(&path("link")).is_err());
        assert_eq!(open(&path("none")).unwrap_err().kind(), io::ErrorKind::NotFound);
    }
    #[test]
    fn nothing_is_written_through_links() {
        let folder = tempfile::tempdir().unwrap();
        let (path, other) = (folder.path().join("part"), folder.path().join("other"));
        fs::write(&other, "text of another").unwrap();
        let put_link = || std::os::unix::fs::symlink(&other, &path).unwrap();
        let put_name = || fs::hard_link(&other, &path).unwrap();
        let put_pipe = || mknodat(CWD, &path, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
        for put in [&put_link as &dyn Fn(), &put_name, &put_pipe] {
            for open in [open_for_writing, create_anew] {
                put();
                open(&path).unwrap().set_len(3).unwrap();
                assert_eq!(fs::read_to_string(&other).unwrap(), "text of another");
                assert_eq!(fs::read(&path).unwrap(), [0; 3]);
                fs::remove_file(&path).unwrap();
            }
        }
        fs::write(&path, "begun").unwrap();
        drop(open_for_writing(&path).unwrap());
        assert_eq!(fs::read_to_string(&path).unwrap(), "begun");
        assert!(open_for_writing(folder.path()).is_err());
    }
}
