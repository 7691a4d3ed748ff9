//! Reading a blob piece by piece.

use crate::blocking::blocking;
use crate::error::{ArtifactError, Result};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

/// Size of the pieces in which blobs are read and hashed \[bytes\]: large enough to make the cost of a call negligible,
/// small enough for a gRPC message.
pub const CHUNK_BYTES: usize = 1 << 20;

/// Reader of a range of a blob.
#[derive(Debug)]
pub struct ArtifactReader {
    file: Option<File>,
    size_bytes: u64,
    left_bytes: u64,
}

impl ArtifactReader {
    pub(super) fn new(mut file: File, size_bytes: u64, offset_bytes: u64, limit_bytes: u64) -> Result<Self> {
        if offset_bytes > size_bytes {
            return Err(ArtifactError::OutOfRange { offset_bytes, size_bytes });
        }
        file.seek(SeekFrom::Start(offset_bytes)).map_err(|error| ArtifactError::io("read a file", error))?;
        let rest = size_bytes - offset_bytes;
        let left_bytes = if limit_bytes == 0 { rest } else { rest.min(limit_bytes) };
        Ok(Self { file: Some(file), size_bytes, left_bytes })
    }

    /// Size of the whole blob \[bytes\].
    #[must_use]
    pub fn size_bytes(&self) -> u64 {
        self.size_bytes
    }

    /// Bytes of the range that have not been read yet.
    #[must_use]
    pub fn left_bytes(&self) -> u64 {
        self.left_bytes
    }

    /// Returns the next piece, at most `bytes_max` long; `None` at the end of the range.
    pub async fn next_chunk(&mut self, bytes_max: usize) -> Result<Option<Vec<u8>>> {
        let count = self.left_bytes.min(bytes_max as u64);
        let Some(mut file) = self.file.take().filter(|_| count > 0) else { return Ok(None) };
        let (file, chunk) = blocking(move || {
            let mut chunk = vec![0; count as usize];
            file.read_exact(&mut chunk).map_err(|error| ArtifactError::io("read a file", error))?;
            Ok((file, chunk))
        })
        .await?;
        self.file = Some(file);
        self.left_bytes -= count;
        Ok(Some(chunk))
    }
}
