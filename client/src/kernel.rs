//! Fetching kernels.

use crate::digest::Hasher;
use crate::download::FileToBe;
use crate::retry::Backoff;
use crate::v1::fetch_kernel_response::Part;
use crate::v1::{FetchKernelRequest, KernelVersion};
use crate::{Client, Error, Result};
use std::path::Path;

impl Client {
    /// A kernel version (0: the active one) and its safetensors file.
    ///
    /// # Errors
    ///
    /// What the server refused, that it could not be reached for about 15 seconds, or [`Error::Damaged`].
    pub async fn fetch_kernel(&self, kernel: &str, version: u32) -> Result<(KernelVersion, Vec<u8>)> {
        let mut backoff = Backoff::new();
        loop {
            match self.fetch_kernel_once(kernel, version).await {
                Ok(fetched) => return Ok(fetched),
                Err(error) => backoff.pause(error).await?,
            }
        }
    }

    /// Writes a kernel version (0: the active one) to the file `path`, which appears (or is replaced) only when all
    /// of it is there and checked.
    ///
    /// # Errors
    ///
    /// As [`Self::fetch_kernel`], and [`Error::File`] when the file cannot be written.
    pub async fn fetch_kernel_to(&self, kernel: &str, version: u32, path: &Path) -> Result<KernelVersion> {
        let mut file = FileToBe::beside(path)?;
        let (version, bytes) = self.fetch_kernel(kernel, version).await?;
        file.write(&bytes)?;
        file.finish()?;
        Ok(version)
    }

    async fn fetch_kernel_once(&self, kernel: &str, version: u32) -> Result<(KernelVersion, Vec<u8>)> {
        let request = FetchKernelRequest { kernel: kernel.to_owned(), version };
        let refused = |status| self.error(status);
        let mut stream = self.kernels().fetch_kernel(request).await.map_err(refused)?.into_inner();
        let Some(Part::Version(version)) = stream.message().await.map_err(refused)?.and_then(|first| first.part) else {
            return Err(Error::Protocol { what: "a fetched kernel does not start with its version" });
        };
        let (mut bytes, mut hasher) = (Vec::new(), Hasher::default());
        while let Some(message) = stream.message().await.map_err(refused)? {
            let Some(Part::Chunk(chunk)) = message.part else {
                return Err(Error::Protocol { what: "a fetched kernel has something else than bytes in it" });
            };
            hasher.update(&chunk);
            bytes.extend_from_slice(&chunk);
        }
        let found = hasher.finish();
        if found != version.artifact {
            return Err(Error::Damaged { digest: version.artifact, found });
        }
        Ok((version, bytes))
    }
}
