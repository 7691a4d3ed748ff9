//! Removal of blobs from a bucket in which other processes may store the same bytes at the same time: the first rule of
//! `lightpath_artifacts`' remote calls. Each step returns what the next one needs, so that no other order compiles.
//!
//! Each saved state has an owner, the job, and its bytes are never stored twice. So those that are left are removed by
//! their age.
//!
//! The copies in data folders leave them like all others that nobody uses.

use super::Result;
use lightpath_artifacts::{Artifacts, BlobKind, RemoteObject};
use lightpath_store::Store;
use serde::Serialize;
use std::collections::HashSet;

/// Rows removed in one step. Other writes can run between two steps.
pub(super) const STEP: u32 = 100;

/// Age at which a blob that nothing refers to is removed \[ms\]: a day. A worker that needed longer to record a saved state
/// lost its lease long ago; an artifact is safe at any age, by the rules.
const UNRECORDED_MS_MAX: i64 = 24 * HOUR_MS;
const HOUR_MS: i64 = 3600 * 1000;

/// Numbers of what was removed or would be removed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Collected {
    /// Number of jobs, which are removed with their events.
    pub jobs: u64,
    /// Number of artifacts. Artifacts to which only the removed jobs referred are removed later: their age starts with
    /// the removal of the jobs.
    pub artifacts: u64,
    /// Size of these artifacts \[bytes\].
    pub artifact_bytes: u64,
}

/// Removes the artifacts that no record refers to and that were last used before `before_ms`, and what is left of
/// removals that did not come to their end.
pub(super) async fn unreferenced_artifacts(store: &Store, artifacts: &Artifacts, before_ms: i64) -> Result<Collected> {
    let (mut collected, mut after) = (Collected::default(), String::new());
    loop {
        let page = store.removals(&after, STEP).await?;
        let Some((last, _)) = page.last() else { break };
        after.clone_from(last);
        for (digest, seen) in page {
            if let Some(marked) = Listed::list(artifacts, digest).await?.take_over(store, &seen).await? {
                marked.delete(artifacts).await?.end(store).await?;
            }
        }
    }
    after.clear();
    loop {
        let page = store.unreferenced_artifacts(before_ms, &after, STEP).await?;
        let Some(last) = page.last() else { return Ok(collected) };
        after.clone_from(&last.digest);
        for record in page {
            if let Some(marked) = Listed::list(artifacts, record.digest).await?.mark(store, before_ms).await? {
                marked.delete(artifacts).await?.end(store).await?;
                collected.artifacts += 1;
                collected.artifact_bytes += record.size_bytes;
            }
        }
    }
}

/// Removes artifacts that no row records, because a process died after it had stored them. Each hour has a share of them.
pub(super) async fn unrecorded_artifacts(store: &Store, artifacts: &Artifacts, now_ms: i64) -> Result<()> {
    for shard in shards(now_ms) {
        let stored = artifacts.stored(BlobKind::Artifact, shard).await?;
        for digest in store.unrecorded(&stored).await? {
            let listed = Listed::list(artifacts, digest).await?;
            if listed.objects.iter().all(|object| is_left(object, now_ms))
                && let Some(marked) = listed.mark_unrecorded(store).await?
            {
                marked.delete(artifacts).await?.end(store).await?;
            }
        }
    }
    Ok(())
}

/// The first bytes of the digests whose turn it is at this hour. Each comes once a day, because lists of a bucket cost money.
fn shards(now_ms: i64) -> impl Iterator<Item = u8> {
    let hour = now_ms / HOUR_MS;
    (0..=u8::MAX).filter(move |shard| i64::from(shard % 24) == hour % 24)
}

/// Whether an object is so old that the process that stored it has recorded it, or never will.
fn is_left(object: &RemoteObject, now_ms: i64) -> bool {
    object.store_time_ms < now_ms - UNRECORDED_MS_MAX
}

/// Removes saved states to which no job refers, because a process died while it replaced them. Each hour has a share of
/// them.
pub(super) async fn unreferenced_checkpoints(store: &Store, artifacts: &Artifacts, now_ms: i64) -> Result<()> {
    let mut stored = Vec::new();
    for shard in shards(now_ms) {
        stored.extend(artifacts.stored(BlobKind::Checkpoint, shard).await?);
    }
    // Read after the list: what was replaced in between is referred to by neither, and is removed by its owner or later.
    let live: HashSet<String> = store.live_checkpoints().await?.into_iter().collect();
    for digest in stored.into_iter().filter(|digest| !live.contains(digest)) {
        let mut objects = artifacts.objects_of(BlobKind::Checkpoint, &digest).await?;
        objects.retain(|object| is_left(object, now_ms));
        artifacts.delete_objects(BlobKind::Checkpoint, &digest, objects).await?;
    }
    Ok(())
}

/// The objects of an artifact before its removal is marked.
#[derive(Debug)]
struct Listed {
    digest: String,
    objects: Vec<RemoteObject>,
}

/// A removal that is marked.
#[derive(Debug)]
struct Marked {
    listed: Listed,
    mark: String,
}

/// A removal whose listed objects are removed.
#[derive(Debug)]
struct Deleted {
    digest: String,
    mark: String,
}

impl Listed {
    async fn list(artifacts: &Artifacts, digest: String) -> Result<Self> {
        Ok(Self { objects: artifacts.objects_of(BlobKind::Artifact, &digest).await?, digest })
    }

    /// Begins the removal; `None` if the artifact is kept.
    async fn mark(self, store: &Store, before_ms: i64) -> Result<Option<Marked>> {
        let mark = store.begin_removal(&self.digest, before_ms).await?;
        Ok(mark.map(|mark| Marked { listed: self, mark }))
    }

    /// Does the same as [`Self::mark`] for objects that no row records.
    async fn mark_unrecorded(self, store: &Store) -> Result<Option<Marked>> {
        let mark = store.begin_removal_of_unrecorded(&self.digest).await?;
        Ok(mark.map(|mark| Marked { listed: self, mark }))
    }

    /// Takes over the removal that had the mark `seen` before the objects were listed; `None` if it no longer has.
    async fn take_over(self, store: &Store, seen: &str) -> Result<Option<Marked>> {
        let mark = store.continue_removal(&self.digest, seen).await?;
        Ok(mark.map(|mark| Marked { listed: self, mark }))
    }
}

impl Marked {
    async fn delete(self, artifacts: &Artifacts) -> Result<Deleted> {
        let Self { listed: Listed { digest, objects }, mark } = self;
        artifacts.delete_objects(BlobKind::Artifact, &digest, objects).await?;
        Ok(Deleted { digest, mark })
    }
}

impl Deleted {
    async fn end(self, store: &Store) -> Result<()> {
        store.end_removal(&self.digest, &self.mark).await?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::database::DATABASE;
    use crate::upkeep::Retention;
    use lightpath_artifacts::{ArtifactError, RemoteOptions, SpaceLimits, digest_of};
    use lightpath_fixtures::{capture_job, display, test_database};
    use lightpath_worker::Clock;
    use std::cell::RefCell;
    use std::time::Duration;
    use tempfile::TempDir;

    /// Artifacts that were last used before this time are removed.
    const BEFORE_MS: i64 = 10_000;

    /// Two processes with data folders of their own that share a bucket and a database.
    struct Pair {
        here: Artifacts,
        there: Artifacts,
        store: Store,
        _folders: [TempDir; 2],
    }

    impl Pair {
        /// `None` without the server of `scripts/s3-for-tests`.
        async fn open(test: &str) -> Option<Self> {
            let endpoint = std::env::var("LIGHTPATH_TEST_S3").ok()?;
            let folders = [TempDir::new().unwrap(), TempDir::new().unwrap()];
            let unique = folders[0].path().file_name().unwrap().to_str().unwrap().trim_start_matches('.').to_owned();
            let options = RemoteOptions {
                url: format!("s3://lightpath-tests/{test}-{unique}"),
                endpoint: Some(endpoint),
                region: "us-east-1".into(),
                access_key_id: "lightpath-tests".into(),
                secret_access_key: "lightpath-tests".into(),
                allow_http: true,
                cache_bytes_max: 1 << 30,
            };
            let open = |folder: &TempDir| Artifacts::open_with(folder.path(), SpaceLimits::default(), Some(&options));
            let [here, there] = [&folders[0], &folders[1]].map(|folder| open(folder).unwrap());
            let store = match test_database().await {
                Some(url) => Store::connect(&url).await.unwrap(),
                None => Store::open(&folders[0].path().join(DATABASE)).await.unwrap(),
            };
            Some(Self { here, there, store, _folders: folders })
        }

        async fn publish(&self, artifacts: &Artifacts, bytes: &[u8], now_ms: i64) {
            let record = async |digest: String, seen: Option<String>| self.record(digest, seen, now_ms).await;
            artifacts.publish(bytes.to_vec(), record).await.unwrap();
        }

        async fn record(&self, digest: String, seen: Option<String>, now_ms: i64) -> Result<Result<(), String>> {
            let recorded = self.store.record_artifact(&digest, 1, "", seen.as_deref(), now_ms).await?;
            Ok(recorded.map(drop))
        }

        /// Checks that the artifact is recorded, and that a process without its file can read it.
        async fn assert_kept(&self, bytes: &[u8], case: impl std::fmt::Debug) {
            let digest = digest_of(bytes);
            assert!(self.store.artifact(&digest).await.unwrap().is_some(), "{case:?}");
            let verified = self.there.verify(BlobKind::Artifact, &digest).await;
            assert_eq!(verified.unwrap(), Some(bytes.len() as u64), "{case:?}");
        }
    }

    /// What a collector does next.
    enum Collector {
        List,
        Mark(Listed),
        Delete(Marked),
        End(Deleted),
        Done,
    }

    async fn step(pair: &Pair, digest: &str, is_recorded: bool, collector: Collector) -> Collector {
        match collector {
            Collector::List => Collector::Mark(Listed::list(&pair.there, digest.to_owned()).await.unwrap()),
            Collector::Mark(listed) => {
                let marked = match is_recorded {
                    true => listed.mark(&pair.store, BEFORE_MS).await,
                    false => listed.mark_unrecorded(&pair.store).await,
                };
                marked.unwrap().map_or(Collector::Done, Collector::Delete)
            }
            Collector::Delete(marked) => Collector::End(marked.delete(&pair.there).await.unwrap()),
            Collector::End(deleted) => {
                deleted.end(&pair.store).await.unwrap();
                Collector::Done
            }
            Collector::Done => Collector::Done,
        }
    }

    /// The numbers of steps that a collector has done when a publisher begins, has stored, has recorded or seen a mark,
    /// and has stored anew: each number from 0 to 4, never falling.
    fn schedules() -> Vec<[usize; 4]> {
        let mut all = Vec::new();
        for n in 0..5_usize.pow(4) {
            let steps = [n % 5, n / 5 % 5, n / 25 % 5, n / 125];
            if steps.is_sorted() {
                all.push(steps);
            }
        }
        all
    }

    /// A collector and a publisher of the same bytes, in every order of their steps.
    #[tokio::test]
    async fn publisher_wins_over_a_collector_at_each_step() {
        let Some(pair) = Pair::open("each-step").await else { return };
        let mut removed = 0;
        for (schedule, is_recorded) in
            schedules().into_iter().flat_map(|schedule| [(schedule, true), (schedule, false)])
        {
            let bytes = format!("{schedule:?} {is_recorded}").into_bytes();
            let digest = digest_of(&bytes);
            match is_recorded {
                true => pair.publish(&pair.there, &bytes, 1).await,
                false => drop(pair.there.put_bytes(bytes.clone()).await.unwrap()),
            }
            let collector = RefCell::new(Some((0, Collector::List)));
            let advance = async |until: usize| {
                let (mut done, mut state) = collector.take().unwrap();
                while done < until {
                    state = step(&pair, &digest, is_recorded, state).await;
                    done += 1;
                }
                collector.replace(Some((done, state)));
            };
            advance(schedule[0]).await;
            let record = async |digest: String, seen: Option<String>| {
                // The publisher has stored, or has stored anew.
                let (before, after) = if seen.is_none() { (1, 2) } else { (3, 3) };
                advance(schedule[before]).await;
                let recorded = pair.record(digest, seen, BEFORE_MS + 1).await;
                advance(schedule[after]).await;
                recorded
            };
            pair.here.publish(bytes.clone(), record).await.unwrap();
            pair.assert_kept(&bytes, schedule).await;
            removed += usize::from(pair.here.objects_of(BlobKind::Artifact, &digest).await.unwrap().len() == 1);
            advance(4).await;
            pair.assert_kept(&bytes, schedule).await;
            assert_eq!(pair.store.removals("", 9).await.unwrap(), [], "{schedule:?}");
        }
        assert!(removed > 0);
    }

    /// The same race with the collection itself, as often as it takes for the steps to mix.
    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn publisher_wins_over_a_collection() {
        let Some(pair) = Pair::open("collection").await else { return };
        let mut collected = 0;
        for round in 0..40_u64 {
            let bytes = format!("round {round}").into_bytes();
            pair.publish(&pair.there, &bytes, 1).await;
            // Each begins first in half of the rounds.
            let wait = async |is_second| {
                let ms = if is_second { 3 * (round / 2) } else { 0 };
                tokio::time::sleep(Duration::from_millis(ms)).await;
            };
            let publish = async {
                wait(round % 2 == 0).await;
                pair.publish(&pair.here, &bytes, BEFORE_MS + 1).await;
            };
            let collect = async {
                wait(round % 2 == 1).await;
                unreferenced_artifacts(&pair.store, &pair.there, BEFORE_MS).await
            };
            let ((), done) = tokio::join!(publish, collect);
            collected += done.unwrap().artifacts;
            pair.assert_kept(&bytes, round).await;
        }
        assert!((1..40).contains(&collected), "{collected} of 40 collections found the artifact unused");
    }

    /// A removal that its collector did not end, because the process died, is ended by the next one.
    #[tokio::test]
    async fn collection_ends_what_another_began() {
        let Some(pair) = Pair::open("ended").await else { return };
        for (bytes, steps) in [(b"marked", 2), (b"delete", 3)] {
            pair.publish(&pair.there, bytes, 1).await;
            let (digest, mut collector) = (digest_of(bytes), Collector::List);
            for _ in 0..steps {
                collector = step(&pair, &digest, true, collector).await;
            }
        }
        let retention = Retention { artifacts: Some(Duration::from_secs(5)), jobs: None };
        retention.collect(&pair.store, &pair.here, BEFORE_MS + 5_000).await.unwrap();
        assert_eq!(pair.store.removals("", 9).await.unwrap(), []);
        for bytes in [b"marked", b"delete"] {
            let verified = pair.here.verify(BlobKind::Artifact, &digest_of(bytes)).await;
            assert!(matches!(verified, Err(ArtifactError::NotFound { .. })), "{verified:?}");
        }
    }

    /// What a process has stored and not yet recorded is kept, and so is what is recorded.
    #[tokio::test]
    async fn what_nothing_refers_to_is_removed_after_a_day() {
        let Some(pair) = Pair::open("checkpoints").await else { return };
        pair.publish(&pair.here, b"phase", 1).await;
        pair.store.create_display(&display("lab"), 1).await.unwrap();
        pair.store.submit(&capture_job("job", &digest_of(b"phase"), 1), 1, 10).await.unwrap();
        let (_, lease) = pair.store.claim(1, i64::MAX / 2, "w").await.unwrap().unwrap();
        let recorded = pair.here.put_checkpoint(b"recorded".to_vec()).await.unwrap();
        pair.store.checkpoint(&lease, &recorded).await.unwrap();
        let left = pair.here.put_checkpoint(b"left".to_vec()).await.unwrap();
        let phase = digest_of(b"phase");
        let artifact = pair.here.put_bytes(b"left".to_vec()).await.unwrap();
        let now_ms = Clock::default().now_ms();
        for (after_ms, is_left) in [(0, true), (UNRECORDED_MS_MAX + HOUR_MS, false)] {
            for hour in 0..24 {
                let now_ms = now_ms + after_ms + hour * HOUR_MS;
                Retention::default().collect(&pair.store, &pair.there, now_ms).await.unwrap();
            }
            let kept = async |kind, digest| !pair.here.objects_of(kind, digest).await.unwrap().is_empty();
            assert!(kept(BlobKind::Checkpoint, &recorded).await, "after {after_ms} ms");
            assert!(kept(BlobKind::Artifact, &phase).await, "after {after_ms} ms");
            assert_eq!(kept(BlobKind::Checkpoint, &left).await, is_left, "after {after_ms} ms");
            assert_eq!(kept(BlobKind::Artifact, &artifact).await, is_left, "after {after_ms} ms");
        }
    }
}
