//! Fetching kernels.

use crate::digest::Hasher;
use crate::download::FileToBe;
use crate::retry::Backoff;
use crate::v1::fetch_kernel_response::Part;
use crate::v1::{FetchKernelRequest, KernelFile, KernelFormat, KernelVersion};
use crate::{Client, Error, Result};
use std::path::Path;

impl Client {
    /// A kernel version (0: the active one) and its file in a form, with what that form costs where it is not the stored one.
    ///
    /// # Errors
    ///
    /// What the server refused, that it could not be reached for about 15 seconds, or [`Error::Damaged`].
    pub async fn fetch_kernel_as(
        &self,
        kernel: &str,
        version: u32,
        format: KernelFormat,
    ) -> Result<(KernelVersion, Option<KernelFile>, Vec<u8>)> {
        let mut backoff = Backoff::new();
        loop {
            match self.fetch_kernel_once(kernel, version, format).await {
                Ok(fetched) => return Ok(fetched),
                Err(error) => backoff.pause(error).await?,
            }
        }
    }

    /// A kernel version (0: the active one) and its safetensors file.
    ///
    /// # Errors
    ///
    /// As [`Self::fetch_kernel_as`].
    pub async fn fetch_kernel(&self, kernel: &str, version: u32) -> Result<(KernelVersion, Vec<u8>)> {
        let (version, _, bytes) = self.fetch_kernel_as(kernel, version, KernelFormat::Safetensors).await?;
        Ok((version, bytes))
    }

    /// Writes a kernel version's (0: the active one's) safetensors file to `path`.
    ///
    /// # Errors
    ///
    /// As [`Self::fetch_kernel_to_as`].
    pub async fn fetch_kernel_to(&self, kernel: &str, version: u32, path: &Path) -> Result<KernelVersion> {
        Ok(self.fetch_kernel_to_as(kernel, version, KernelFormat::Safetensors, path).await?.0)
    }

    /// Writes a kernel version (0: the active one) in a form to the file `path`, which appears (or is replaced) only when all
    /// of it is there and checked.
    ///
    /// # Errors
    ///
    /// As [`Self::fetch_kernel_as`], and [`Error::File`] when the file cannot be written.
    pub async fn fetch_kernel_to_as(
        &self,
        kernel: &str,
        version: u32,
        format: KernelFormat,
        path: &Path,
    ) -> Result<(KernelVersion, Option<KernelFile>)> {
        let mut file = FileToBe::beside(path)?;
        let (version, made, bytes) = self.fetch_kernel_as(kernel, version, format).await?;
        file.write(&bytes)?;
        file.finish()?;
        Ok((version, made))
    }

    async fn fetch_kernel_once(
        &self,
        kernel: &str,
        version: u32,
        format: KernelFormat,
    ) -> Result<(KernelVersion, Option<KernelFile>, Vec<u8>)> {
        let request = FetchKernelRequest { kernel: kernel.to_owned(), version, format: format.into() };
        let refused = |status| self.error(status);
        let mut stream = self.kernels().fetch_kernel(request).await.map_err(refused)?.into_inner();
        let Some(Part::Version(version)) = stream.message().await.map_err(refused)?.and_then(|first| first.part) else {
            return Err(Error::Protocol { what: "a fetched kernel does not start with its version" });
        };
        let (mut bytes, mut hasher, mut made) = (Vec::new(), Hasher::default(), None);
        while let Some(message) = stream.message().await.map_err(refused)? {
            let chunk = match message.part {
                Some(Part::Chunk(chunk)) => chunk,
                Some(Part::File(file)) if made.is_none() && bytes.is_empty() => {
                    made = Some(file);
                    continue;
                }
                _ => return Err(Error::Protocol { what: "a fetched kernel has something else than bytes in it" }),
            };
            hasher.update(&chunk);
            bytes.extend_from_slice(&chunk);
        }
        let found = hasher.finish();
        let expected = made.as_ref().map_or(&version.artifact, |file: &KernelFile| &file.digest);
        if found != *expected {
            return Err(Error::Damaged { digest: expected.clone(), found });
        }
        Ok((version, made, bytes))
    }
}
