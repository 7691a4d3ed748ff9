//! Kernel files in other formats, kept for later calls.
//!
//! A converted file may have hundreds of megabytes. It is kept in the artifact folder's cache and not in memory, so
//! that slow clients hold no memory, and many clients that want the same kernel share one conversion.

use lightpath_domain::kernel::KernelVersion;
use lightpath_media::kernel_formats::{KernelFormat, Loss};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Limit on the size of all converted files on disk \[bytes\]: some tens of dense kernels.
const BYTES_MAX: u64 = 1 << 30;

/// What a file was made from, and its format.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ConversionKey {
    /// Name of the version. Bundles of versions with equal files differ.
    pub(super) version: String,
    pub(super) format: KernelFormat,
}

impl ConversionKey {
    pub(super) fn new(version: &KernelVersion, format: KernelFormat) -> Self {
        Self { version: format!("{}/versions/{}", version.key, version.version), format }
    }
}

/// A converted file.
#[derive(Clone, Debug, PartialEq)]
pub struct Converted {
    /// Digest of the file.
    pub digest: String,
    /// Size of the file \[bytes\].
    pub size_bytes: u64,
    /// Error that the format causes.
    pub relative_error: f64,
    /// What the format does not hold.
    pub losses: Vec<Loss>,
}

/// The converted files on disk. Clones share them.
#[derive(Clone, Debug, Default)]
pub(super) struct Conversions(Arc<Mutex<VecDeque<(ConversionKey, Converted)>>>);

impl Conversions {
    /// The file for a key, if it is on disk.
    pub(super) fn find(&self, key: &ConversionKey) -> Option<Converted> {
        let mut files = self.lock();
        let index = files.iter().position(|(other, _)| other == key)?;
        // The file used last is the last to be removed.
        let found = files.remove(index)?;
        files.push_back(found.clone());
        Some(found.1)
    }

    /// Notes a file that is now on disk, and returns the digests of files to remove.
    pub(super) fn insert(&self, key: ConversionKey, converted: Converted) -> Vec<String> {
        let mut files = self.lock();
        files.retain(|(other, _)| *other != key);
        files.push_back((key, converted));
        let mut removed = Vec::new();
        while files.len() > 1 && files.iter().map(|(_, file)| file.size_bytes).sum::<u64>() > BYTES_MAX {
            removed.extend(files.pop_front().map(|(_, file)| file.digest));
        }
        removed.retain(|digest| files.iter().all(|(_, file)| file.digest != *digest));
        removed
    }

    /// Forgets a file that is no longer on disk.
    pub(super) fn forget(&self, key: &ConversionKey) {
        self.lock().retain(|(other, _)| other != key);
    }

    fn lock(&self) -> MutexGuard<'_, VecDeque<(ConversionKey, Converted)>> {
        // The list is consistent even after a panic: nothing between its changes can panic.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(name: &str, size_bytes: u64) -> (ConversionKey, Converted) {
        let key = ConversionKey { version: name.to_owned(), format: KernelFormat::Npz };
        (
            key,
            Converted {
                digest: format!("digest of {name}"),
                size_bytes,
                relative_error: 0.0,
                losses: vec![Loss::Precision],
            },
        )
    }

    #[test]
    fn the_files_that_were_not_used_for_longest_are_removed() {
        let conversions = Conversions::default();
        let third = BYTES_MAX / 3;
        let [(a, file_a), (b, file_b), (c, file_c), (d, file_d)] = ["a", "b", "c", "d"].map(|name| file(name, third));
        for (key, file) in [(&a, &file_a), (&b, &file_b), (&c, &file_c)] {
            assert!(conversions.insert(key.clone(), file.clone()).is_empty());
        }
        assert_eq!(conversions.find(&a), Some(file_a.clone()));
        assert_eq!(conversions.insert(d, file_d), [file_b.digest]);
        assert_eq!((conversions.find(&b), conversions.find(&a)), (None, Some(file_a.clone())));
        conversions.forget(&a);
        assert_eq!(conversions.find(&a), None);
        // A file beyond the limit is kept until the next one.
        let (huge, huge_file) = file("huge", BYTES_MAX * 2);
        assert_eq!(conversions.insert(huge.clone(), huge_file.clone()).len(), 2);
        assert_eq!(conversions.find(&huge), Some(huge_file));
    }

    #[test]
    fn a_file_that_two_keys_share_is_not_removed() {
        let conversions = Conversions::default();
        let (a, same) = file("a", BYTES_MAX / 2);
        let (b, _) = file("b", 0);
        conversions.insert(a, same.clone());
        conversions.insert(b, same);
        let (c, other) = file("c", 10);
        assert!(conversions.insert(c, other).is_empty());
    }
}
