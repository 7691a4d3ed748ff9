//! Blobs of one folder, spread over 256 subfolders. All functions block.

use crate::digest::{check_digest, digest_of, name, shard};
use crate::error::{ArtifactError, Result};
use crate::private::{create_private_folder, private_file};
use crate::read::CHUNK_BYTES;
use lightpath_fail_points as fail;
use sha2::{Digest, Sha256};
use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;
use uuid::Uuid;

/// Size of a file \[bytes\] and time of its last change. A tool that changes the file changes them.
pub(super) type Stamp = (u64, SystemTime);

/// File with notes about the blobs of a folder.
const NOTES: &str = "notes";

#[derive(Debug)]
pub(super) struct Folder {
    root: PathBuf,
    temporary: PathBuf,
}

impl Folder {
    /// Blobs below `root`. `temporary` holds files that are being written and must be on the same file system.
    pub(super) fn new(root: PathBuf, temporary: PathBuf) -> Self {
        Self { root, temporary }
    }

    /// Stores bytes and returns their digest. The bytes are on disk when this returns. Calls
    /// `before_rename` with the path and the digest of the complete file, as [`Self::publish`] does.
    pub(super) fn put(&self, bytes: &[u8], before_rename: impl FnOnce(&Path, &str) -> Result<()>) -> Result<String> {
        let digest = digest_of(bytes);
        let temporary = self.temporary.join(Uuid::now_v7().to_string());
        let written = self.write_and_publish(&temporary, bytes, &digest, before_rename);
        if written.is_err() {
            // The first error is reported. The next start removes a temporary file that remains.
            let _ = fs::remove_file(&temporary);
        }
        written.map(|()| digest)
    }

    fn write_and_publish(
        &self,
        temporary: &Path,
        bytes: &[u8],
        digest: &str,
        before_rename: impl FnOnce(&Path, &str) -> Result<()>,
    ) -> Result<()> {
        let write = || -> io::Result<File> {
            let mut file = private_file().write(true).create_new(true).open(temporary)?;
            file.write_all(bytes)?;
            Ok(file)
        };
        let file = write().map_err(|error| ArtifactError::io("write a file", error))?;
        self.publish(&file, temporary, digest, before_rename)
    }

    /// Stores what `write` writes to a new file, and returns the file and the size that `write` returns. The caller
    /// compares the bytes with the digest.
    pub(super) fn receive_from(
        &self,
        digest: &str,
        write: impl FnOnce(&mut File) -> Result<u64>,
    ) -> Result<(File, u64)> {
        check_digest(digest)?;
        let temporary = self.temporary.join(Uuid::now_v7().to_string());
        let receive = || -> Result<(File, u64)> {
            let created = private_file().read(true).write(true).create_new(true).open(&temporary);
            let mut file = created.map_err(|error| ArtifactError::io("write a file", error))?;
            let size_bytes = write(&mut file)?;
            self.publish(&file, &temporary, digest, |_, _| Ok(()))?;
            Ok((file, size_bytes))
        };
        let received = receive();
        if received.is_err() {
            let _ = fs::remove_file(&temporary);
        }
        received
    }

    /// Stores the content of `from` if it matches `digest`, and returns its size \[bytes\].
    pub(super) fn receive(&self, from: &mut File, digest: &str) -> Result<u64> {
        check_digest(digest)?;
        let temporary = self.temporary.join(Uuid::now_v7().to_string());
        let copied = self.copy_and_publish(&temporary, from, digest);
        if copied.is_err() {
            let _ = fs::remove_file(&temporary);
        }
        copied
    }

    fn copy_and_publish(&self, temporary: &Path, from: &mut File, digest: &str) -> Result<u64> {
        let mut copy = || -> io::Result<(File, u64, String)> {
            let mut file = private_file().read(true).write(true).create_new(true).open(temporary)?;
            let size_bytes = io::copy(from, &mut file)?;
            // Hash the bytes of the copy, not the bytes that were read for it.
            file.seek(SeekFrom::Start(0))?;
            let found = name(hash_rest(&mut file)?);
            Ok((file, size_bytes, found))
        };
        let (file, size_bytes, found) = copy().map_err(|error| ArtifactError::io("copy a file", error))?;
        if found != digest {
            return Err(ArtifactError::DataLoss { digest: digest.to_owned() });
        }
        self.publish(&file, temporary, digest, |_, _| Ok(()))?;
        Ok(size_bytes)
    }

    /// Flushes a complete file to disk and renames it to its digest, which the caller has checked. Calls
    /// `before_rename` in between, whose error leaves the file as it is.
    pub(super) fn publish(
        &self,
        file: &File,
        path: &Path,
        digest: &str,
        before_rename: impl FnOnce(&Path, &str) -> Result<()>,
    ) -> Result<()> {
        let failed = |error| ArtifactError::io("store a file", error);
        fail::point("file.flush").and_then(|()| file.sync_all()).map_err(failed)?;
        before_rename(path, digest)?;
        let shard = self.root.join(shard(digest));
        let rename = || -> io::Result<()> {
            if !shard.is_dir() {
                create_private_folder(&shard)?;
                flush_folder(&self.root)?;
            }
            fail::point("file.rename")?;
            fs::rename(path, shard.join(digest))?;
            flush_folder(&shard)
        };
        rename().map_err(failed)
    }

    /// Reads a whole blob and checks it against its digest.
    pub(super) fn read(&self, digest: &str) -> Result<Vec<u8>> {
        let (mut file, size_bytes) = self.open(digest)?;
        let mut bytes = Vec::with_capacity(usize::try_from(size_bytes).unwrap_or(0));
        file.read_to_end(&mut bytes).map_err(|error| ArtifactError::io("read a file", error))?;
        if digest_of(&bytes) != digest {
            return Err(ArtifactError::DataLoss { digest: digest.to_owned() });
        }
        Ok(bytes)
    }

    /// Opens a blob, checks its content, and returns the file, positioned at its start, and its size \[bytes\].
    pub(super) fn open_verified(&self, digest: &str) -> Result<(File, u64)> {
        let (mut file, size_bytes) = self.open(digest)?;
        let found = hash_rest(&mut file)
            .and_then(|hasher| file.seek(SeekFrom::Start(0)).map(|_| name(hasher)))
            .map_err(|error| ArtifactError::io("read a file", error))?;
        if found != digest {
            return Err(ArtifactError::DataLoss { digest: digest.to_owned() });
        }
        Ok((file, size_bytes))
    }

    pub(super) fn size(&self, digest: &str) -> Result<Option<u64>> {
        Ok(self.stamp(digest)?.map(|(size_bytes, _)| size_bytes))
    }

    pub(super) fn stamp(&self, digest: &str) -> Result<Option<Stamp>> {
        let path = self.path(digest)?;
        match fs::metadata(path).and_then(|metadata| Ok((metadata.len(), metadata.modified()?))) {
            Ok(stamp) => Ok(Some(stamp)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(ArtifactError::io("read the size of a file", error)),
        }
    }

    pub(super) fn delete(&self, digest: &str) -> Result<()> {
        let path = self.path(digest)?;
        match fail::point("file.remove").and_then(|()| fs::remove_file(path)) {
            Ok(()) => Ok(()),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            Err(error) => Err(ArtifactError::io("delete a file", error)),
        }
    }

    /// Writes a text about the blobs beside them, in the place of an earlier one. It may be lost with the power.
    pub(super) fn write_notes(&self, notes: &[u8]) -> Result<()> {
        let temporary = self.temporary.join(Uuid::now_v7().to_string());
        let write = || -> io::Result<()> {
            private_file().write(true).create_new(true).open(&temporary)?.write_all(notes)?;
            fs::rename(&temporary, self.root.join(NOTES))
        };
        write().map_err(|error| {
            // The first error is reported. The next start removes a temporary file that remains.
            let _ = fs::remove_file(&temporary);
            ArtifactError::io("write notes", error)
        })
    }

    pub(super) fn notes(&self) -> Result<Option<Vec<u8>>> {
        match fs::read(self.root.join(NOTES)) {
            Ok(notes) => Ok(Some(notes)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(ArtifactError::io("read notes", error)),
        }
    }

    /// Digests of all blobs in the folder.
    pub(super) fn list(&self) -> Result<Vec<String>> {
        let list = || -> io::Result<Vec<String>> {
            let mut digests = Vec::new();
            for shard in fs::read_dir(&self.root)? {
                let shard = shard?;
                if shard.file_type()?.is_dir() {
                    for file in fs::read_dir(shard.path())? {
                        digests.extend(file?.file_name().into_string());
                    }
                }
            }
            Ok(digests)
        };
        let mut digests = list().map_err(|error| ArtifactError::io("list files", error))?;
        digests.retain(|digest| check_digest(digest).is_ok());
        Ok(digests)
    }

    pub(super) fn open(&self, digest: &str) -> Result<(File, u64)> {
        let open = || -> Result<io::Result<(File, u64)>> {
            let path = self.path(digest)?;
            Ok(File::open(path).and_then(|file| file.metadata().map(|metadata| (file, metadata.len()))))
        };
        open()?.map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => ArtifactError::NotFound { digest: digest.to_owned() },
            _ => ArtifactError::io("open a file", error),
        })
    }

    /// Path of a blob. The check of the digest keeps every path inside the folder.
    pub(super) fn path(&self, digest: &str) -> Result<PathBuf> {
        check_digest(digest)?;
        Ok(self.root.join(shard(digest)).join(digest))
    }
}

/// Hashes a file from its current position to its end.
pub(super) fn hash_rest(file: &mut File) -> io::Result<Sha256> {
    let mut hasher = Sha256::new();
    let mut chunk = vec![0; CHUNK_BYTES];
    loop {
        match file.read(&mut chunk)? {
            0 => return Ok(hasher),
            count => hasher.update(&chunk[..count]),
        }
    }
}

/// Removes everything in a folder: files, and folders of blobs.
pub(super) fn empty(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        match entry.file_type()?.is_dir() {
            true => fs::remove_dir_all(entry.path())?,
            false => fs::remove_file(entry.path())?,
        }
    }
    Ok(())
}

/// Flushes a folder to disk: a rename is durable only after this.
pub(super) fn flush_folder(folder: &Path) -> io::Result<()> {
    fail::point("folder.flush")?;
    File::open(folder)?.sync_all()
}
