//! When waiting jobs start, and what is before them: the queue is played forward by its own rules and the estimated times
//! of its jobs.

use super::ahead::{Ahead, QueuedJob};
use super::leases::ClaimLimits;
use super::living::Process;
use lightpath_domain::ability::counted_memory;
use std::collections::{HashMap, VecDeque};
use std::sync::Arc;

/// A job that has run longer than its estimate is expected to take this part of its time more.
const OVERRUN: f64 = 0.1;

/// The place of a job that waits for its turn.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Number of waiting jobs that start before it.
    pub jobs_before: u32,
    /// Those of them that belong to other owners.
    pub others_before: u32,
    /// The running job whose worker it gets, maybe after the jobs before it; `None`: it starts at once.
    pub behind: Option<Arc<QueuedJob>>,
    /// When it starts \[ms since 1970\]; `None`: a job before it has no estimate.
    pub start_ms: Option<i64>,
    /// Earliest time at which it may start \[ms since 1970\].
    pub due_ms: i64,
}

/// A worker as the forecast sees it.
struct Slot<'a> {
    process: &'a Process,
    /// When it can start the next job \[ms since 1970\]; infinite: unknown.
    free_ms: f64,
    /// Owner and display of the job that it runs until then.
    runs: Option<(&'a str, &'a str)>,
    /// The job that it runs now.
    behind: Option<Arc<QueuedJob>>,
}

/// The places of the jobs that can start, by their ids. Jobs of paused displays have none, nor have those that no
/// process can run.
#[must_use]
pub fn forecast(ahead: &Ahead, processes: &[Process], limits: ClaimLimits, now_ms: i64) -> HashMap<String, Place> {
    let mut slots = slots(ahead, processes, now_ms as f64);
    let mut lanes = lanes(ahead);
    let mut last_starts: HashMap<&str, f64> =
        ahead.last_starts_ms.iter().map(|(owner, &ms)| (owner.as_str(), ms as f64)).collect();
    let mut places: HashMap<String, Place> = HashMap::new();
    let mut started_of: HashMap<&str, u32> = HashMap::new();
    while let Some(s) = earliest(&slots) {
        let at_ms = slots[s].free_ms;
        slots[s].runs = None;
        let Some(job) = next(&lanes, &slots, s, limits, &last_starts).and_then(|lane| lanes[lane].pop_front()) else {
            match later(&lanes, &slots, s, limits) {
                Some(later_ms) => slots[s].free_ms = later_ms,
                None => drop(slots.swap_remove(s)),
            }
            continue;
        };
        lanes.retain(|lane| !lane.is_empty());
        let (jobs_before, of_owner) = (places.len() as u32, started_of.entry(&job.owner).or_default());
        let start_ms = at_ms.is_finite().then_some(at_ms as i64);
        let behind = slots[s].behind.clone();
        let others_before = jobs_before - *of_owner;
        places.insert(job.id.clone(), Place { jobs_before, others_before, behind, start_ms, due_ms: job.run_time_ms });
        *of_owner += 1;
        last_starts.insert(&job.owner, at_ms);
        slots[s].runs = Some((&job.owner, &job.display));
        slots[s].free_ms = if job.estimated_ms > 0 { at_ms + job.estimated_ms as f64 } else { f64::INFINITY };
    }
    places
}

/// The waiting jobs that are not paused, by lane. A claim sees no difference between those of a lane, so only the first of each
/// may be next.
fn lanes(ahead: &Ahead) -> Vec<VecDeque<&QueuedJob>> {
    let lane = |job: &QueuedJob| (job.priority, counted_memory(job.memory_bytes));
    let same = |a: &QueuedJob, b: &QueuedJob| {
        lane(a) == lane(b) && a.owner == b.owner && a.display == b.display && a.needs == b.needs
    };
    let is_paused = |display: &str| ahead.paused.contains_key("") || ahead.paused.contains_key(display);
    let lanes = ahead.waiting.chunk_by(same).filter(|lane| lane.first().is_some_and(|job| !is_paused(&job.display)));
    lanes.map(|lane| lane.iter().collect()).collect()
}

/// The workers of all processes, with what they run.
fn slots<'a>(ahead: &'a Ahead, processes: &'a [Process], now_ms: f64) -> Vec<Slot<'a>> {
    let mut slots = Vec::new();
    for process in processes.iter().filter(|process| process.works()) {
        // A process that works alone has no name in the rows of its jobs.
        let runs_here = |job: &&QueuedJob| job.process.as_ref().is_none_or(|id| *id == process.id);
        let mut running = ahead.running.iter().filter(runs_here);
        for _ in 0..process.workers {
            let job = running.next();
            slots.push(Slot {
                process,
                free_ms: job.map_or(now_ms, |job| now_ms + left_ms(job, now_ms)),
                runs: job.map(|job| (job.owner.as_str(), job.display.as_str())),
                behind: job.map(|job| Arc::new(job.clone())),
            });
        }
    }
    slots
}

/// Time that a running job still needs \[ms\]; infinite: unknown.
fn left_ms(job: &QueuedJob, now_ms: f64) -> f64 {
    if let Some(eta_s) = job.progress.as_ref().and_then(|progress| progress.eta_s) {
        return 1e3 * eta_s;
    }
    let elapsed_ms = job.start_time_ms.map_or(0.0, |start_ms| (now_ms - start_ms as f64).max(0.0));
    match job.estimated_ms {
        0 => f64::INFINITY,
        estimated_ms => (estimated_ms as f64 - elapsed_ms).max(OVERRUN * elapsed_ms),
    }
}

/// The worker that is free first.
fn earliest(slots: &[Slot<'_>]) -> Option<usize> {
    (0..slots.len()).min_by(|&a, &b| slots[a].free_ms.total_cmp(&slots[b].free_ms))
}

/// Number of jobs that run when the worker `slots[s]` is free, for whose owner and display `is_counted` says so.
fn running(slots: &[Slot<'_>], s: usize, is_counted: impl Fn(&str, &str) -> bool) -> u32 {
    let others = slots.iter().enumerate().filter(|&(other, _)| other != s).map(|(_, slot)| slot);
    let still = others.filter(|slot| slot.free_ms > slots[s].free_ms || slot.free_ms.is_infinite());
    still.filter_map(|slot| slot.runs).filter(|(owner, display)| is_counted(owner, display)).count() as u32
}

/// Whether the worker `slots[s]` may run a job.
fn is_able(job: &QueuedJob, slot: &Slot<'_>) -> bool {
    slot.process.abilities.labels.contain(&job.needs) && slot.process.abilities.give(job.memory_bytes)
}

/// Whether the limits on running jobs let a job start when the worker `slots[s]` is free.
fn is_open(job: &QueuedJob, slots: &[Slot<'_>], s: usize, limits: ClaimLimits) -> bool {
    let below = |limit: u32, count: u32| limit == 0 || count < limit;
    below(limits.per_owner, running(slots, s, |owner, _| owner == job.owner))
        && below(limits.per_display, running(slots, s, |_, display| display == job.display))
}

/// The lane whose first job a claim gives to the worker `slots[s]` when it is free: see `Store::claim`.
fn next(
    lanes: &[VecDeque<&QueuedJob>],
    slots: &[Slot<'_>],
    s: usize,
    limits: ClaimLimits,
    last_starts: &HashMap<&str, f64>,
) -> Option<usize> {
    let heads = lanes.iter().enumerate().filter_map(|(lane, jobs)| Some((lane, *jobs.front()?)));
    let startable = heads.filter(|(_, job)| {
        job.run_time_ms as f64 <= slots[s].free_ms && is_able(job, &slots[s]) && is_open(job, slots, s, limits)
    });
    let ranked = startable.map(|(lane, job)| {
        let last_start = last_starts.get(job.owner.as_str()).copied().unwrap_or(f64::NEG_INFINITY);
        (lane, job, running(slots, s, |owner, _| owner == job.owner), last_start)
    });
    let order = |(_, a, a_running, a_start): &(usize, &QueuedJob, u32, f64),
                 (_, b, b_running, b_start): &(usize, &QueuedJob, u32, f64)| {
        let owners = (a.priority, a_running).cmp(&(b.priority, b_running)).then(a_start.total_cmp(b_start));
        owners.then_with(|| (a.run_time_ms, &a.id).cmp(&(b.run_time_ms, &b.id)))
    };
    ranked.min_by(order).map(|(lane, ..)| lane)
}

/// When a worker that finds no job looks again \[ms since 1970\]: when a job becomes due, or when another worker has
/// ended one. `None`: it can run none of the jobs.
fn later(lanes: &[VecDeque<&QueuedJob>], slots: &[Slot<'_>], s: usize, limits: ClaimLimits) -> Option<f64> {
    let free_ms = slots[s].free_ms;
    let end_ms = slots.iter().map(|slot| slot.free_ms).filter(|&end_ms| end_ms > free_ms).min_by(f64::total_cmp);
    let able = lanes.iter().filter_map(VecDeque::front).filter(|job| is_able(job, &slots[s]));
    let looks = able.filter_map(|job| match is_open(job, slots, s, limits) {
        true => Some(job.run_time_ms as f64).filter(|&due_ms| due_ms > free_ms),
        false => end_ms,
    });
    looks.min_by(f64::total_cmp)
}
