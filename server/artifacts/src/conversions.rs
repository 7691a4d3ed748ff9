//! Files that can be made again, such as converted kernels: the first to go when room is needed.

use crate::error::Result;
use crate::examined::Examined;
use crate::folder::{Folder, Stamp};

/// The folder of files that can be made again.
#[derive(Debug)]
pub(crate) struct Conversions {
    pub(crate) folder: Folder,
    /// What was found out about them: many devices fetch the same one at the same time.
    pub(crate) examined: Examined,
}

impl Conversions {
    pub(crate) fn new(folder: Folder) -> Self {
        Self { folder, examined: Examined::default() }
    }

    /// Size of all the files \[bytes\].
    pub(crate) fn bytes(&self) -> u64 {
        self.files().unwrap_or_default().iter().map(|((bytes, _), _)| bytes).sum()
    }

    /// Removes files until their sizes are at least `missing_bytes`, the oldest before the others. Whoever reads one reads
    /// on, and the next call makes it again.
    pub(crate) fn make_room(&self, missing_bytes: u64) {
        let mut files = self.files().unwrap_or_default();
        files.sort_by_key(|((_, changed), _)| *changed);
        let mut removed_bytes = 0;
        for ((bytes, _), digest) in files {
            if removed_bytes >= missing_bytes {
                return;
            }
            // A file that nobody can remove makes no room; how much there is, is measured afterwards.
            if self.folder.delete(&digest).is_ok() {
                removed_bytes += bytes;
            }
        }
    }

    /// Sizes \[bytes\] and last changes of the files, with their digests.
    pub(crate) fn files(&self) -> Result<Vec<(Stamp, String)>> {
        let stamped = |digest: String| Ok(self.folder.stamp(&digest)?.map(|stamp| (stamp, digest)));
        self.folder.list()?.into_iter().filter_map(|digest| stamped(digest).transpose()).collect()
    }
}
