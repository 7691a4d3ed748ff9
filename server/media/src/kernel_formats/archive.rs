//! The part of the zip format that arrays need: stored or deflated files, without encryption, no part beyond 4 GiB.
//!
//! Source: PKWARE APPNOTE 6.3. All numbers are little-endian.

use super::error::KernelFormatError;
use flate2::read::DeflateDecoder;
use std::io::Read;

/// Largest inflated file of an archive \[bytes\]: a complex kernel of an 8K display.
const FILE_BYTES_MAX: u64 = 1 << 30;
/// Largest number of files in an archive.
const FILES_MAX: usize = 1000;
/// Signature of a file's local header.
const LOCAL: u32 = 0x0403_4b50;
/// Signature of a file's entry in the central directory.
const CENTRAL: u32 = 0x0201_4b50;
/// Signature of the end record.
const END: u32 = 0x0605_4b50;

/// Names and contents of files.
pub(super) type Files = Vec<(String, Vec<u8>)>;

/// Whether the first bytes of a file are those of a zip archive.
pub(super) fn is_archive(bytes: &[u8]) -> bool {
    bytes.starts_with(&LOCAL.to_le_bytes())
}

/// Reads the files of an archive.
pub(super) fn read(bytes: &[u8]) -> Result<Files, KernelFormatError> {
    let cut = || KernelFormatError::Archive("it ends early".to_owned());
    let start = bytes.len().saturating_sub(22 + usize::from(u16::MAX));
    let tail = bytes.get(start..).ok_or_else(cut)?;
    let end = tail.windows(4).rposition(|window| window == END.to_le_bytes()).ok_or_else(cut)? + start;
    let count = usize::from(u16_at(bytes, end + 10)?);
    // The last field of the archive. If it is missing, the archive was cut.
    u16_at(bytes, end + 20)?;
    if count > FILES_MAX {
        return Err(KernelFormatError::Archive(format!("it has {count} files, but at most {FILES_MAX} are read")));
    }
    let mut at = u32_at(bytes, end + 16)? as usize;
    let mut files = Vec::with_capacity(count);
    for _ in 0..count {
        if u32_at(bytes, at)? != CENTRAL {
            return Err(KernelFormatError::Archive("its directory is damaged".to_owned()));
        }
        let lengths = [28, 30, 32].map(|offset| u16_at(bytes, at + offset).map(usize::from));
        let [name_bytes, extra_bytes, comment_bytes] = lengths;
        let (name_bytes, extra_bytes, comment_bytes) = (name_bytes?, extra_bytes?, comment_bytes?);
        let name = bytes.get(at + 46..at + 46 + name_bytes).ok_or_else(cut)?;
        let name = String::from_utf8_lossy(name).into_owned();
        let content = content(bytes, at, &name)?;
        files.push((name, content));
        at += 46 + name_bytes + extra_bytes + comment_bytes;
    }
    Ok(files)
}

fn content(bytes: &[u8], entry: usize, name: &str) -> Result<Vec<u8>, KernelFormatError> {
    let refused = |problem: String| KernelFormatError::Archive(format!("{name}: {problem}"));
    let (flags, method) = (u16_at(bytes, entry + 8)?, u16_at(bytes, entry + 10)?);
    let crc = u32_at(bytes, entry + 16)?;
    let (packed_bytes, size_bytes) = (u32_at(bytes, entry + 20)? as usize, u64::from(u32_at(bytes, entry + 24)?));
    let local = u32_at(bytes, entry + 42)? as usize;
    if flags & 1 != 0 {
        return Err(refused("it is encrypted".to_owned()));
    }
    if size_bytes > FILE_BYTES_MAX || u32_at(bytes, local)? != LOCAL {
        return Err(refused(format!("it has {size_bytes} bytes (at most {FILE_BYTES_MAX}), or no local header")));
    }
    let start = local + 30 + usize::from(u16_at(bytes, local + 26)?) + usize::from(u16_at(bytes, local + 28)?);
    let packed =
        bytes.get(start..start.saturating_add(packed_bytes)).ok_or_else(|| refused("it ends early".to_owned()))?;
    let content = match method {
        0 => packed.to_vec(),
        8 => {
            let mut content = Vec::new();
            // Reads one byte more than declared, to detect longer contents.
            let mut decoder = DeflateDecoder::new(packed).take(size_bytes + 1);
            decoder.read_to_end(&mut content).map_err(|error| refused(error.to_string()))?;
            content
        }
        other => return Err(refused(format!("it is compressed by method {other}; use store or deflate"))),
    };
    if content.len() as u64 != size_bytes || crc_of(&content) != crc {
        return Err(refused("its content does not match its checksum".to_owned()));
    }
    Ok(content)
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
    let found = bytes.get(at..).and_then(|rest| rest.first_chunk::<2>());
    found.map(|chunk| u16::from_le_bytes(*chunk)).ok_or_else(|| KernelFormatError::Archive("it ends early".to_owned()))
}

fn u32_at(bytes: &[u8], at: usize) -> Result<u32, KernelFormatError> {
    let found = bytes.get(at..).and_then(|rest| rest.first_chunk::<4>());
    found.map(|chunk| u32::from_le_bytes(*chunk)).ok_or_else(|| KernelFormatError::Archive("it ends early".to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_read_back_and_damage_is_found() {
        let (a, b) = (vec![7_u8; 1000], b"hello".to_vec());
        let archive = write(&[("x/a", &a), ("b.txt", &b)]).unwrap();
        assert_eq!(read(&archive).unwrap(), [("x/a".to_owned(), a), ("b.txt".to_owned(), b)]);
        for end in [0, 10, 100, archive.len() - 23, archive.len() - 1] {
            assert!(read(&archive[..end]).is_err(), "cut at {end}");
        }
        let mut damaged = archive.clone();
        damaged[50] ^= 1;
        assert!(read(&damaged).unwrap_err().to_string().contains("checksum"));
    }
}
