//! A file of lines that starts anew when it is full. A limited number of older files is kept.

use lightpath_artifacts::private_file;
use lightpath_fail_points as fail;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Size at which a new file is started \[bytes\]: some hundred thousand lines.
const FILE_BYTES_MAX: u64 = 64 << 20;
/// Number of older files that are kept. The limit prevents a client with many calls from filling the disk.
const FILES_KEPT: u32 = 9;

/// A file of lines in a folder.
#[derive(Debug)]
pub(super) struct Journal {
    folder: PathBuf,
    name: &'static str,
    /// Locked only for a short append, so that no call waits for a flush.
    file: Mutex<Open>,
}

#[derive(Debug)]
struct Open {
    file: File,
    bytes: u64,
    is_flushed: bool,
}

impl Journal {
    /// Opens the file `name` in `folder`. New lines are appended to it.
    pub(super) fn open(folder: &Path, name: &'static str) -> io::Result<Self> {
        Ok(Self { folder: folder.to_owned(), name, file: Mutex::new(Open::append(&folder.join(name))?) })
    }

    /// Appends lines, each with its line break.
    pub(super) fn append(&self, lines: &[u8]) -> io::Result<()> {
        let mut open = self.lock();
        if open.bytes >= FILE_BYTES_MAX {
            self.rotate()?;
            *open = Open::append(&self.path(0))?;
        }
        open.file.write_all(lines)?;
        open.bytes += lines.len() as u64;
        open.is_flushed = false;
        Ok(())
    }

    /// Flushes the lines appended since the last flush to disk. Blocks.
    pub(super) fn flush(&self) -> io::Result<()> {
        let file = {
            let mut open = self.lock();
            if open.is_flushed {
                return Ok(());
            }
            open.is_flushed = true;
            open.file.try_clone()?
        };
        fail::point("audit.flush")?;
        file.sync_data()
    }

    /// Renames the file to `.1`, `.1` to `.2` and so on. The oldest file is overwritten.
    fn rotate(&self) -> io::Result<()> {
        for number in (0..FILES_KEPT).rev() {
            if self.path(number).exists() {
                fail::point("audit.rename")?;
                fs::rename(self.path(number), self.path(number + 1))?;
            }
        }
        Ok(())
    }

    fn path(&self, number: u32) -> PathBuf {
        match number {
            0 => self.folder.join(self.name),
            number => self.folder.join(format!("{}.{number}", self.name)),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Open> {
        // The state is consistent even after a panic, because lines are appended wholly or not at all.
        self.file.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Open {
    fn append(path: &Path) -> io::Result<Self> {
        let file = private_file().create(true).append(true).open(path)?;
        let bytes = file.metadata()?.len();
        Ok(Self { file, bytes, is_flushed: true })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAME: &str = "lines.jsonl";

    #[test]
    fn full_files_are_rotated() {
        let folder = tempfile::tempdir().unwrap();
        let journal = Journal::open(folder.path(), NAME).unwrap();
        for n in 0..FILES_KEPT + 2 {
            journal.lock().bytes = FILE_BYTES_MAX;
            journal.append(format!("{n}\n").as_bytes()).unwrap();
            journal.flush().unwrap();
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count() as u32, FILES_KEPT + 1);
        assert_eq!(fs::read_to_string(journal.path(1)).unwrap(), format!("{FILES_KEPT}\n"));
        assert_eq!(fs::read_to_string(journal.path(FILES_KEPT)).unwrap(), "1\n", "the first line is gone");
    }
}
