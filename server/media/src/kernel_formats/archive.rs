//! The part of the zip format that arrays need: stored or deflated files, without encryption, no part beyond 4 GiB.
//!
//! Only the directory is read at first. A file of the archive is unpacked when somebody asks for it, after its size was
//! counted in the budget: some kilobytes may unpack to gigabytes.
//!
//! Source: PKWARE APPNOTE 6.3. All numbers are little-endian.

use super::error::KernelFormatError;
use crate::budget::{Budget, Held};
use crate::shortened::shortened;
use flate2::read::DeflateDecoder;
use lightpath_optics::interrupt;
use std::borrow::Cow;
use std::collections::HashSet;
use std::io::Read;
use std::ops::Deref;

/// Largest number of files in an archive. A kernel has some dozens.
const FILES_MAX: usize = 1000;
/// Longest name of a file \[bytes\].
const NAME_BYTES_MAX: usize = 1024;
/// Bytes that are unpacked between two looks at the interrupt.
const BYTES_AT_ONCE: usize = 1 << 20;
/// Signature of a file's local header.
const LOCAL: u32 = 0x0403_4b50;
/// Signature of a file's entry in the central directory.
const CENTRAL: u32 = 0x0201_4b50;
/// Signature of the end record.
const END: u32 = 0x0605_4b50;

/// Whether the first bytes of a file are those of a zip archive.
pub(super) fn is_archive(bytes: &[u8]) -> bool {
    bytes.starts_with(&LOCAL.to_le_bytes())
}

/// An archive whose directory was read.
pub(super) struct Archive<'a> {
    bytes: &'a [u8],
    entries: Vec<Entry>,
}

/// What the directory says of a file.
struct Entry {
    name: String,
    flags: u16,
    method: u16,
    crc: u32,
    packed_bytes: usize,
    size_bytes: usize,
    local: usize,
}

/// The content of a file. Its memory is counted while this value lives.
#[derive(Debug)]
pub(super) struct Content<'a> {
    bytes: Cow<'a, [u8]>,
    _held: Held<'a>,
}

impl Deref for Content<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.bytes
    }
}

impl<'a> Archive<'a> {
    /// Reads the directory of an archive. Refuses one that names a file or a content twice: then two readers could see
    /// two different archives, and a small archive many large files.
    pub(super) fn open(bytes: &'a [u8]) -> Result<Self, KernelFormatError> {
        let start = bytes.len().saturating_sub(22 + usize::from(u16::MAX));
        let end = bytes[start..].windows(4).rposition(|window| window == END.to_le_bytes()).ok_or_else(cut)? + start;
        let count = usize::from(u16_at(bytes, end + 10)?);
        // The last field of the archive. If it is missing, the archive was cut.
        u16_at(bytes, end + 20)?;
        if count > FILES_MAX {
            return Err(KernelFormatError::Archive(format!("it has {count} files, but at most {FILES_MAX} are read")));
        }
        let mut at = u32_at(bytes, end + 16)? as usize;
        let mut entries = Vec::with_capacity(count);
        for _ in 0..count {
            let (entry, next) = Entry::read(bytes, at)?;
            entries.push(entry);
            at = next;
        }
        let (mut names, mut contents) = (HashSet::new(), HashSet::new());
        match entries.iter().find(|entry| !names.insert(&entry.name) || !contents.insert(entry.local)) {
            None => Ok(Self { bytes, entries }),
            Some(entry) => Err(entry.refused("its name or its content stands twice in the directory")),
        }
    }

    /// Names of the files, in the order of the directory.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.entries.iter().map(|entry| &entry.name[..])
    }

    /// Bytes of all files when they are unpacked.
    pub(super) fn unpacked_bytes(&self) -> u64 {
        self.entries.iter().map(|entry| entry.size_bytes as u64).sum()
    }

    /// Unpacks the file with a name; `None` if there is none.
    pub(super) fn content<'b>(&self, name: &str, budget: &'b Budget) -> Result<Option<Content<'b>>, KernelFormatError>
    where
        'a: 'b,
    {
        let Some(entry) = self.entries.iter().find(|entry| entry.name == name) else { return Ok(None) };
        let held = budget.hold(entry.size_bytes as u64)?;
        let bytes = entry.unpacked(self.bytes)?;
        if bytes.len() != entry.size_bytes || crc_of(&bytes) != entry.crc {
            return Err(entry.refused("its content does not match its checksum"));
        }
        Ok(Some(Content { bytes, _held: held }))
    }
}

impl Entry {
    /// Reads the entry at a place of the directory. Returns the place of the next one, too.
    fn read(bytes: &[u8], at: usize) -> Result<(Self, usize), KernelFormatError> {
        if u32_at(bytes, at)? != CENTRAL {
            return Err(KernelFormatError::Archive("its directory is damaged".to_owned()));
        }
        let length = |offset: usize| u16_at(bytes, at + offset).map(usize::from);
        let (name_bytes, extra_bytes, comment_bytes) = (length(28)?, length(30)?, length(32)?);
        let name = bytes.get(at + 46..at + 46 + name_bytes).ok_or_else(cut)?;
        if name_bytes > NAME_BYTES_MAX {
            let message = format!("a name in it has {name_bytes} bytes, but may have at most {NAME_BYTES_MAX}");
            return Err(KernelFormatError::Archive(message));
        }
        let entry = Self {
            name: String::from_utf8_lossy(name).into_owned(),
            flags: u16_at(bytes, at + 8)?,
            method: u16_at(bytes, at + 10)?,
            crc: u32_at(bytes, at + 16)?,
            packed_bytes: u32_at(bytes, at + 20)? as usize,
            size_bytes: u32_at(bytes, at + 24)? as usize,
            local: u32_at(bytes, at + 42)? as usize,
        };
        Ok((entry, at + 46 + name_bytes + extra_bytes + comment_bytes))
    }

    fn unpacked<'a>(&self, archive: &'a [u8]) -> Result<Cow<'a, [u8]>, KernelFormatError> {
        if self.flags & 1 != 0 {
            return Err(self.refused("it is encrypted"));
        }
        if u32_at(archive, self.local)? != LOCAL {
            return Err(self.refused("it has no local header"));
        }
        let length = |offset: usize| u16_at(archive, self.local + offset).map(usize::from);
        let start = self.local + 30 + length(26)? + length(28)?;
        let packed = archive.get(start..start.saturating_add(self.packed_bytes));
        let packed = packed.ok_or_else(|| self.refused("it ends early"))?;
        match self.method {
            0 => Ok(Cow::Borrowed(packed)),
            8 => self.inflated(packed).map(Cow::Owned),
            other => Err(self.refused(format!("it is compressed by method {other}; use store or deflate"))),
        }
    }

    /// The inflated content, which must have exactly the declared size.
    fn inflated(&self, packed: &[u8]) -> Result<Vec<u8>, KernelFormatError> {
        let mut content = vec![0; self.size_bytes];
        let mut decoder = DeflateDecoder::new(packed);
        for part in content.chunks_mut(BYTES_AT_ONCE) {
            interrupt::check();
            decoder.read_exact(part).map_err(|error| self.refused(error))?;
        }
        match decoder.read(&mut [0]).map_err(|error| self.refused(error))? {
            0 => Ok(content),
            _ => Err(self.refused(format!("it has more than the {} bytes of the directory", self.size_bytes))),
        }
    }

    fn refused(&self, problem: impl std::fmt::Display) -> KernelFormatError {
        KernelFormatError::Archive(format!("{}: {problem}", shortened(&self.name)))
    }
}

fn cut() -> KernelFormatError {
    KernelFormatError::Archive("it ends early".to_owned())
}

/// Writes an archive of stored files. The same files give the same bytes.
pub(super) fn write(files: &[(&str, &[u8])]) -> Result<Vec<u8>, KernelFormatError> {
    let (mut archive, mut directory) = (Vec::new(), Vec::new());
    let too_large = |_| KernelFormatError::Archive("it would exceed 4 GiB".to_owned());
    for (name, content) in files {
        let (local, size) =
            (u32::try_from(archive.len()).map_err(too_large)?, u32::try_from(content.len()).map_err(too_large)?);
        // Version 2.0, no flags, stored, 1 January 1980.
        let mut common = vec![20, 0, 0, 0, 0, 0, 0, 0, 0x21, 0];
        for number in [crc_of(content), size, size] {
            common.extend(number.to_le_bytes());
        }
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0, 0]);
        archive.extend(LOCAL.to_le_bytes());
        archive.extend(&common);
        archive.extend(name.as_bytes());
        archive.extend(*content);
        directory.extend(CENTRAL.to_le_bytes());
        directory.extend([20, 0]);
        directory.extend(&common);
        directory.extend([0; 10]);
        directory.extend(local.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let start = u32::try_from(archive.len()).map_err(too_large)?;
    let count = (files.len() as u16).to_le_bytes();
    let size = (directory.len() as u32).to_le_bytes();
    archive.extend(&directory);
    archive.extend(END.to_le_bytes());
    archive.extend([0; 4]);
    archive.extend(count);
    archive.extend(count);
    archive.extend(size);
    archive.extend(start.to_le_bytes());
    archive.extend([0; 2]);
    Ok(archive)
}

/// CRC-32 of the bytes.
pub(super) fn crc_of(bytes: &[u8]) -> u32 {
    let mut crc = flate2::Crc::new();
    crc.update(bytes);
    crc.sum()
}

fn u16_at(bytes: &[u8], at: usize) -> Result<u16, KernelFormatError> {
    bytes.get(at..).and_then(|rest| rest.first_chunk()).map(|chunk| u16::from_le_bytes(*chunk)).ok_or_else(cut)
}

fn u32_at(bytes: &[u8], at: usize) -> Result<u32, KernelFormatError> {
    bytes.get(at..).and_then(|rest| rest.first_chunk()).map(|chunk| u32::from_le_bytes(*chunk)).ok_or_else(cut)
}

/// Names and contents of all files.
#[cfg(test)]
pub(super) fn files(bytes: &[u8]) -> Result<Vec<(String, Vec<u8>)>, KernelFormatError> {
    let (archive, budget) = (Archive::open(bytes)?, Budget::new(1 << 30));
    let content = |name: &str| Ok((name.to_owned(), archive.content(name, &budget)?.unwrap().to_vec()));
    archive.names().map(content).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_read_back_and_damage_is_found() {
        let (a, b) = (vec![7_u8; 1000], b"hello".to_vec());
        let archive = write(&[("x/a", &a), ("b.txt", &b)]).unwrap();
        assert_eq!(files(&archive).unwrap(), [("x/a".to_owned(), a), ("b.txt".to_owned(), b)]);
        for end in [0, 10, 100, archive.len() - 23, archive.len() - 1] {
            assert!(files(&archive[..end]).is_err(), "cut at {end}");
        }
        let mut damaged = archive.clone();
        damaged[50] ^= 1;
        assert!(files(&damaged).unwrap_err().to_string().contains("checksum"));
    }

    #[test]
    fn content_is_counted_before_it_is_unpacked() {
        let archive = write(&[("a", &[7; 1000])]).unwrap();
        let (archive, budget) = (Archive::open(&archive).unwrap(), Budget::new(1500));
        assert_eq!(archive.unpacked_bytes(), 1000);
        let first = archive.content("a", &budget).unwrap().unwrap();
        let refused = archive.content("a", &budget).unwrap_err().to_string();
        assert!(refused.contains("at least 2000 bytes of memory, but 1500 are counted"), "{refused}");
        drop(first);
        assert!(archive.content("a", &budget).unwrap().is_some() && archive.content("b", &budget).unwrap().is_none());
    }

    #[test]
    fn names_and_contents_that_stand_twice_are_refused() {
        let twice = write(&[("a", b"1"), ("a", b"2")]).unwrap();
        assert!(files(&twice).unwrap_err().to_string().contains("a: its name or its content stands twice"));
        let mut shared = write(&[("a", b"1"), ("b", b"1")]).unwrap();
        // The last field of the second entry, before its name and the end record, is the place of its content.
        let place = shared.len() - 22 - 1 - 4;
        shared[place..place + 4].fill(0);
        assert!(files(&shared).unwrap_err().to_string().contains("b: its name or its content stands twice"));
    }
}
