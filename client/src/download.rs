//! Downloads. Each is checked against its digest and continues after a lost connection.

use crate::digest::Hasher;
use crate::retry::Backoff;
use crate::v1::ReadArtifactRequest;
use crate::{Client, Error, Result};
use std::io::Write;
use std::path::Path;
use tempfile::NamedTempFile;

impl Client {
    /// Downloads an artifact into memory.
    ///
    /// # Errors
    ///
    /// [`Error::Refused`] when the server refuses the call, [`Error::Unreachable`] after about 15 seconds without a
    /// server, [`Error::Damaged`] when the bytes do not match the digest.
    pub async fn download(&self, digest: &str) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        self.receive(digest, &mut |chunk| {
            bytes.extend_from_slice(chunk);
            Ok(())
        })
        .await?;
        Ok(bytes)
    }

    /// Downloads an artifact into the file `path`. The file appears, or is replaced, only after the whole download is
    /// checked.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::download`], and [`Error::File`] when the file cannot be written.
    pub async fn download_to(&self, digest: &str, path: &Path) -> Result<()> {
        let mut file = PartialFile::create(path)?;
        self.receive(digest, &mut |chunk| file.write(chunk)).await?;
        file.finish()
    }

    /// Passes the chunks of an artifact to `take`, in order. Continues after a lost connection.
    async fn receive(&self, digest: &str, take: &mut (dyn FnMut(&[u8]) -> Result<()> + Send)) -> Result<()> {
        let mut hasher = Hasher::default();
        let mut backoff = Backoff::new();
        loop {
            let before_bytes = hasher.size_bytes();
            let Err(error) = self.receive_once(digest, &mut hasher, take).await else { break };
            if hasher.size_bytes() > before_bytes {
                backoff.reset();
            }
            backoff.pause(error).await?;
        }
        let found = hasher.finish();
        if found == digest { Ok(()) } else { Err(Error::Damaged { digest: digest.to_owned(), found }) }
    }

    async fn receive_once(
        &self,
        digest: &str,
        hasher: &mut Hasher,
        take: &mut (dyn FnMut(&[u8]) -> Result<()> + Send),
    ) -> Result<()> {
        let request =
            ReadArtifactRequest { digest: digest.to_owned(), offset_bytes: hasher.size_bytes(), limit_bytes: None };
        let mut stream = self.read_artifact(request).await?;
        while let Some(message) = stream.message().await.map_err(|status| self.error(status))? {
            take(&message.chunk)?;
            hasher.update(&message.chunk);
        }
        Ok(())
    }
}

/// Writes a file, or replaces it in one step, so that no other program reads an incomplete one.
///
/// # Errors
///
/// [`Error::File`] when the file cannot be written.
pub fn replace_file(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut file = PartialFile::create(path)?;
    file.write(bytes)?;
    file.finish()
}

/// A file under a temporary name in the folder of `path`. It gets its own name when it is complete, so that no other
/// program reads an incomplete file.
pub(crate) struct PartialFile<'a> {
    path: &'a Path,
    file: NamedTempFile,
}

impl<'a> PartialFile<'a> {
    pub(crate) fn create(path: &'a Path) -> Result<Self> {
        let folder = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        let mut builder = tempfile::Builder::new();
        builder.prefix(".lightpath-");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            // As for any other new file, the user's umask limits the permissions. The default of `tempfile` is 0600.
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let file = builder.tempfile_in(folder).map_err(|source| Error::file("write", path, source))?;
        Ok(Self { path, file })
    }

    pub(crate) fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.file.write_all(bytes).map_err(|source| Error::file("write", self.path, source))
    }

    pub(crate) fn finish(self) -> Result<()> {
        self.file.persist(self.path).map_err(|error| Error::file("write", self.path, error.error))?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_appears_only_when_it_is_complete() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pattern.png");
        let mut file = PartialFile::create(&path).unwrap();
        file.write(b"half").unwrap();
        assert!(!path.exists());
        drop(file);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        let mut file = PartialFile::create(&path).unwrap();
        file.write(b"whole").unwrap();
        file.finish().unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"whole");
    }

    #[test]
    fn error_names_file_in_missing_folder() {
        let error = PartialFile::create(Path::new("/nowhere/at/all.png")).err().unwrap().to_string();
        assert!(error.contains("could not write /nowhere/at/all.png"), "{error}");
    }
}
