//! Reading artifacts as pictures.

use super::Files;
use crate::call::Call;
use crate::error::{Result, ServiceError};
use crate::field::Field;
use lightpath_artifacts::ArtifactError;
use lightpath_media::pictures::{self, PictureError};

/// Memory for reading a header \[bytes\], besides the file and what is copied of it: the tags of TIFF files take most.
const HEADER_BYTES: u64 = 16 << 20;

/// The error for an artifact that is no picture or hologram as it must be.
pub(crate) fn unreadable(field: &Field, digest: &str, error: &PictureError) -> ServiceError {
    field.invalid(format!("({digest}): {error}"), error.fix())
}

impl Files {
    /// Refuses an artifact that does not exist or is larger than a picture may be, and returns its size \[bytes\].
    pub async fn require_picture(&self, call: &Call, field: &Field, digest: &str) -> Result<u64> {
        let Some(record) = self.readable(call, digest).await? else {
            return Err(field.missing(format!("artifact {digest}"), "upload it first"));
        };
        if record.size_bytes > pictures::FILE_BYTES_MAX as u64 {
            let error = PictureError::FileTooLarge { bytes: record.size_bytes as usize };
            return Err(unreadable(field, digest, &error));
        }
        Ok(record.size_bytes)
    }

    /// Memory for reading an artifact as a picture and fitting it to `fitted_px` pixels \[bytes\].
    pub async fn reading_bytes(&self, call: &Call, field: &Field, digest: &str, fitted_px: u64) -> Result<u64> {
        self.header_number(call, field, digest, move |file| pictures::reading_bytes(file, fitted_px)).await
    }

    /// Number of pixels of an artifact that is a picture; 0 if it is none.
    pub async fn picture_pixels(&self, call: &Call, field: &Field, digest: &str) -> Result<u64> {
        self.header_number(call, field, digest, pictures::pixels).await
    }

    async fn header_number(
        &self,
        call: &Call,
        field: &Field,
        digest: &str,
        read: impl FnOnce(&[u8]) -> u64 + Send + 'static,
    ) -> Result<u64> {
        let file_bytes = self.require_picture(call, field, digest).await?;
        let (artifacts, digest) = (self.artifacts.clone(), digest.to_owned());
        let read_header = move || Ok::<_, ArtifactError>(read(&artifacts.read_blocking(&digest)?));
        Ok(self.computing.run(call, 2 * file_bytes + HEADER_BYTES, read_header).await??)
    }

    /// Reads a picture for a display of `fitted_px` pixels. Returns the result of `decode` and the memory that reading
    /// needs \[bytes\].
    pub async fn decoded<T: Send + 'static>(
        &self,
        call: &Call,
        field: &Field,
        (digest, fitted_px): (&str, u64),
        decode: impl FnOnce(&[u8]) -> Result<T, PictureError> + Send + 'static,
    ) -> Result<(T, u64)> {
        let bytes = self.reading_bytes(call, field, digest, fitted_px).await?;
        let (artifacts, name) = (self.artifacts.clone(), digest.to_owned());
        // The file is read only when its turn has come, so that waiting calls hold no memory.
        let compute = move || artifacts.read_blocking(&name).map(|file| decode(&file));
        let decoded = self.computing.run(call, bytes, compute).await??;
        let decoded = decoded.map_err(|error| unreadable(field, digest, &error))?;
        Ok((decoded, bytes))
    }
}
