//! Random histories of one job, compared with a model of its state, attempts, failures and lease.

use super::*;
use lightpath_domain::job::{JobState, Lease};
use proptest::prelude::*;

#[derive(Clone, Copy, Debug)]
enum Step {
    Claim,
    Heartbeat,
    Checkpoint,
    Finish,
    FailRetryably,
    FailPermanently,
    Release,
    Expire,
    Cancel,
    Retry,
    Wait(i64),
}

/// Model of the job.
#[derive(Debug)]
struct Model {
    state: JobState,
    attempt: u32,
    failures: u32,
    cancel_requested: bool,
    until_ms: i64,
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    let step = prop_oneof![
        4 => Just(Step::Claim),
        2 => Just(Step::Heartbeat),
        1 => Just(Step::Checkpoint),
        1 => Just(Step::Finish),
        3 => Just(Step::FailRetryably),
        1 => Just(Step::FailPermanently),
        1 => Just(Step::Release),
        2 => Just(Step::Expire),
        1 => Just(Step::Cancel),
        2 => Just(Step::Retry),
        3 => (1..=2 * LEASE_MS).prop_map(Step::Wait),
    ];
    prop::collection::vec(step, 1..40)
}

impl Model {
    fn lease_has_ended(&self, now_ms: i64) -> bool {
        self.state == JobState::Running && now_ms >= self.until_ms
    }

    fn fail(&mut self, retry: bool) {
        self.state = match (self.cancel_requested, retry && self.failures + 1 < 3) {
            (true, _) => JobState::Cancelled,
            (false, true) => JobState::Queued,
            (false, false) => JobState::Failed,
        };
        if !self.cancel_requested {
            self.failures += 1;
        }
    }

    fn end(&mut self, state: JobState) {
        self.state = if self.cancel_requested { JobState::Cancelled } else { state };
    }
}

/// Applies one step to the store and the model. `lease` is the latest lease that the store gave.
async fn apply(step: Step, store: &Store, id: &str, model: &mut Model, lease: &mut Option<Lease>, now: &mut i64) {
    match step {
        Step::Claim => {
            let claimed = store.claim(*now, LEASE_MS, "w").await.unwrap();
            assert_eq!(claimed.is_some(), model.state == JobState::Queued);
            if let Some((_, given)) = claimed {
                *lease = Some(given);
                model.state = JobState::Running;
                model.attempt += 1;
                model.until_ms = *now + LEASE_MS;
            }
        }
        Step::Heartbeat
        | Step::Checkpoint
        | Step::Finish
        | Step::FailRetryably
        | Step::FailPermanently
        | Step::Release => {
            let no_lease = Lease { job: id.to_owned(), attempt: 0, lease_id: String::new(), until_ms: 0 };
            let is_valid = model.state == JobState::Running;
            let allowed = apply_worker_step(step, store, lease.as_ref().unwrap_or(&no_lease), model, *now).await;
            assert_eq!(allowed, is_valid, "a write succeeds only under a valid lease");
        }
        Step::Expire => {
            let expired = store.expire_leases(*now).await.unwrap();
            assert_eq!(expired.len(), usize::from(model.lease_has_ended(*now)));
            if !expired.is_empty() {
                model.fail(true);
            }
        }
        Step::Cancel => {
            let cancelled = store.cancel(id, *now).await.is_ok();
            assert_eq!(cancelled, !model.state.has_ended());
            match model.state {
                JobState::Queued => (model.state, model.cancel_requested) = (JobState::Cancelled, true),
                JobState::Running => model.cancel_requested = true,
                _ => {}
            }
        }
        Step::Retry => {
            let retried = store.retry(id, *now).await.is_ok();
            assert_eq!(retried, matches!(model.state, JobState::Failed | JobState::Cancelled));
            if retried {
                (model.state, model.failures, model.cancel_requested) = (JobState::Queued, 0, false);
            }
        }
        Step::Wait(ms) => *now += ms,
    }
}

/// Applies one step of a worker to the store and the model. Returns whether the store allowed it.
async fn apply_worker_step(step: Step, store: &Store, lease: &Lease, model: &mut Model, now: i64) -> bool {
    let is_valid = model.state == JobState::Running;
    let allowed = match step {
        Step::Heartbeat => store.heartbeat(lease, now, LEASE_MS).await.is_ok(),
        Step::Checkpoint => store.checkpoint(lease, &digest(now as u32)).await.is_ok(),
        Step::Finish => store.finish(lease, result(), JobEffect::None, now).await.is_ok(),
        Step::FailRetryably => store.fail(lease, io_error(), Some(now), now).await.is_ok(),
        Step::FailPermanently => store.fail(lease, io_error(), None, now).await.is_ok(),
        Step::Release => store.release(lease, now).await.is_ok(),
        Step::Claim | Step::Expire | Step::Cancel | Step::Retry | Step::Wait(_) => {
            unreachable!("{step:?} is not a step of a worker")
        }
    };
    match step {
        _ if !is_valid => {}
        Step::Heartbeat => model.until_ms = now + LEASE_MS,
        Step::Checkpoint => model.failures = 0,
        Step::Finish => model.state = JobState::Succeeded,
        Step::FailRetryably => model.fail(true),
        Step::FailPermanently => model.fail(false),
        Step::Release => model.end(JobState::Queued),
        Step::Claim | Step::Expire | Step::Cancel | Step::Retry | Step::Wait(_) => {}
    }
    allowed
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn single_job_agrees_with_its_model(steps in steps()) {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async {
            let (store, _folder) = store().await;
            let id = submit(&store, "r", 1).await;
            let mut model =
                Model { state: JobState::Queued, attempt: 0, failures: 0, cancel_requested: false, until_ms: 0 };
            let (mut lease, mut now) = (None, 1);
            for step in steps {
                apply(step, &store, &id, &mut model, &mut lease, &mut now).await;
                let job = store.job(&id).await.unwrap();
                assert_eq!((job.state, job.attempt), (model.state, model.attempt), "after {step:?}");
            }
            store.close().await;
        });
    }
}
