//! Reading artifacts as pictures.

use crate::api::Api;
use crate::error::ApiError;
use crate::field::Field;
use lightpath_domain::access::Caller;
use lightpath_media::pictures::{self, PictureError};

impl Api {
    /// Refuses an artifact that does not exist or is larger than a picture may be.
    pub(crate) async fn require_picture(&self, caller: &Caller, field: &Field, digest: &str) -> Result<(), ApiError> {
        let Some(record) = self.artifact_for_caller(caller, digest).await? else {
            return Err(field.missing(format!("artifact {digest}"), "upload it first"));
        };
        if record.size_bytes > pictures::FILE_BYTES_MAX as u64 {
            let error = PictureError::FileTooLarge { bytes: record.size_bytes as usize };
            return Err(field.invalid(format!("({digest}): {error}")));
        }
        Ok(())
    }

    /// Reads an artifact. Refuses it if it does not exist or is larger than a picture may be.
    pub(crate) async fn picture_bytes(
        &self,
        caller: &Caller,
        field: &Field,
        digest: &str,
    ) -> Result<Vec<u8>, ApiError> {
        self.require_picture(caller, field, digest).await?;
        Ok(self.artifacts.read_all(digest).await?)
    }

    /// Reads a picture and returns the result of `decode`.
    pub(crate) async fn decoded<T: Send + 'static>(
        &self,
        caller: &Caller,
        field: &Field,
        digest: &str,
        decode: impl FnOnce(&[u8]) -> Result<T, PictureError> + Send + 'static,
    ) -> Result<T, ApiError> {
        let bytes = self.picture_bytes(caller, field, digest).await?;
        let decoded = self.decoding.run(move || decode(&bytes)).await?;
        decoded.map_err(|error| field.invalid(format!("({digest}): {error}")))
    }
}
