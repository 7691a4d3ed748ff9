//! Storing and reading files that can be made again.

use crate::claim::Claim;
use crate::conversions::Conversions;
use crate::error::Result;
use crate::{ArtifactReader, Artifacts};

impl Artifacts {
    /// Stores a file that can be made again, and returns its digest. Blocks.
    ///
    /// # Errors
    ///
    /// [`ArtifactError::DiskLow`](crate::ArtifactError::DiskLow) if the file would use the reserve of the disk.
    pub fn put_conversion_blocking(&self, bytes: &[u8]) -> Result<String> {
        let _claim = Claim::take(&self.inner.space, "", 0, bytes.len() as u64)?;
        let Conversions { folder, examined } = &*self.inner.conversions;
        let digest = folder.put(bytes, |_, _| Ok(()))?;
        if let Some(stamp) = folder.stamp(&digest)? {
            examined.record(&digest, stamp, true);
        }
        Ok(digest)
    }

    /// Checks a stored conversion against its digest, if it was not checked in the last minutes or has changed since, then
    /// returns a reader of at most `limit_bytes` (0: all) of its bytes from `offset_bytes` on. Blocks.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::read_range_blocking`].
    pub fn read_conversion_blocking(
        &self,
        digest: &str,
        offset_bytes: u64,
        limit_bytes: u64,
    ) -> Result<ArtifactReader> {
        let Conversions { folder, examined } = &*self.inner.conversions;
        let stamp = folder.stamp(digest)?;
        let is_intact = stamp.is_some_and(|stamp| examined.finding(digest, stamp) == Some(true));
        let (file, size_bytes) = if is_intact { folder.open(digest)? } else { folder.open_verified(digest)? };
        if let (false, Some(stamp)) = (is_intact, stamp) {
            examined.record(digest, stamp, true);
        }
        ArtifactReader::new(file, size_bytes, offset_bytes, limit_bytes)
    }

    /// Digests and sizes \[bytes\] of all conversions. Blocks.
    pub fn conversions_blocking(&self) -> Result<Vec<(String, u64)>> {
        let files = self.inner.conversions.files()?;
        Ok(files.into_iter().map(|((bytes, _), digest)| (digest, bytes)).collect())
    }

    /// Keeps notes about the conversions for the next start, in the place of earlier ones. Blocks.
    pub fn write_conversion_notes_blocking(&self, notes: &[u8]) -> Result<()> {
        self.inner.conversions.folder.write_notes(notes)
    }

    /// The notes about the conversions; `None`: there are none. Blocks.
    pub fn conversion_notes_blocking(&self) -> Result<Option<Vec<u8>>> {
        self.inner.conversions.folder.notes()
    }

    /// Removes a conversion. A missing one is no error. Blocks.
    pub fn delete_conversion_blocking(&self, digest: &str) -> Result<()> {
        self.inner.conversions.folder.delete(digest)
    }
}

#[cfg(test)]
mod tests {
    use crate::Artifacts;
    use std::fs;
    use std::time::{Duration, SystemTime};

    #[test]
    fn the_oldest_files_go_until_there_is_room() {
        let data = tempfile::tempdir().unwrap();
        let artifacts = Artifacts::open(data.path()).unwrap();
        let kept = &artifacts.inner.conversions;
        let now = SystemTime::now();
        let [old, middle, new] = [(30, 10), (20, 20), (10, 30)].map(|(age_s, bytes)| {
            let digest = artifacts.put_conversion_blocking(&vec![0; bytes]).unwrap();
            let path = data.path().join("conversions").join(&digest[7..9]).join(&digest);
            let file = fs::File::options().write(true).open(path).unwrap();
            file.set_modified(now - Duration::from_secs(age_s)).unwrap();
            digest
        });
        artifacts.write_conversion_notes_blocking(b"about them").unwrap();
        let left = || {
            let mut digests: Vec<_> =
                artifacts.conversions_blocking().unwrap().into_iter().map(|(digest, _)| digest).collect();
            digests.sort();
            digests
        };
        let sorted = |mut digests: Vec<String>| {
            digests.sort();
            digests
        };
        assert_eq!((kept.bytes(), left()), (60, sorted(vec![old, middle, new.clone()])));
        kept.make_room(0);
        assert_eq!(kept.bytes(), 60);
        kept.make_room(11);
        assert_eq!((kept.bytes(), left()), (30, vec![new]), "10 bytes were not enough");
        kept.make_room(u64::MAX);
        assert_eq!(kept.bytes(), 0);
        assert_eq!(artifacts.conversion_notes_blocking().unwrap().unwrap(), b"about them");
    }
}
