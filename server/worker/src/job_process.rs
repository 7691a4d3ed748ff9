//! A process of its own for one job.
//!
//! When a server dies, nobody knows which of its running jobs caused that, or whether one did: the system kills
//! processes, too. So the death counts for none of them. Each runs in a process of its own from then on, and only the
//! death of that process counts: nothing else ran in it.
//!
//! ```text
//!  worker                                     process of the job
//!  starts it, writes settings and lease ────> stdin    runs the attempt and stores its end itself
//!  writes "drain" when the server stops ────> stdin    saves its state; the end of the pipe: the worker has died
//!  announces what the other one changes <──── stdout   "started", then changes of the store
//!  logs; the last lines say why it died <──── stderr
//!  looks at its memory and at how it ends
//! ```

use super::stop::{StopFlag, StopReason};
use super::{Worker, WorkerError};
use lightpath_domain::job::Lease;
use lightpath_store::{PassedOn, Store};
use rustix::process::{Resource, Rlimit, setrlimit};
use std::collections::VecDeque;
use std::ffi::OsString;
use std::io::{self, Write as _};
use std::os::unix::process::ExitStatusExt as _;
use std::path::PathBuf;
use std::pin::pin;
use std::process::{ExitStatus, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::io::{AsyncBufReadExt as _, AsyncRead, AsyncWriteExt as _, BufReader, Split};
use tokio::process::{Child, ChildStdin, Command};
use tokio::time::{interval, timeout};
use tokio_util::sync::CancellationToken;

/// What the process writes when it is about to run the job. If it dies before, the job did not cause that.
const STARTED: &str = "started";
/// What the worker writes when the server stops.
const DRAIN: &str = "drain";
/// Interval between two looks at the memory of the process, and at the stop flag.
const LOOK_INTERVAL: Duration = Duration::from_millis(50);
/// Lines of the log that are kept to tell why the process died.
const LINES_MAX: usize = 5;
/// Length of a line of the log, after which the rest is left out \[characters\].
const LINE_MAX: usize = 300;
/// Longest wait for the rest of the log of a dead process: a process that it started may hold the pipe open.
const LOG_WAIT_MAX: Duration = Duration::from_secs(1);
/// Memory beside that of the job: the program, the database's pages, the stacks of the threads \[bytes\].
const OWN_BYTES: u64 = 512 << 20;

/// The program that runs one job. It calls [`JobInput::read`] and [`JobInput::run`].
#[derive(Clone, Debug)]
pub struct JobProgram {
    /// File of the program.
    pub file: PathBuf,
    /// Its arguments.
    pub arguments: Vec<OsString>,
    /// What it needs to know besides the lease, in one line. It may be secret: other users cannot see it.
    pub settings: String,
}

/// How the process of a job ended.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum End {
    /// It has stored the end of the attempt.
    Stored,
    /// It was stopped because of the stop flag, and has stored nothing.
    Stopped,
    /// The job did not begin, or was killed for the needs of others, for this reason.
    NotStarted(String),
    /// It died: how, what it held, and the end of its log.
    Died(String),
}

impl JobProgram {
    /// Runs the attempt with this lease in a process of its own, until it ends or the flag stops it.
    /// `estimated_bytes` is the memory that the job may need; 0: nobody knows.
    pub(super) async fn run(&self, store: &Store, lease: &Lease, estimated_bytes: u64, stop: &StopFlag) -> End {
        let end = match self.start(lease).await {
            Ok((child, stdin)) => Running::of(child, stdin, estimated_bytes).watch(store, lease, stop).await,
            Err(error) => End::NotStarted(format!("the process of the job could not be started: {error}")),
        };
        // It may have died between a change and its announcement.
        store.announce_job(&lease.job);
        end
    }

    async fn start(&self, lease: &Lease) -> io::Result<(Child, ChildStdin)> {
        let mut command = Command::new(&self.file);
        command.args(&self.arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        // Signals of a terminal are for the server, which tells its processes when it stops.
        let mut child = command.process_group(0).kill_on_drop(true).spawn()?;
        let mut stdin = child.stdin.take().ok_or_else(|| io::Error::other("it has no input"))?;
        let lease = serde_json::to_string(lease).map_err(io::Error::other)?;
        stdin.write_all(format!("{}\n{lease}\n", self.settings).as_bytes()).await?;
        Ok((child, stdin))
    }
}

/// A process that runs a job, and what is known of it.
struct Running {
    child: Child,
    stdin: ChildStdin,
    began: Instant,
    has_started: bool,
    is_draining: bool,
    estimated_bytes: u64,
    memory_bytes: Option<u64>,
    last_lines: VecDeque<String>,
}

impl Running {
    fn of(child: Child, stdin: ChildStdin, estimated_bytes: u64) -> Self {
        Self {
            child,
            stdin,
            began: Instant::now(),
            has_started: false,
            is_draining: false,
            estimated_bytes,
            memory_bytes: None,
            last_lines: VecDeque::new(),
        }
    }

    async fn watch(mut self, store: &Store, lease: &Lease, stop: &StopFlag) -> End {
        let (mut said, mut logged) = (lines(self.child.stdout.take()), lines(self.child.stderr.take()));
        let mut looks = interval(LOOK_INTERVAL);
        let ended = loop {
            tokio::select! {
                ended = self.child.wait() => break ended,
                Some(line) = said.next() => self.hear(store, &line),
                Some(line) = logged.next() => self.log(lease, &line),
                _ = looks.tick() => {
                    self.memory_bytes = self.child.id().and_then(peak_memory_bytes).or(self.memory_bytes);
                    match stop.reason() {
                        None => {}
                        Some(StopReason::Drain) => self.drain().await,
                        // It may store the end of the attempt just before. Then the store tells so.
                        Some(_) => drop(self.child.start_kill()),
                    }
                }
            }
        };
        let rest = async {
            while let Some(line) = said.next().await {
                self.hear(store, &line);
            }
            while let Some(line) = logged.next().await {
                self.log(lease, &line);
            }
        };
        drop(timeout(LOG_WAIT_MAX, rest).await);
        match ended {
            Ok(status) if status.success() => End::Stored,
            // Whoever stops the server may kill all of its processes.
            _ if stop.reason().is_some() => End::Stopped,
            Ok(status) if self.has_started && !self.is_victim(status) => End::Died(self.death(status)),
            Ok(status) => End::NotStarted(format!("the process of the job {}", self.death(status))),
            Err(error) => End::NotStarted(format!("the process of the job could not be watched: {error}")),
        }
    }

    /// Whether the process was killed although it took no more memory than was expected: by a person, or because others
    /// took the memory of the machine.
    fn is_victim(&self, status: ExitStatus) -> bool {
        const SIGKILL: i32 = 9;
        let is_modest = self.memory_bytes.is_some_and(|bytes| bytes <= self.estimated_bytes);
        status.signal() == Some(SIGKILL) && is_modest
    }

    fn hear(&mut self, store: &Store, line: &str) {
        if line == STARTED {
            self.has_started = true;
        } else if let Err(error) = store.hear(line) {
            tracing::warn!(
                error = &error as &dyn std::error::Error,
                "the process of a job said what nobody understands"
            );
        }
    }

    fn log(&mut self, lease: &Lease, line: &str) {
        let line: String = line.chars().take(LINE_MAX).collect();
        match line.split_whitespace().find(|word| ["ERROR", "WARN", "INFO"].contains(word)) {
            Some("INFO") => tracing::info!(job = lease.job, "its process: {line}"),
            Some("WARN") => tracing::warn!(job = lease.job, "its process: {line}"),
            // Also what the program says without a level when it dies.
            _ => tracing::error!(job = lease.job, "its process: {line}"),
        }
        self.last_lines.push_back(line);
        if self.last_lines.len() > LINES_MAX {
            self.last_lines.pop_front();
        }
    }

    async fn drain(&mut self) {
        if !self.is_draining {
            self.is_draining = true;
            // If it cannot be told, it has ended.
            drop(self.stdin.write_all(format!("{DRAIN}\n").as_bytes()).await);
        }
    }

    /// How the process died, for people.
    fn death(&self, status: ExitStatus) -> String {
        let how = match (status.signal(), status.code()) {
            (Some(signal), _) => format!("was killed by signal {signal}{}", meaning(signal)),
            (None, Some(code)) => format!("ended with status {code}"),
            (None, None) => "ended".to_owned(),
        };
        let memory = match self.memory_bytes {
            Some(bytes) => format!(" and held up to {} MiB of memory", bytes >> 20),
            None => String::new(),
        };
        let log = match self.last_lines.is_empty() {
            true => String::new(),
            false => format!("; the end of its log: {}", Vec::from(self.last_lines.clone()).join(" | ")),
        };
        format!("{how} after {:.1} s{memory}{log}", self.began.elapsed().as_secs_f64())
    }
}

/// What a signal means, for people.
fn meaning(signal: i32) -> &'static str {
    match signal {
        4 => " (SIGILL: an instruction that the processor does not have)",
        6 => " (SIGABRT: it gave up, for example because it got no more memory)",
        7 => " (SIGBUS: a file or memory that is not there)",
        9 => " (SIGKILL: by a person, or by the system because memory ran out)",
        11 => " (SIGSEGV: memory that is not its own, or too deep a recursion)",
        _ => "",
    }
}

/// Lines of a pipe.
struct Lines<R>(Option<Split<BufReader<R>>>);

fn lines<R: AsyncRead + Unpin>(pipe: Option<R>) -> Lines<R> {
    Lines(pipe.map(|pipe| BufReader::new(pipe).split(b'\n')))
}

impl<R: AsyncRead + Unpin> Lines<R> {
    /// The next line; `None` at the end of the pipe. Nothing is lost if the future is dropped.
    async fn next(&mut self) -> Option<String> {
        match self.0.as_mut()?.next_segment().await {
            Ok(Some(line)) => Some(String::from_utf8_lossy(&line).into_owned()),
            Ok(None) | Err(_) => {
                self.0 = None;
                None
            }
        }
    }
}

/// Peak of the memory of a process \[bytes\]; `None` where the system does not say it.
fn peak_memory_bytes(process: u32) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib << 10)
}

/// What the process of a job gets from the worker that started it.
#[derive(Debug)]
pub struct JobInput {
    /// The settings of [`JobProgram`].
    pub settings: String,
    lease: Lease,
}

impl JobInput {
    /// Reads the input.
    ///
    /// # Errors
    ///
    /// An error if it is none that a worker writes.
    pub fn read() -> io::Result<Self> {
        let mut lines = io::stdin().lines();
        let mut next = || lines.next().unwrap_or_else(|| Err(io::ErrorKind::UnexpectedEof.into()));
        let (settings, lease) = (next()?, next()?);
        Ok(Self { settings, lease: serde_json::from_str(&lease)? })
    }

    /// Runs the job with `worker`, which stores the end of the attempt. If the process that started this one dies, this
    /// returns at once: a later server gives the job to another process.
    ///
    /// # Errors
    ///
    /// [`WorkerError`] if the job cannot begin.
    pub async fn run(self, worker: Worker) -> Result<(), WorkerError> {
        let (drain, orphaned) = listen().map_err(WorkerError::Listening)?;
        // PostgreSQL tells the changes itself.
        let mut passed_on = if worker.store.is_shared() { None } else { worker.store.pass_on() };
        let job = worker.store.job(&self.lease.job).await?;
        stand_aside(match job.estimate.memory_bytes {
            0 => worker.config.memory_bytes,
            estimated_bytes => estimated_bytes + estimated_bytes / 2,
        });
        let pool = Arc::new(worker.pool()?);
        say(STARTED);
        let mut attempt = pin!(worker.attempt(job, self.lease, &pool, &drain));
        loop {
            tokio::select! {
                () = &mut attempt => break,
                () = orphaned.cancelled() => return Ok(()),
                Some(change) = next(&mut passed_on) => say(&change),
            }
        }
        passed_on.iter_mut().flat_map(PassedOn::rest).for_each(|change| say(&change));
        Ok(())
    }
}

/// The next change to tell; none ever without a receiver.
async fn next(passed_on: &mut Option<PassedOn>) -> Option<String> {
    match passed_on {
        Some(passed_on) => passed_on.next().await,
        None => std::future::pending().await,
    }
}

/// Tells the worker. If nobody reads it, the worker has died, and its end is noticed elsewhere.
fn say(line: &str) {
    drop(writeln!(io::stdout().lock(), "{line}"));
}

/// Follows what the worker writes: the first token is cancelled when the server stops, the second one when the worker has
/// died.
fn listen() -> io::Result<(CancellationToken, CancellationToken)> {
    let (drain, orphaned) = (CancellationToken::new(), CancellationToken::new());
    let tokens = (drain.clone(), orphaned.clone());
    std::thread::Builder::new().name("worker".to_owned()).spawn(move || {
        for line in io::stdin().lines().map_while(Result::ok) {
            if line == DRAIN {
                drain.cancel();
            }
        }
        orphaned.cancel();
    })?;
    Ok(tokens)
}

/// Bounds the memory of this process, and makes it the first one that the system kills when memory runs out.
fn stand_aside(memory_bytes: u64) {
    let limit = Some(memory_bytes.saturating_add(OWN_BYTES));
    if let Err(error) = setrlimit(Resource::Data, Rlimit { current: limit, maximum: limit }) {
        tracing::warn!(%error, "the memory of the job's process could not be bounded");
    }
    // There is no such file on other systems.
    drop(std::fs::write("/proc/self/oom_score_adj", "1000"));
}
