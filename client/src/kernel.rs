//! Downloads of kernels, and following their changes.

use crate::digest::Hasher;
use crate::download::PartialFile;
use crate::job::WAIT_TRIES_MAX;
use crate::retry::Backoff;
use crate::v1::fetch_kernel_response::Part;
use crate::v1::{
    FetchKernelRequest, FetchKernelResponse, GetKernelManifestRequest, Kernel, KernelFile, KernelFormat,
    KernelManifest, KernelVersion, WatchKernelRequest,
};
use crate::{Client, Error, Result};
use std::ops::ControlFlow;
use std::path::Path;

/// A change that [`Client::follow_kernel`] reports.
#[derive(Debug)]
#[non_exhaustive]
pub enum KernelChange<'a> {
    /// The current state of the kernel.
    Kernel(&'a Kernel),
    /// The connection was lost, and the client tries to reconnect. Reported once for each loss.
    ConnectionLost(&'a Error),
    /// The connection is restored.
    Reconnected,
}

impl Client {
    /// Fetches a kernel version and its file in a format. Without a `version` it is the active one.
    ///
    /// For a format other than safetensors a [`KernelFile`] gives the size of the converted file and the error of the
    /// conversion.
    ///
    /// # Errors
    ///
    /// [`Error::Refused`] when the server refuses the call, [`Error::Unreachable`] after about 15 seconds without a
    /// server, [`Error::Damaged`] when the bytes do not match the digest.
    pub async fn fetch_kernel_as(
        &self,
        kernel: &str,
        version: Option<u32>,
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

    /// Fetches a kernel version and its safetensors file. Without a `version` it is the active one.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::fetch_kernel_as`].
    pub async fn fetch_kernel(&self, kernel: &str, version: Option<u32>) -> Result<(KernelVersion, Vec<u8>)> {
        let (version, _, bytes) = self.fetch_kernel_as(kernel, version, KernelFormat::Safetensors).await?;
        Ok((version, bytes))
    }

    /// Writes the safetensors file of a kernel version to `path`. Without a `version` it is the active one.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::fetch_kernel_to_as`].
    pub async fn fetch_kernel_to(&self, kernel: &str, version: Option<u32>, path: &Path) -> Result<KernelVersion> {
        Ok(self.fetch_kernel_to_as(kernel, version, KernelFormat::Safetensors, path, |_| {}).await?.0)
    }

    /// Writes the file of a kernel version in a format to `path`. Without a `version` it is the active one. The file appears,
    /// or is replaced, only after the whole download is checked. For a format other than safetensors `before` is called
    /// before that, with what the format loses.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::fetch_kernel_as`], and [`Error::File`] when the file cannot be written.
    pub async fn fetch_kernel_to_as(
        &self,
        kernel: &str,
        version: Option<u32>,
        format: KernelFormat,
        path: &Path,
        before: impl FnOnce(&KernelFile),
    ) -> Result<(KernelVersion, Option<KernelFile>)> {
        let mut file = PartialFile::create(path)?;
        let (version, converted, bytes) = self.fetch_kernel_as(kernel, version, format).await?;
        if let Some(converted) = &converted {
            before(converted);
        }
        file.write(&bytes)?;
        file.finish()?;
        Ok((version, converted))
    }

    /// Returns a kernel version and, for a format other than safetensors, what its file would be, without the file.
    /// Without a `version` it is the active one.
    ///
    /// # Errors
    ///
    /// [`Error::Refused`] when the server refuses the call, [`Error::Unreachable`] when no server answers.
    pub async fn describe_kernel(
        &self,
        kernel: &str,
        version: Option<u32>,
        format: KernelFormat,
    ) -> Result<(KernelVersion, Option<KernelFile>)> {
        let request = FetchKernelRequest { kernel: kernel.to_owned(), version, format: format.into(), offset_bytes: 0 };
        let call_error = |status| self.error(status);
        let mut stream = self.kernels().fetch_kernel(request).await.map_err(call_error)?.into_inner();
        let version = first_version(stream.message().await.map_err(call_error)?)?;
        if format == KernelFormat::Safetensors {
            return Ok((version, None));
        }
        match stream.message().await.map_err(call_error)?.and_then(|second| second.part) {
            Some(Part::File(file)) => Ok((version, Some(file))),
            _ => Err(Error::Protocol { what: "the second message of a converted kernel does not describe its file" }),
        }
    }

    /// Returns the signed manifest of a kernel's active version. Waits until the server has made the file that it names.
    ///
    /// # Errors
    ///
    /// The errors of [`Self::get_kernel_manifest`].
    pub async fn kernel_manifest(&self, request: GetKernelManifestRequest) -> Result<KernelManifest> {
        loop {
            match self.get_kernel_manifest(request.clone()).await {
                Err(error) => match error.converting() {
                    Some(delay) => tokio::time::sleep(delay).await,
                    None => return Err(error),
                },
                manifest => return manifest,
            }
        }
    }

    /// Follows a kernel, `displays/{id}/kernels/{k}`: reports its current state, and then each change, until
    /// `on_change` breaks.
    ///
    /// Following survives a restart of the server.
    ///
    /// # Errors
    ///
    /// [`Error::Refused`] when the server refuses the call. [`Error::Unreachable`] at once if the first connection fails,
    /// and after about ten minutes without a server if a later one is lost.
    pub async fn follow_kernel(
        &self,
        kernel: &str,
        mut on_change: impl FnMut(KernelChange<'_>) -> ControlFlow<()>,
    ) -> Result<()> {
        let mut backoff = Backoff::with_tries(WAIT_TRIES_MAX);
        let (mut reached, mut lost) = (false, false);
        loop {
            let mut on_kernel = |kernel: &Kernel| {
                let was_lost = std::mem::take(&mut lost);
                reached = true;
                backoff.reset();
                if was_lost {
                    on_change(KernelChange::Reconnected)?;
                }
                on_change(KernelChange::Kernel(kernel))
            };
            let error = match self.watch_kernel_once(kernel, &mut on_kernel).await {
                Ok(ControlFlow::Break(())) => return Ok(()),
                // A server that shuts down ends the stream without an error.
                Ok(ControlFlow::Continue(())) => self.error(tonic::Status::unavailable("the server ended the watch")),
                Err(error) => error,
            };
            if !reached || !error.is_unreachable() {
                return Err(error);
            }
            if !lost {
                lost = true;
                if on_change(KernelChange::ConnectionLost(&error)).is_break() {
                    return Ok(());
                }
            }
            backoff.pause(error).await?;
        }
    }

    async fn watch_kernel_once(
        &self,
        kernel: &str,
        on_kernel: &mut impl FnMut(&Kernel) -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>> {
        let mut stream = self.watch_kernel(WatchKernelRequest { name: kernel.to_owned() }).await?;
        while let Some(kernel) = stream.message().await.map_err(|status| self.error(status))? {
            if on_kernel(&kernel).is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    async fn fetch_kernel_once(
        &self,
        kernel: &str,
        version: Option<u32>,
        format: KernelFormat,
    ) -> Result<(KernelVersion, Option<KernelFile>, Vec<u8>)> {
        let request = FetchKernelRequest { kernel: kernel.to_owned(), version, format: format.into(), offset_bytes: 0 };
        let call_error = |status| self.error(status);
        let mut stream = self.kernels().fetch_kernel(request).await.map_err(call_error)?.into_inner();
        let version = first_version(stream.message().await.map_err(call_error)?)?;
        let (mut bytes, mut hasher, mut converted) = (Vec::new(), Hasher::default(), None);
        while let Some(message) = stream.message().await.map_err(call_error)? {
            let chunk = match message.part {
                Some(Part::Chunk(chunk)) => chunk,
                Some(Part::File(file)) if converted.is_none() && bytes.is_empty() => {
                    converted = Some(file);
                    continue;
                }
                _ => {
                    return Err(Error::Protocol {
                        what: "a fetched kernel has a message that is not a chunk of its file",
                    });
                }
            };
            hasher.update(&chunk);
            bytes.extend_from_slice(&chunk);
        }
        let found = hasher.finish();
        let expected = converted.as_ref().map_or(&version.artifact, |file: &KernelFile| &file.digest);
        if found != *expected {
            return Err(Error::Damaged { digest: expected.clone(), found });
        }
        Ok((version, converted, bytes))
    }
}

/// The version in the first message of a fetched kernel.
fn first_version(message: Option<FetchKernelResponse>) -> Result<KernelVersion> {
    match message.and_then(|first| first.part) {
        Some(Part::Version(version)) => Ok(version),
        _ => Err(Error::Protocol { what: "the first message of a fetched kernel is not its version" }),
    }
}
