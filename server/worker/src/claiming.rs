//! The loops that claim jobs: some for jobs of all kinds, and one for those that need a rig at a bench.

use super::computer::computer;
use super::{PAUSE, Worker};
use lightpath_domain::ability::{Abilities, Labels};
use lightpath_domain::job::{Job, Lease};
use lightpath_store::Claimant;
use rayon::ThreadPool;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::sleep;
use tokio_util::sync::CancellationToken;

/// Time between two looks for jobs at benches, while a rig is connected.
const BENCH_INTERVAL: Duration = Duration::from_millis(300);
/// Longest time between two reads of the queue.
const POLL_INTERVAL_MAX: Duration = Duration::from_secs(60);

/// What came of an attempt to claim a job.
enum Claimed {
    Job(Box<Job>, Lease),
    /// There is none; look again after this time.
    Nothing(Duration),
    /// Jobs cannot be claimed at present.
    NotNow,
}

impl Worker {
    /// Claims and runs jobs of all kinds, one after the other.
    pub(super) async fn claim_loop(&self, index: usize, pool: Arc<ThreadPool>, drain: CancellationToken) {
        let name = format!("{}-{index}", self.config.name);
        let abilities = self.config.abilities();
        let claimable = self.store.claimable();
        let changed = || claimable.notified();
        self.claim_until(&name, &pool, &drain, || Some(abilities.clone()), changed).await;
    }

    /// Claims and runs the jobs that need a connected rig, one after the other.
    pub(super) async fn bench_loop(&self, pool: Arc<ThreadPool>, drain: CancellationToken) {
        let name = format!("{}-bench", self.config.name);
        let (own, labels) = (self.config.abilities(), self.rigs.labels());
        let abilities = || {
            let only_for = labels.borrow().clone();
            let labels = Labels::all_of([own.labels.clone(), only_for.clone()]);
            (!only_for.is_empty()).then(|| Abilities { labels, only_for, ..own.clone() })
        };
        // It takes no part in the notifications about new jobs: each wakes one worker, and may be about any job.
        let changed = || {
            let mut labels = self.rigs.labels();
            let has_rigs = !labels.borrow_and_update().is_empty();
            async move {
                tokio::select! {
                    _ = labels.changed() => {}
                    () = sleep(BENCH_INTERVAL), if has_rigs => {}
                }
            }
        };
        self.claim_until(&name, &pool, &drain, abilities, changed).await;
    }

    /// Claims and runs jobs until the end. `abilities` tells what the jobs may need; `None`: nothing can be claimed now.
    /// `changed` waits until that changes.
    async fn claim_until<C: Future<Output = ()>>(
        &self,
        name: &str,
        pool: &Arc<ThreadPool>,
        drain: &CancellationToken,
        abilities: impl Fn() -> Option<Abilities>,
        changed: impl Fn() -> C,
    ) {
        // Lease of a claim whose answer was lost.
        let mut unsure: Option<String> = None;
        while !drain.is_cancelled() {
            let changed = changed();
            let wait = match self.claimed(name, &abilities, &mut unsure).await {
                Claimed::Job(job, lease) => {
                    // More jobs may be ready: wake another idle worker.
                    self.store.claimable().notify_one();
                    self.attempt(*job, lease, pool, drain).await;
                    continue;
                }
                Claimed::Nothing(wait) => wait,
                Claimed::NotNow => {
                    _ = drain.run_until_cancelled(sleep(PAUSE)).await;
                    continue;
                }
            };
            tokio::select! {
                () = changed => {}
                () = sleep(wait) => {}
                () = drain.cancelled() => {}
            }
        }
        if let Some(lease_id) = unsure {
            // Without an answer the lease ends, and the job returns to the queue then.
            drop(self.store.abandon_claim(&lease_id, self.clock.now_ms()).await);
        }
    }

    /// Claims a job, unless the disk is full or the end of an earlier claim is not known.
    async fn claimed(
        &self,
        name: &str,
        abilities: &impl Fn() -> Option<Abilities>,
        unsure: &mut Option<String>,
    ) -> Claimed {
        if self.artifacts.space().room_to_start().is_err() {
            return Claimed::NotNow;
        }
        let now_ms = self.clock.now_ms();
        if let Some(lease_id) = &unsure {
            if self.store.abandon_claim(lease_id, now_ms).await.is_err() {
                return Claimed::NotNow;
            }
            *unsure = None;
        }
        let Some(abilities) = abilities() else { return Claimed::Nothing(POLL_INTERVAL_MAX) };
        let (process, computer) = (self.config.process.clone(), Some(computer().to_owned()));
        let claimant = Claimant { process, abilities, computer, ..Claimant::named(name) };
        match self.store.claim_within(self.config.limits, now_ms, self.lease_ms(), &claimant).await {
            Ok(Some((job, lease))) => Claimed::Job(Box::new(job), lease),
            Ok(None) => Claimed::Nothing(self.until_next_job(now_ms, &claimant.abilities).await),
            Err(error) => {
                tracing::error!(error = &error as &dyn std::error::Error, "no job could be claimed");
                *unsure = Some(claimant.lease_id);
                Claimed::NotNow
            }
        }
    }

    /// Time until a job becomes due that was not yet due when the last claim found none.
    async fn until_next_job(&self, claimed_ms: i64, abilities: &Abilities) -> Duration {
        match self.store.next_run_time(claimed_ms, abilities).await {
            Ok(Some(due_ms)) => {
                let wait_ms = due_ms.saturating_sub(self.clock.now_ms()).max(1).unsigned_abs();
                Duration::from_millis(wait_ms).min(POLL_INTERVAL_MAX)
            }
            Ok(None) => POLL_INTERVAL_MAX,
            Err(error) => {
                tracing::error!(error = &error as &dyn std::error::Error, "the queue could not be read");
                PAUSE
            }
        }
    }
}
