//! Blobs in a bucket of an S3 store. All functions block.
//!
//! ```text
//! PREFIX/lightpath-store                    name of the installation to which the objects belong
//! PREFIX/artifacts/ab/sha256-ab…/ID         a copy of a blob
//! PREFIX/checkpoints/ab/sha256-ab…/ID       a copy of a resumable state
//! ```
//!
//! Each copy has a key of its own, with a random id, and nothing ever changes an object. So a removal of the copies that
//! were listed never removes one that was stored after the list, and a request that is sent again does no harm.
//!
//! A blob of more than 8 MiB is sent in parts, and becomes an object only when the last request, after all parts, has
//! succeeded. The bytes are hashed while they are read for that, and each request carries the SHA-256 of its bytes, which
//! the server compares.
//!
//! # Limits on time
//!
//! A connection must be made within 3 s, and a request must end within 20 s. A request that failed is sent again, up to
//! six times with pauses of up to 1 s, in the first 5 s. So a server that answers with errors is given up after 1 to
//! 4 s, and one that is silent after 20 to 25 s. Then the call fails with [`ArtifactError::Remote`].
//!
//! # Limits on size
//!
//! Of an answer, at most 8 MiB are read, and of the text of an error 4 KiB. A list ends with an error after 1000 copies of
//! one blob, after 200,000 objects in one of the 256 folders of digests (50 million blobs in the bucket), or when it is not
//! complete in time. A copy of more than 78 GiB is not read: S3 takes no more than 10,000 parts.
//!
//! # Layout
//!
//! - `options`: settings. `answers`: bounds on the bytes of answers. `identity`: to whom the objects belong. `inventory`: read access for checks. `catch_up`: files from a time without the remote. `cache`: the bound on local copies. `thread`: threads for requests.

mod answers;
pub(crate) mod cache;
pub(crate) mod catch_up;
#[cfg(test)]
mod hostile_server;
#[cfg(test)]
mod hostile_tests;
mod identity;
pub(crate) mod inventory;
#[cfg(test)]
mod model;
pub(crate) mod options;
#[cfg(test)]
mod s3_tests;
#[cfg(test)]
mod tests;
mod thread;

use crate::digest::{check_digest, name, shard};
use crate::error::{ArtifactError, Result};
use crate::inventory::BlobKind;
use futures::TryStreamExt as _;
use object_store::path::Path;
use object_store::{
    GetOptions, GetRange, MultipartUpload as _, ObjectMeta, ObjectStore, ObjectStoreExt as _, PutMode, PutPayload,
};
use options::RemoteOptions;
use sha2::{Digest as _, Sha256};
use std::collections::HashSet;
use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use thread::RequestThreads;
use uuid::Uuid;

/// Size of the parts in which blobs are sent and received \[bytes\]: S3 wants at least 5 MiB.
const PART_BYTES: usize = 8 << 20;
/// Largest object that is read whole \[bytes\].
const SMALL_BYTES_MAX: u64 = 4096;
/// Largest copy that is read \[bytes\]: S3 takes no more than 10,000 parts of an object.
const COPY_BYTES_MAX: u64 = 10_000 * PART_BYTES as u64;
/// Limit on a list of the copies of one blob. A blob has one, and a few more after damage or removals at the same time.
const COPIES: ListLimit = ListLimit { objects: 1000, time: Duration::from_secs(30) };
/// Limit on a list of the objects whose digests begin with the same byte. They come in pages of 1000.
const SHARD: ListLimit = ListLimit { objects: 200_000, time: Duration::from_secs(600) };
/// Limit on the remembered copies that were damaged, for their memory: about 2 MB.
const DAMAGED_MAX: usize = 10_000;

/// Where a list is given up: a server could send pages without an end, also without any object in them.
#[derive(Clone, Copy, Debug)]
struct ListLimit {
    objects: usize,
    time: Duration,
}

/// A copy of a blob in the remote.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RemoteObject {
    /// Random id of the copy.
    pub id: Uuid,
    /// Size of the copy \[bytes\].
    pub size_bytes: u64,
    /// Time at which the copy was stored, by the clock of the remote \[ms since 1970\].
    pub store_time_ms: i64,
}

#[derive(Debug)]
pub(crate) struct Remote {
    store: Arc<dyn ObjectStore>,
    prefix: Path,
    thread: RequestThreads,
    /// Copies whose bytes did not match their digest when this process read them.
    damaged: Mutex<HashSet<Uuid>>,
    installation: String,
}

impl Remote {
    /// Connects to the remote, checks what its server can do and to whom its objects belong, and stores there what the
    /// data folder holds from a time without it.
    pub(crate) fn open(options: &RemoteOptions, data_dir: &std::path::Path) -> Result<Self> {
        let (store, prefix) = options.connect()?;
        Self::on(Arc::new(store), prefix, data_dir)
    }

    /// Does the same as [`Self::open`] on any object store.
    pub(crate) fn on(store: Arc<dyn ObjectStore>, prefix: Path, data_dir: &std::path::Path) -> Result<Self> {
        let mut remote = Self::unnamed(store, prefix)?;
        remote.installation = identity::agree(&remote, data_dir)?;
        catch_up::run(&remote, data_dir)?;
        Ok(remote)
    }

    /// A remote of which nothing is known yet.
    fn unnamed(store: Arc<dyn ObjectStore>, prefix: Path) -> Result<Self> {
        let (thread, damaged) = (RequestThreads::start()?, Mutex::default());
        Ok(Self { store, prefix, thread, damaged, installation: String::new() })
    }

    /// Name of the installation to which the objects belong.
    pub(crate) fn installation(&self) -> &str {
        &self.installation
    }

    /// The copies of a blob, without those that are known to be damaged.
    pub(crate) fn copies(&self, kind: BlobKind, digest: &str) -> Result<Vec<RemoteObject>> {
        let mut objects = self.objects(kind, digest)?;
        let damaged = self.damaged();
        objects.retain(|object| !damaged.contains(&object.id));
        Ok(objects)
    }

    /// All copies of a blob.
    pub(crate) fn objects(&self, kind: BlobKind, digest: &str) -> Result<Vec<RemoteObject>> {
        let object = |object: ObjectMeta| {
            let id = Uuid::parse_str(object.location.filename()?).ok()?;
            let store_time_ms = object.last_modified.timestamp_millis();
            Some(RemoteObject { id, size_bytes: object.size, store_time_ms })
        };
        self.list(self.folder(kind, digest)?, COPIES, object)
    }

    /// Digests of the blobs whose digest begins with the byte `shard`, in their order.
    pub(crate) fn stored(&self, kind: BlobKind, shard: u8) -> Result<Vec<String>> {
        let digest = |object: ObjectMeta| {
            let digest = object.location.parts().rev().nth(1)?.as_ref().to_owned();
            check_digest(&digest).is_ok().then_some(digest)
        };
        let folder = self.prefix.clone().join(kind.folder()).join(format!("{shard:02x}"));
        let mut digests = self.list(folder, SHARD, digest)?;
        digests.sort_unstable();
        digests.dedup();
        Ok(digests)
    }

    /// Stores another copy of a blob with the bytes of `file`, if they match the digest.
    pub(crate) fn put_anew(&self, kind: BlobKind, digest: &str, file: &mut File) -> Result<()> {
        let path = self.folder(kind, digest)?.join(Uuid::now_v7().to_string());
        let failed = |error| ArtifactError::io("read a file", error);
        let size_bytes = file.metadata().map_err(failed)?.len();
        file.seek(SeekFrom::Start(0)).map_err(failed)?;
        let mut hasher = Sha256::new();
        let mut left_bytes = size_bytes;
        let mut next = || -> Result<PutPayload> {
            let mut part = vec![0; left_bytes.min(PART_BYTES as u64) as usize];
            file.read_exact(&mut part).map_err(failed)?;
            left_bytes -= part.len() as u64;
            hasher.update(&part);
            Ok(part.into())
        };
        let damaged = || ArtifactError::DataLoss { digest: digest.to_owned() };
        if size_bytes <= PART_BYTES as u64 {
            let payload = next()?;
            if name(hasher) != digest {
                return Err(damaged());
            }
            let put = self.put(&path, payload, PutMode::Overwrite);
            return put.map_err(|error| ArtifactError::remote("store a blob", error));
        }
        let parts = size_bytes.div_ceil(PART_BYTES as u64);
        let store = Arc::clone(&self.store);
        let begun = self.thread.wait(async move { store.put_multipart(&path).await });
        let mut upload = begun.map_err(|error| ArtifactError::remote("store a blob", error))?;
        let mut send = || -> Result<()> {
            for _ in 0..parts {
                let sent = self.thread.wait(upload.put_part(next()?));
                sent.map_err(|error| ArtifactError::remote("store a blob", error))?;
            }
            Ok(())
        };
        let sent = send().and_then(|()| if name(hasher) == digest { Ok(()) } else { Err(damaged()) });
        let completed = self.thread.wait(async move {
            let completed = match sent {
                Ok(()) => upload.complete().await.map_err(|error| ArtifactError::remote("store a blob", error)),
                Err(error) => Err(error),
            };
            if completed.is_err() {
                // The first error is reported. Parts that remain belong to no object, and the bucket's rules remove them.
                let _ = upload.abort().await;
            }
            completed
        });
        completed.map(drop)
    }

    /// Reads the copies of a blob until one matches the digest, and returns its size \[bytes\]. `begin` is called with the
    /// size of each copy before its bytes, and `each` with its pieces.
    pub(crate) fn fetch<S>(
        &self,
        kind: BlobKind,
        digest: &str,
        sink: &mut S,
        begin: impl Fn(&mut S, u64) -> Result<()>,
        each: impl Fn(&mut S, &[u8]) -> Result<()>,
    ) -> Result<u64> {
        let mut objects = self.objects(kind, digest)?;
        objects.sort_by_key(|object| self.damaged().contains(&object.id));
        let mut found_damage = false;
        'objects: for object in objects {
            let path = self.folder(kind, digest)?.join(object.id.to_string());
            if object.size_bytes > COPY_BYTES_MAX {
                let problem =
                    format!("the server lists {path} with {} bytes, over {COPY_BYTES_MAX}", object.size_bytes);
                return Err(ArtifactError::remote("read a blob", problem));
            }
            begin(sink, object.size_bytes)?;
            let (mut hasher, mut offset) = (Sha256::new(), 0);
            while offset < object.size_bytes {
                let end = object.size_bytes.min(offset + PART_BYTES as u64);
                match self.get(&path, Some(offset..end), end - offset) {
                    Ok(bytes) => {
                        hasher.update(&bytes);
                        each(sink, &bytes)?;
                    }
                    // Somebody has removed the copy since the list.
                    Err(object_store::Error::NotFound { .. }) => continue 'objects,
                    Err(error) => return Err(ArtifactError::remote("read a blob", error)),
                }
                offset = end;
            }
            if name(hasher) == digest {
                self.damaged().remove(&object.id);
                return Ok(object.size_bytes);
            }
            found_damage = true;
            let mut damaged = self.damaged();
            if damaged.len() >= DAMAGED_MAX {
                damaged.clear();
            }
            damaged.insert(object.id);
        }
        let digest = digest.to_owned();
        Err(if found_damage { ArtifactError::DataLoss { digest } } else { ArtifactError::NotFound { digest } })
    }

    /// Reads the copies of a blob until one matches the digest, and returns its size \[bytes\].
    pub(crate) fn verify(&self, kind: BlobKind, digest: &str) -> Result<u64> {
        self.fetch(kind, digest, &mut (), |(), _| Ok(()), |(), _| Ok(()))
    }

    /// Removes copies of a blob. A missing one is no error.
    pub(crate) fn delete(&self, kind: BlobKind, digest: &str, objects: &[RemoteObject]) -> Result<()> {
        for object in objects {
            let (store, path) = (Arc::clone(&self.store), self.folder(kind, digest)?.join(object.id.to_string()));
            match self.thread.wait(async move { store.delete(&path).await }) {
                Ok(()) | Err(object_store::Error::NotFound { .. }) => {}
                Err(error) => return Err(ArtifactError::remote("remove a blob", error)),
            }
        }
        Ok(())
    }

    fn put(&self, path: &Path, payload: PutPayload, mode: PutMode) -> object_store::Result<()> {
        let (store, path) = (Arc::clone(&self.store), path.clone());
        self.thread.wait(async move { store.put_opts(&path, payload, mode.into()).await.map(|_| ()) })
    }

    /// Reads a small object, such as a name.
    fn get_small(&self, path: &Path) -> object_store::Result<Vec<u8>> {
        self.get(path, None, SMALL_BYTES_MAX)
    }

    /// Reads an object, or a part of it. Stops at more than `bytes_max`, whatever the server sends.
    fn get(&self, path: &Path, range: Option<Range<u64>>, bytes_max: u64) -> object_store::Result<Vec<u8>> {
        let (store, path) = (Arc::clone(&self.store), path.clone());
        self.thread.wait(async move {
            let options = GetOptions::new().with_range(range.map(GetRange::Bounded));
            let mut pieces = store.get_opts(&path, options).await?.into_stream();
            let mut bytes = Vec::new();
            while let Some(piece) = pieces.try_next().await? {
                if (bytes.len() + piece.len()) as u64 > bytes_max {
                    let source = format!("the server sent more than the {bytes_max} bytes of {path}").into();
                    return Err(object_store::Error::Generic { store: "S3", source });
                }
                bytes.extend_from_slice(&piece);
            }
            Ok(bytes)
        })
    }

    /// What `each` returns for the objects below a path.
    fn list<T: Send + 'static>(
        &self,
        below: Path,
        limit: ListLimit,
        each: fn(ObjectMeta) -> Option<T>,
    ) -> Result<Vec<T>> {
        let store = Arc::clone(&self.store);
        self.thread.wait(async move {
            let list = async {
                let (mut listed, mut count) = (Vec::new(), 0);
                let mut objects = store.list(Some(&below));
                while let Some(object) = objects.try_next().await.map_err(list_failed)? {
                    count += 1;
                    if count > limit.objects {
                        let problem = format!("the list of {below} exceeds {} objects", limit.objects);
                        return Err(list_failed(problem));
                    }
                    listed.extend(each(object));
                }
                Ok(listed)
            };
            let late = || list_failed(format!("the list of {below} was not complete after {:?}", limit.time));
            tokio::time::timeout(limit.time, list).await.unwrap_or_else(|_| Err(late()))
        })
    }

    fn folder(&self, kind: BlobKind, digest: &str) -> Result<Path> {
        check_digest(digest)?;
        Ok(self.prefix.clone().join(kind.folder()).join(shard(digest)).join(digest))
    }

    fn damaged(&self) -> MutexGuard<'_, HashSet<Uuid>> {
        // The set is consistent even after a panic: each change of it is a single operation.
        self.damaged.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn list_failed(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> ArtifactError {
    ArtifactError::remote("list objects", error)
}
