//! Kernel files in other formats, made once and kept for later calls.
//!
//! A converted file may have hundreds of megabytes, and take a minute. So it is kept in the data folder and not in memory,
//! and a conversion belongs to no call: all who want the same file wait for the one conversion that makes it, and it goes
//! on when they leave. A device that waits for half a minute only finds the file when it asks again.

use super::conversion_notes;
use super::converted::{ConversionKey, Converted};
use crate::client::Client;
use crate::error::{LimitReason, Result, ServiceError};
use futures::FutureExt as _;
use futures::future::{BoxFuture, Shared};
use lightpath_artifacts::{ArtifactError, Artifacts};
use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Limit on the size of all converted files on disk \[bytes\]: the largest forms of the kernels of an 8K display at three
/// wavelengths, or some hundred dense kernels of 1080p.
const BYTES_MAX: u64 = 4 << 30;
/// Limit on the conversions that run or wait for one client: all forms of two versions. They go on when the client
/// leaves, so that its calls do not count them.
const UNDER_WAY_PER_CLIENT_MAX: usize = 16;
/// Time after which a client with too many conversions may ask for another one.
const RETRY: Duration = Duration::from_secs(10);

/// A conversion that all who want its file wait for. An error is theirs, too, but is not kept: who asks later tries again.
pub(super) type Conversion = Shared<BoxFuture<'static, Result<Converted, Arc<ServiceError>>>>;

/// The converted files on disk, and the conversions under way. Clones share them.
#[derive(Clone, Debug, Default)]
pub(super) struct Conversions(Arc<Shelf>);

#[derive(Debug, Default)]
struct Shelf {
    state: Mutex<State>,
    /// Whoever writes notes holds it.
    notes_turn: Mutex<()>,
}

#[derive(Debug, Default)]
struct State {
    /// The files on disk, the one that was used last at the end.
    kept: VecDeque<(ConversionKey, Converted)>,
    under_way: HashMap<ConversionKey, (Client, Conversion)>,
}

impl Conversions {
    /// The conversions that an earlier process has kept in the data folder. What it did not note is removed. Blocks.
    pub(super) fn open(artifacts: &Artifacts) -> Self {
        let kept = kept_before(artifacts).unwrap_or_else(|error| {
            tracing::warn!(%error, "the converted kernel files of an earlier start cannot be used");
            VecDeque::new()
        });
        let state = Mutex::new(State { kept, under_way: HashMap::new() });
        Self(Arc::new(Shelf { state, notes_turn: Mutex::default() }))
    }

    /// Writes notes about the files on disk, for [`Self::open`]. Calls take turns, so that the latest notes are written
    /// last.
    pub(super) fn write_notes<T>(&self, write: impl FnOnce(&[u8]) -> T) -> T {
        let _turn = self.0.notes_turn.lock().unwrap_or_else(PoisonError::into_inner);
        let notes = conversion_notes::notes(self.lock().kept.iter());
        write(&notes)
    }

    /// The file for a key: the one on disk, or that of the conversion under way. If there is none, `convert` begins for
    /// `client`, as a task of its own. It returns the file after it was noted by [`Self::insert`].
    ///
    /// # Errors
    ///
    /// [`ServiceError::Exhausted`] if `convert` would be one too many of the client.
    pub(super) fn get<F>(&self, key: &ConversionKey, client: &Client, convert: impl FnOnce() -> F) -> Result<Conversion>
    where
        F: Future<Output = Result<Converted>> + Send + 'static,
    {
        // One lock covers all of this, so that no conversion ends between the two searches.
        let mut state = self.lock();
        if let Some(found) = state.find(key) {
            return Ok(std::future::ready(Ok(found)).boxed().shared());
        }
        if let Some((_, conversion)) = state.under_way.get(key) {
            return Ok(conversion.clone());
        }
        if state.under_way.values().filter(|(other, _)| other == client).count() >= UNDER_WAY_PER_CLIENT_MAX {
            let message = format!(
                "{UNDER_WAY_PER_CLIENT_MAX} files that {client} asked for are being made; retry when one of them is ready"
            );
            return Err(ServiceError::Exhausted { reason: LimitReason::TooMuchUnderWay, message, retry_after: RETRY });
        }
        let (conversions, own_key, convert) = (self.clone(), key.clone(), convert());
        let task = tokio::spawn(async move {
            // Made here, and not before: a runtime that shuts down drops the task under the lock of this function.
            let _entry = Entry { conversions, key: own_key };
            convert.await.map_err(Arc::new)
        });
        let conversion = task.map(|ended| ended.unwrap_or_else(|error| Err(Arc::new(ServiceError::Task(error)))));
        let conversion = conversion.boxed().shared();
        state.under_way.insert(key.clone(), (client.clone(), conversion.clone()));
        Ok(conversion)
    }

    /// Notes a file that is now on disk, and returns the digests of files to remove.
    pub(super) fn insert(&self, key: ConversionKey, converted: Converted) -> Vec<String> {
        let kept = &mut self.lock().kept;
        kept.retain(|(other, _)| *other != key);
        kept.push_back((key, converted));
        let mut removed = Vec::new();
        while kept.len() > 1 && kept.iter().map(|(_, file)| file.size_bytes).sum::<u64>() > BYTES_MAX {
            removed.extend(kept.pop_front().map(|(_, file)| file.digest));
        }
        removed.retain(|digest| kept.iter().all(|(_, file)| file.digest != *digest));
        removed
    }

    /// Forgets a file that is no longer on disk.
    pub(super) fn forget(&self, key: &ConversionKey) {
        self.lock().kept.retain(|(other, _)| other != key);
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // The state is consistent even after a panic: nothing between its changes can panic.
        self.0.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// The file for a key, if it is on disk.
    fn find(&mut self, key: &ConversionKey) -> Option<Converted> {
        let index = self.kept.iter().position(|(other, _)| other == key)?;
        // The file used last is the last to be removed.
        let found = self.kept.remove(index)?;
        self.kept.push_back(found.clone());
        Some(found.1)
    }
}

/// The conversions that an earlier process has noted and that are on disk. Removes all others.
fn kept_before(artifacts: &Artifacts) -> Result<VecDeque<(ConversionKey, Converted)>, ArtifactError> {
    let on_disk: HashMap<String, u64> = artifacts.conversions_blocking()?.into_iter().collect();
    let mut kept = conversion_notes::noted(&artifacts.conversion_notes_blocking()?.unwrap_or_default());
    kept.retain(|(_, file)| on_disk.get(&file.digest) == Some(&file.size_bytes));
    for unknown in on_disk.keys().filter(|digest| kept.iter().all(|(_, file)| file.digest != **digest)) {
        artifacts.delete_conversion_blocking(unknown)?;
    }
    Ok(kept.into())
}

/// The entry of a conversion under way. It goes when the conversion has ended, also by a panic.
struct Entry {
    conversions: Conversions,
    key: ConversionKey,
}

impl Drop for Entry {
    fn drop(&mut self) {
        self.conversions.lock().under_way.remove(&self.key);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_domain::reason::PreconditionReason;
    use lightpath_media::kernel_formats::{KernelFormat, Loss};
    use std::sync::atomic::{AtomicUsize, Ordering};
    use tokio::sync::Notify;

    fn file(name: &str, size_bytes: u64) -> (ConversionKey, Converted) {
        let artifact = format!("artifact of {name}");
        let key = ConversionKey { version: name.to_owned(), artifact, format: KernelFormat::Npz };
        (
            key,
            Converted {
                digest: format!("digest of {name}"),
                size_bytes,
                relative_error: 0.0,
                losses: vec![Loss::Precision],
            },
        )
    }

    fn client(name: &str) -> Client {
        Client::Token(name.to_owned())
    }

    /// The file for a key, if it is kept.
    fn find(conversions: &Conversions, key: &ConversionKey) -> Option<Converted> {
        conversions.lock().find(key)
    }

    /// A kernel's conversions in a test: how many began, and what lets them end.
    #[derive(Clone, Default)]
    struct Bench {
        conversions: Conversions,
        begun: Arc<AtomicUsize>,
        go: Arc<Notify>,
    }

    impl Bench {
        /// Asks for a file, whose conversion ends when [`Self::go`] says so.
        fn ask(&self, name: &str, who: &str) -> Result<Conversion> {
            let (key, converted) = file(name, 7);
            let (bench, own) = (self.clone(), key.clone());
            self.conversions.get(&key, &client(who), move || async move {
                bench.begun.fetch_add(1, Ordering::SeqCst);
                bench.go.notified().await;
                bench.conversions.insert(own, converted.clone());
                Ok(converted)
            })
        }

        fn begun(&self) -> usize {
            self.begun.load(Ordering::SeqCst)
        }
    }

    #[tokio::test]
    async fn clients_that_want_the_same_file_share_one_conversion() {
        let bench = Bench::default();
        let waiting: Vec<_> = (0..64).map(|n| tokio::spawn(bench.ask("a", &format!("device-{n}")).unwrap())).collect();
        while bench.begun() == 0 {
            tokio::task::yield_now().await;
        }
        bench.go.notify_one();
        let (key, converted) = file("a", 7);
        for waits in waiting {
            assert_eq!(waits.await.unwrap().unwrap(), converted);
        }
        assert_eq!((bench.begun(), find(&bench.conversions, &key)), (1, Some(converted)));
        bench.ask("a", "device-0").unwrap().await.unwrap();
        assert_eq!(bench.begun(), 1, "the file is kept");
        assert!(bench.conversions.lock().under_way.is_empty());
    }

    #[tokio::test]
    async fn a_conversion_goes_on_when_its_clients_leave() {
        let bench = Bench::default();
        drop(bench.ask("a", "device-0").unwrap());
        while bench.begun() == 0 {
            tokio::task::yield_now().await;
        }
        let late = bench.ask("a", "device-1").unwrap();
        bench.go.notify_one();
        late.await.unwrap();
        assert_eq!(bench.begun(), 1);
    }

    #[tokio::test]
    async fn errors_are_shared_and_not_kept() {
        let (key, converted) = file("a", 7);
        let conversions = Conversions::default();
        let go = Arc::new(Notify::new());
        let no_form = |go: Arc<Notify>| async move {
            go.notified().await;
            let message = "no such form".to_owned();
            Err(ServiceError::Precondition { reason: PreconditionReason::NoSuchForm, message })
        };
        let first = conversions.get(&key, &client("a"), || no_form(Arc::clone(&go))).unwrap();
        let second = conversions.get(&key, &client("b"), std::future::pending).unwrap();
        go.notify_one();
        let errors = [first.await.unwrap_err(), second.await.unwrap_err()];
        assert!(errors.iter().all(|error| error.to_string() == "no such form"), "{errors:?}");
        let failed = conversions.get(&key, &client("a"), || async { panic!("a bug") }).unwrap().await;
        assert!(matches!(failed.as_ref().map_err(|error| &**error), Err(ServiceError::Task(_))), "{failed:?}");
        let found = converted.clone();
        let again = conversions.get(&key, &client("a"), || async { Ok(found) }).unwrap();
        assert_eq!(again.await.unwrap(), converted);
    }

    #[tokio::test]
    async fn one_client_has_few_conversions_under_way() {
        let bench = Bench::default();
        for n in 0..UNDER_WAY_PER_CLIENT_MAX {
            drop(bench.ask(&n.to_string(), "ada").unwrap());
        }
        let refused = bench.ask("one more", "ada");
        assert!(matches!(refused, Err(ServiceError::Exhausted { .. })), "{:?}", refused.map(|_| ()));
        assert!(bench.ask("0", "ada").is_ok(), "it only waits");
        assert!(bench.ask("one more", "bob").is_ok());
    }

    #[test]
    fn the_files_that_were_not_used_for_longest_are_removed() {
        let conversions = Conversions::default();
        let third = BYTES_MAX / 3;
        let [(a, file_a), (b, file_b), (c, file_c), (d, file_d)] = ["a", "b", "c", "d"].map(|name| file(name, third));
        for (key, file) in [(&a, &file_a), (&b, &file_b), (&c, &file_c)] {
            assert!(conversions.insert(key.clone(), file.clone()).is_empty());
        }
        assert_eq!(find(&conversions, &a), Some(file_a.clone()));
        assert_eq!(conversions.insert(d, file_d), [file_b.digest]);
        assert_eq!((find(&conversions, &b), find(&conversions, &a)), (None, Some(file_a.clone())));
        conversions.forget(&a);
        assert_eq!(find(&conversions, &a), None);
        // A file beyond the limit is kept until the next one.
        let (huge, huge_file) = file("huge", BYTES_MAX * 2);
        assert_eq!(conversions.insert(huge.clone(), huge_file.clone()).len(), 2);
        assert_eq!(find(&conversions, &huge), Some(huge_file));
    }

    #[test]
    fn a_file_that_two_keys_share_is_not_removed() {
        let conversions = Conversions::default();
        let (a, same) = file("a", BYTES_MAX / 2);
        let (b, _) = file("b", 0);
        conversions.insert(a, same.clone());
        conversions.insert(b, same);
        let (c, other) = file("c", 10);
        assert!(conversions.insert(c, other).is_empty());
    }
}
