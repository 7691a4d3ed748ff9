//! Files that can be made again, such as converted kernels: the first to go when room is needed.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// The folder of files that can be made again.
#[derive(Debug)]
pub(crate) struct Spare(PathBuf);

impl Spare {
    pub(crate) fn new(folder: PathBuf) -> Self {
        Self(folder)
    }

    /// Size of all the files \[bytes\].
    pub(crate) fn bytes(&self) -> u64 {
        self.files().iter().map(|(_, _, bytes)| bytes).sum()
    }

    /// Removes files until their sizes are at least `missing_bytes`, the oldest before the others. Whoever reads one reads
    /// on, and the next call makes it again.
    pub(crate) fn make_room(&self, missing_bytes: u64) {
        let mut removed_bytes = 0;
        for (_, path, bytes) in self.files() {
            if removed_bytes >= missing_bytes {
                return;
            }
            // A file that nobody can remove makes no room; how much there is, is measured afterwards.
            if fs::remove_file(&path).is_ok() {
                removed_bytes += bytes;
            }
        }
    }

    /// The files with their sizes \[bytes\], the oldest first. What cannot be read is left out.
    fn files(&self) -> Vec<(SystemTime, PathBuf, u64)> {
        let entries = |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten();
        let shards = entries(&self.0).map(|shard| shard.path()).filter(|shard| shard.is_dir());
        let mut files: Vec<_> = shards
            .flat_map(|shard| entries(&shard).collect::<Vec<_>>())
            .filter_map(|file| {
                let metadata = file.metadata().ok()?;
                Some((metadata.modified().ok()?, file.path(), metadata.len()))
            })
            .collect();
        files.sort();
        files
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn the_oldest_files_go_until_there_is_room() {
        let folder = tempfile::tempdir().unwrap();
        let spare = Spare::new(folder.path().to_owned());
        let now = SystemTime::now();
        for (name, age_s, bytes) in [("aa/old", 30, 10), ("bb/new", 10, 30), ("aa/middle", 20, 20)] {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(&path, vec![0; bytes]).unwrap();
            let file = fs::File::options().write(true).open(&path).unwrap();
            file.set_modified(now - Duration::from_secs(age_s)).unwrap();
        }
        fs::write(folder.path().join("notes"), b"about them").unwrap();
        let names =
            || spare.files().into_iter().map(|(_, path, _)| path.file_name().unwrap().to_owned()).collect::<Vec<_>>();
        assert_eq!((spare.bytes(), names()), (60, ["old", "middle", "new"].map(Into::into).to_vec()));
        spare.make_room(0);
        spare.make_room(11);
        assert_eq!((spare.bytes(), names()), (30, vec!["new".into()]), "10 bytes were not enough");
        spare.make_room(u64::MAX);
        assert_eq!((spare.bytes(), folder.path().join("notes").exists()), (0, true));
    }
}
