//! Commands to a queue, for random histories.

use super::*;

/// A command to the queue. Jobs are chosen by a number modulo the number of jobs.
#[derive(Clone, Debug)]
pub(super) enum Command {
    Submit(Submission),
    Claim { per_owner: u32, per_display: u32, labels: usize, memory: usize },
    Heartbeat { job: usize, stale: bool },
    Checkpoint { job: usize, stale: bool },
    Finish { job: usize, stale: bool },
    Fail { job: usize, stale: bool, retry_in_ms: Option<i64> },
    Postpone { job: usize, stale: bool },
    Release { job: usize, stale: bool },
    EndCancelled { job: usize, stale: bool },
    Expire,
    ServerDies,
    ProcessDies { job: usize, stale: bool },
    ServerStops,
    Cancel { job: usize },
    Retry { job: usize },
    Pause { display: Option<usize> },
    Resume { display: Option<usize> },
    ShiftClock { by_ms: i64 },
    Forget,
    Wait { ms: i64 },
}

/// A job to submit.
#[derive(Clone, Debug)]
pub(super) struct Submission {
    pub(super) owner: usize,
    pub(super) display: usize,
    pub(super) priority: i32,
    pub(super) delay_ms: i64,
    /// Numbers of the jobs that must succeed before this one runs.
    pub(super) after: Vec<usize>,
    /// Unique key of the job.
    pub(super) key: Option<usize>,
    /// Numbers of its set of needs, and of its memory.
    pub(super) needs: usize,
    pub(super) memory: usize,
}

/// The number of one of four choices, the first half of the time.
fn mostly_first() -> impl Strategy<Value = usize> {
    prop_oneof![1 => Just(0), 1 => 1..4_usize]
}

pub(super) fn command() -> impl Strategy<Value = Command> {
    let job = || 0..64_usize;
    let lease = || (job(), prop::bool::weighted(0.2));
    let after = prop::collection::vec(job(), 0..3);
    let submit = (0..3_usize, 0..2_usize, -1..=1, prop_oneof![3 => Just(0), 1 => 1..=2 * LEASE_MS], after)
        .prop_flat_map(|given| (Just(given), prop::option::weighted(0.2, 0..2_usize), mostly_first(), mostly_first()));
    let display = || prop::option::of(0..2_usize);
    prop_oneof![
        6 => submit.prop_map(|((owner, display, priority, delay_ms, after), key, needs, memory)| {
            let after = if after.len() == 2 { after } else { Vec::new() };
            Command::Submit(Submission { owner, display, priority, delay_ms, after, key, needs, memory })
        }),
        8 => (0..3_u32, 0..3_u32, 0..LABELS.len(), mostly_first()).prop_map(|(per_owner, per_display, labels, memory)| {
            Command::Claim { per_owner, per_display, labels, memory }
        }),
        3 => lease().prop_map(|(job, stale)| Command::Heartbeat { job, stale }),
        2 => lease().prop_map(|(job, stale)| Command::Checkpoint { job, stale }),
        5 => lease().prop_map(|(job, stale)| Command::Finish { job, stale }),
        3 => (lease(), prop::option::weighted(0.7, 0..LEASE_MS))
            .prop_map(|((job, stale), retry_in_ms)| Command::Fail { job, stale, retry_in_ms }),
        1 => lease().prop_map(|(job, stale)| Command::Postpone { job, stale }),
        1 => lease().prop_map(|(job, stale)| Command::Release { job, stale }),
        1 => lease().prop_map(|(job, stale)| Command::EndCancelled { job, stale }),
        2 => Just(Command::Expire),
        1 => Just(Command::ServerDies),
        2 => lease().prop_map(|(job, stale)| Command::ProcessDies { job, stale }),
        1 => Just(Command::ServerStops),
        2 => job().prop_map(|job| Command::Cancel { job }),
        3 => job().prop_map(|job| Command::Retry { job }),
        1 => display().prop_map(|display| Command::Pause { display }),
        2 => display().prop_map(|display| Command::Resume { display }),
        1 => (-LEASE_MS..LEASE_MS).prop_map(|by_ms| Command::ShiftClock { by_ms }),
        1 => Just(Command::Forget),
        4 => (1..LEASE_MS).prop_map(|ms| Command::Wait { ms }),
    ]
}
