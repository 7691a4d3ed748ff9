//! The rigs that are connected to this server.
//!
//! A *rig* is a program at a bench, which shows patterns on an SLM and photographs them. It serves one display. A job asks
//! for photographs ([`Rigs::photograph`]), and the API carries each request to the rig and its answer back ([`Session`]).
//! A request outlives a connection: a rig that comes back is asked again, with the same id, and answers with the
//! photograph that it has taken meanwhile.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod description;
mod session;

pub use description::{Camera, RigDescription, Slm};
pub use session::{Refusal, Session};

use lightpath_domain::ability::Labels;
use session::Bench;
use std::collections::{BTreeMap, HashMap};
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::{Notify, oneshot, watch};
use tokio::time::{Instant, timeout_at};

/// How long a request waits for a rig whose connection was cut.
const ABSENCE_MAX: Duration = Duration::from_millis(if cfg!(test) { 50 } else { 20_000 });

/// A photograph that a job asks for.
#[derive(Clone, Debug, PartialEq)]
pub struct Take {
    /// Id of the request. A request that is repeated after a restart of the server has the same.
    pub id: String,
    /// Artifact digest of the pattern: a grey PNG of levels.
    pub pattern: String,
    /// Exposure \[s\].
    pub exposure_s: f64,
    /// Number of exposures of which the photograph is the mean.
    pub exposures: u32,
    /// Whether the shutter is closed.
    pub dark: bool,
    /// Artifact digest of the pattern that probably comes next.
    pub next_pattern: Option<String>,
    /// Wavelength of the light \[m\].
    pub wavelength_m: f64,
}

/// A photograph that a rig has taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Taken {
    /// Artifact digest of the photograph.
    pub photo: String,
    /// SHA-256 of the levels on the SLM, in hexadecimal digits.
    pub levels_sha256: String,
    /// Number of its first frame.
    pub frame: u64,
    /// Begin of the exposure \[ms since 1970\].
    pub exposure_time_ms: i64,
    /// Exposure of the frames \[s\].
    pub exposure_s: f64,
    /// Temperature of the SLM or of the camera \[°C\]; `None`: not measured.
    pub temperature_c: Option<f64>,
}

/// Why there is no photograph.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TakeError {
    /// No rig serves the display.
    #[error("no rig serves displays/{0} now; start lightpath-rig at its bench, and the job goes on by itself")]
    Absent(String),
    /// The rig did not answer in time.
    #[error("the rig of displays/{display} did not answer within {waited_s:.0} s; look at the log of lightpath-rig")]
    Silent {
        /// Id of the display.
        display: String,
        /// Time that was waited \[s\].
        waited_s: f64,
    },
    /// The rig could not take it.
    #[error("the rig of displays/{display}: {message}")]
    Failed {
        /// Id of the display.
        display: String,
        /// What happened.
        message: String,
        /// Whether the same request may succeed later.
        retryable: bool,
    },
}

/// What is asked of a rig.
#[derive(Clone, Debug, PartialEq)]
pub enum Ask {
    /// To take a photograph.
    Take(Take),
    /// To go into the safe state.
    Rest,
}

/// Answer to a [`Take`].
pub type Answer = Result<Taken, Failure>;

/// Why a rig took no photograph.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// What happened and what to do about it.
    pub message: String,
    /// Whether the same request may succeed later.
    pub retryable: bool,
}

/// The connected rigs. Clones share them.
#[derive(Clone, Debug, Default)]
pub struct Rigs(Arc<Inner>);

#[derive(Debug, Default)]
struct Inner {
    /// Whether no rig may connect.
    refuses: bool,
    benches: Mutex<HashMap<String, Bench>>,
    /// Number of the connections so far.
    sessions: AtomicU64,
    /// Wakes those that wait for a rig.
    connected: Notify,
    /// Labels of the connected rigs.
    labels: watch::Sender<Labels>,
}

impl Rigs {
    /// No rigs: a process that runs no jobs, or that rigs cannot reach.
    #[must_use]
    pub fn refusing() -> Self {
        Self(Arc::new(Inner { refuses: true, ..Inner::default() }))
    }

    /// The labels that the connected rigs give to this process, one for each display, and their changes.
    #[must_use]
    pub fn labels(&self) -> watch::Receiver<Labels> {
        self.0.labels.subscribe()
    }

    /// The connected rigs by their displays.
    #[must_use]
    pub fn list(&self) -> BTreeMap<String, RigDescription> {
        self.lock().iter().map(|(display, bench)| (display.clone(), bench.description.clone())).collect()
    }

    /// The rig of a display; `None`: none is connected.
    #[must_use]
    pub fn of(&self, display: &str) -> Option<RigDescription> {
        self.lock().get(display).map(|bench| bench.description.clone())
    }

    /// Whether the rig of a display was asked lately to show this pattern, an artifact digest. It may read no others.
    #[must_use]
    pub fn shows(&self, display: &str, pattern: &str) -> bool {
        self.lock().get(display).is_some_and(|bench| bench.shows(pattern))
    }

    /// Asks the rig of a display for a photograph, and waits for it, also while the rig's connection is cut for some seconds.
    ///
    /// # Errors
    ///
    /// [`TakeError`].
    pub async fn photograph(&self, display: &str, take: &Take, wait_max: Duration) -> Result<Taken, TakeError> {
        let end = Instant::now() + wait_max;
        loop {
            let answer = self.asked(display, take).await?;
            match timeout_at(end, answer).await {
                Ok(Ok(Ok(taken))) => return Ok(taken),
                Ok(Ok(Err(Failure { message, retryable }))) => {
                    return Err(TakeError::Failed { display: display.to_owned(), message, retryable });
                }
                // The connection was cut.
                Ok(Err(_)) => {}
                Err(_) => {
                    self.forget(display, &take.id);
                    return Err(TakeError::Silent { display: display.to_owned(), waited_s: wait_max.as_secs_f64() });
                }
            }
        }
    }

    /// Asks the rig of a display to go into its safe state.
    pub fn rest(&self, display: &str) {
        if let Some(bench) = self.lock().get_mut(display) {
            bench.ask(Ask::Rest);
        }
    }

    /// Hands a request to the rig, when it is connected. The receiver gets its answer, or an error if the connection is cut.
    async fn asked(&self, display: &str, take: &Take) -> Result<oneshot::Receiver<Answer>, TakeError> {
        let end = Instant::now() + ABSENCE_MAX;
        loop {
            // Whoever connects after this line wakes it.
            let connected = self.0.connected.notified();
            if let Some(bench) = self.lock().get_mut(display) {
                return Ok(bench.ask_for(take));
            }
            if timeout_at(end, connected).await.is_err() {
                return Err(TakeError::Absent(display.to_owned()));
            }
        }
    }

    fn forget(&self, display: &str, take: &str) {
        if let Some(bench) = self.lock().get_mut(display) {
            bench.forget(take);
        }
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<String, Bench>> {
        // The state is consistent even after a panic: nothing between its changes can panic.
        self.0.benches.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Tells all who wait that a rig came or went.
    fn announce(&self) {
        let labels = Labels::all_of(self.lock().keys().map(|display| Labels::of_rig(display)));
        self.0.labels.send_if_modified(|before| std::mem::replace(before, labels.clone()) != labels);
        self.0.connected.notify_waiters();
    }
}
