//! Uploads. Content that the server has already is not sent. An upload continues after a lost connection.

use crate::digest::digest_of_file;
use crate::retry::Backoff;
use crate::v1::write_artifact_request::Part;
use crate::v1::{GetUploadRequest, WriteArtifactRequest, WriteArtifactStart};
use crate::{Client, Error, Result, digest_of};
use std::io::SeekFrom;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use tokio::io::{AsyncReadExt as _, AsyncSeekExt as _};
use tokio_stream::Stream;

/// Size of a chunk. The server accepts up to 2 MiB. Smaller chunks lose less when the connection is lost.
const CHUNK_BYTES: usize = 1 << 20;

/// Content of an upload.
#[derive(Clone)]
enum Content {
    Memory(Arc<[u8]>),
    File(PathBuf),
}

impl Client {
    /// Stores `bytes` on the server and returns their digest, `sha256-…`. Does not send content that is stored already.
    ///
    /// # Errors
    ///
    /// [`Error::Refused`] when the server refuses the call, [`Error::Unreachable`] after about 15 seconds without a
    /// server.
    pub async fn upload_bytes(&self, bytes: impl Into<Vec<u8>>) -> Result<String> {
        let bytes: Vec<u8> = bytes.into();
        let (digest, size_bytes) = (digest_of(&bytes), bytes.len() as u64);
        self.upload(digest, size_bytes, Content::Memory(bytes.into())).await
    }

    /// Stores a file's content on the server and returns its digest, `sha256-…`. Does not send content that is stored
    /// already.
    ///
    /// # Errors
    ///
    /// [`Error::File`] when the file cannot be read, [`Error::Refused`] when the server refuses the call,
    /// [`Error::Unreachable`] after about 15 seconds without a server.
    pub async fn upload_file(&self, path: &Path) -> Result<String> {
        let path = path.to_owned();
        let hashed = path.clone();
        // A panic while hashing is a bug of this crate, so the caller panics too.
        let hashing = tokio::task::spawn_blocking(move || digest_of_file(&hashed)).await;
        let (digest, size_bytes) = hashing.unwrap_or_else(|error| std::panic::resume_unwind(error.into_panic()))?;
        self.upload(digest, size_bytes, Content::File(path)).await
    }

    async fn upload(&self, digest: String, size_bytes: u64, content: Content) -> Result<String> {
        let mut backoff = Backoff::new();
        let mut received_before = 0;
        loop {
            let error = match self.upload_once(&digest, size_bytes, &content).await {
                Ok(()) => return Ok(digest),
                Err(error) => error,
            };
            backoff.pause(error).await?;
            let upload = self.get_upload(GetUploadRequest { digest: digest.clone() }).await;
            if let Ok(upload) = upload
                && upload.received_bytes > received_before
            {
                received_before = upload.received_bytes;
                backoff.reset();
            }
        }
    }

    /// Sends the part of the content that the server has not received yet.
    async fn upload_once(&self, digest: &str, size_bytes: u64, content: &Content) -> Result<()> {
        let upload = self.get_upload(GetUploadRequest { digest: digest.to_owned() }).await?;
        if upload.complete {
            return Ok(());
        }
        // A stored part longer than the content cannot be its beginning: send everything.
        let offset_bytes = if upload.received_bytes > size_bytes { 0 } else { upload.received_bytes };
        let start = WriteArtifactStart { digest: digest.to_owned(), size_bytes, offset_bytes };
        let read_error = Arc::new(Mutex::new(None));
        let messages = messages(start, content.clone(), Arc::clone(&read_error));
        let answer = self.artifacts().write_artifact(messages).await;
        // After a read error the upload is too short, and the server refuses it. The read error is the cause.
        if let Some(error) = read_error.lock().unwrap_or_else(PoisonError::into_inner).take() {
            return Err(error);
        }
        let stored = answer.map_err(|status| self.error(status))?.into_inner();
        if stored.digest != digest {
            return Err(Error::Protocol { what: "it stored an upload under another digest" });
        }
        Ok(())
    }
}

/// Streams the start message, then chunks to the end of the content. A read error ends the stream and is stored in
/// `read_error`.
fn messages(
    start: WriteArtifactStart,
    content: Content,
    read_error: Arc<Mutex<Option<Error>>>,
) -> impl Stream<Item = WriteArtifactRequest> {
    enum Next {
        Start(WriteArtifactStart, Content),
        Chunks(Chunks),
        End,
    }
    futures::stream::unfold(Next::Start(start, content), move |next| {
        let read_error = Arc::clone(&read_error);
        async move {
            let read = match next {
                Next::Start(start, content) => {
                    let chunks = Chunks { content, offset_bytes: start.offset_bytes, file: None };
                    return Some((message(Part::Start(start)), Next::Chunks(chunks)));
                }
                Next::Chunks(mut chunks) => chunks.next().await.map(|chunk| (chunk, chunks)),
                Next::End => return None,
            };
            match read {
                Ok((chunk, _)) if chunk.is_empty() => None,
                Ok((chunk, chunks)) => Some((message(Part::Chunk(chunk.into())), Next::Chunks(chunks))),
                Err(error) => {
                    *read_error.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                    Some((message(Part::Chunk(Vec::new().into())), Next::End))
                }
            }
        }
    })
}

fn message(part: Part) -> WriteArtifactRequest {
    WriteArtifactRequest { part: Some(part) }
}

/// Reads content in chunks.
struct Chunks {
    content: Content,
    offset_bytes: u64,
    /// The open file. `None` before the first read.
    file: Option<tokio::fs::File>,
}

impl Chunks {
    /// Reads the next chunk. It is empty at the end of the content.
    async fn next(&mut self) -> Result<Vec<u8>> {
        let chunk = match &self.content {
            Content::Memory(bytes) => {
                let start = (self.offset_bytes as usize).min(bytes.len());
                let end = start.saturating_add(CHUNK_BYTES).min(bytes.len());
                bytes[start..end].to_vec()
            }
            Content::File(path) => {
                let path = path.clone();
                self.read_file(&path).await.map_err(|source| Error::file("read", &path, source))?
            }
        };
        self.offset_bytes += chunk.len() as u64;
        Ok(chunk)
    }

    async fn read_file(&mut self, path: &Path) -> std::io::Result<Vec<u8>> {
        let file = match &mut self.file {
            Some(file) => file,
            empty => {
                let mut file = tokio::fs::File::open(path).await?;
                file.seek(SeekFrom::Start(self.offset_bytes)).await?;
                empty.insert(file)
            }
        };
        let mut chunk = Vec::with_capacity(CHUNK_BYTES);
        file.take(CHUNK_BYTES as u64).read_to_end(&mut chunk).await?;
        Ok(chunk)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio_stream::StreamExt as _;

    async fn sent(content: Content, offset_bytes: u64) -> (WriteArtifactStart, Vec<Vec<u8>>, Option<Error>) {
        let start = WriteArtifactStart { digest: "sha256-x".into(), size_bytes: 7, offset_bytes };
        let read_error = Arc::new(Mutex::new(None));
        let all: Vec<_> = messages(start, content, Arc::clone(&read_error)).collect().await;
        let mut parts = all.into_iter().map(|message| message.part.unwrap());
        let Some(Part::Start(start)) = parts.next() else { panic!("no start") };
        let chunks = parts
            .map(|part| match part {
                Part::Chunk(chunk) => chunk.to_vec(),
                Part::Start(_) => panic!("two starts"),
            })
            .collect();
        (start, chunks, read_error.lock().unwrap().take())
    }

    #[tokio::test]
    async fn memory_and_files_are_sent_in_chunks_from_the_offset() {
        let bytes: Vec<u8> = (0..CHUNK_BYTES * 2 + 10).map(|i| (i % 251) as u8).collect();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("target.png");
        std::fs::write(&path, &bytes).unwrap();
        for content in [Content::Memory(bytes.clone().into()), Content::File(path)] {
            let (start, chunks, read_error) = sent(content, 5).await;
            assert_eq!(start.offset_bytes, 5);
            assert!(read_error.is_none());
            assert_eq!(chunks.iter().map(Vec::len).collect::<Vec<_>>(), [CHUNK_BYTES, CHUNK_BYTES, 5]);
            assert_eq!(chunks.concat(), bytes[5..]);
        }
    }

    #[tokio::test]
    async fn missing_file_is_reported_as_read_error() {
        let (_, chunks, read_error) = sent(Content::File("/nowhere/target.png".into()), 0).await;
        assert_eq!(chunks.concat(), b"");
        assert!(read_error.unwrap().to_string().contains("/nowhere/target.png"));
    }
}
