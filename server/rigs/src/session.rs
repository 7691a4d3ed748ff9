//! The connection of one rig.

use crate::{Answer, Ask, RigDescription, Rigs, Take};
use std::collections::{HashMap, VecDeque};
use std::sync::atomic::Ordering;
use tokio::sync::{mpsc, oneshot};

/// Patterns that a rig may read: the latest ones.
const PATTERNS_MAX: usize = 32;

/// A connected rig.
#[derive(Debug)]
pub(crate) struct Bench {
    pub(crate) description: RigDescription,
    /// Who connected it.
    holder: String,
    /// Number of the connection.
    session: u64,
    asks: mpsc::UnboundedSender<Ask>,
    /// Who waits for an answer, by the id of the request.
    waiting: HashMap<String, oneshot::Sender<Answer>>,
    /// Digests of the patterns that it was asked to show or to prepare, the latest at the end.
    patterns: VecDeque<String>,
}

impl Bench {
    pub(crate) fn ask(&mut self, ask: Ask) {
        // A connection that has just ended asks nothing; whoever waits for its answer learns of the end.
        drop(self.asks.send(ask));
    }

    pub(crate) fn ask_for(&mut self, take: &Take) -> oneshot::Receiver<Answer> {
        let (answered, answer) = oneshot::channel();
        self.waiting.insert(take.id.clone(), answered);
        for pattern in [Some(&take.pattern), take.next_pattern.as_ref()].into_iter().flatten() {
            self.patterns.retain(|known| known != pattern);
            self.patterns.push_back(pattern.clone());
        }
        while self.patterns.len() > PATTERNS_MAX {
            self.patterns.pop_front();
        }
        self.ask(Ask::Take(take.clone()));
        answer
    }

    pub(crate) fn shows(&self, pattern: &str) -> bool {
        self.patterns.iter().any(|known| known == pattern)
    }

    pub(crate) fn forget(&mut self, take: &str) {
        self.waiting.remove(take);
    }
}

/// Why a rig cannot connect.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// Another rig serves the display.
    #[error("a rig of {holder} serves the display, and a display has one rig; stop that one first")]
    Busy {
        /// Who connected it.
        holder: String,
    },
    /// The process runs no jobs.
    #[error("this server runs no jobs, so nothing would be asked of a rig; connect it to a server that runs jobs")]
    NoJobs,
}

/// The server's end of a rig's connection. When it is dropped, the rig is gone.
#[derive(Debug)]
pub struct Session {
    rigs: Rigs,
    display: String,
    number: u64,
    asks: mpsc::UnboundedReceiver<Ask>,
}

impl Rigs {
    /// Connects the rig of a display. An earlier connection of the same holder ends: its program is probably gone, and the
    /// server has not noticed yet.
    ///
    /// # Errors
    ///
    /// [`Refusal`].
    pub fn connect(&self, display: &str, description: RigDescription, holder: &str) -> Result<Session, Refusal> {
        if self.0.refuses {
            return Err(Refusal::NoJobs);
        }
        let (sender, asks) = mpsc::unbounded_channel();
        let number = self.0.sessions.fetch_add(1, Ordering::Relaxed);
        {
            let mut benches = self.lock();
            if let Some(other) = benches.get(display).filter(|bench| bench.holder != holder) {
                return Err(Refusal::Busy { holder: other.holder.clone() });
            }
            let (holder, waiting, patterns) = (holder.to_owned(), HashMap::new(), VecDeque::new());
            benches.insert(
                display.to_owned(),
                Bench { description, holder, session: number, asks: sender, waiting, patterns },
            );
        }
        self.announce();
        Ok(Session { rigs: self.clone(), display: display.to_owned(), number, asks })
    }
}

impl Session {
    /// What is asked next; `None`: a later connection has taken the place of this one.
    pub async fn next(&mut self) -> Option<Ask> {
        self.asks.recv().await
    }

    /// Hands over the rig's answer to a request. An answer that nobody waits for any more is dropped.
    pub fn answered(&self, take: &str, answer: Answer) {
        let mut benches = self.rigs.lock();
        let own = benches.get_mut(&self.display).filter(|bench| bench.session == self.number);
        if let Some(answered) = own.and_then(|bench| bench.waiting.remove(take)) {
            drop(answered.send(answer));
        }
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        {
            let mut benches = self.rigs.lock();
            if benches.get(&self.display).is_some_and(|bench| bench.session == self.number) {
                benches.remove(&self.display);
            }
        }
        self.rigs.announce();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Camera, Failure, Slm, TakeError, Taken};
    use lightpath_domain::ability::Labels;
    use lightpath_domain::units::{Distance, Wavelength};
    use std::time::Duration;

    const LONG: Duration = Duration::from_secs(10);

    fn description() -> RigDescription {
        let slm = Slm { width_px: 64, height_px: 48, bit_depth: 8, settling_time_s: 0.1, reads_back: false };
        let camera = Camera {
            width_px: 80,
            height_px: 60,
            bit_depth: 12,
            exposure_min_s: 1e-5,
            exposure_max_s: 1.0,
            exposure_delay_frames: 2,
        };
        let program = "test".to_owned();
        let (wavelengths, distance) = (vec![Wavelength::from_m(515e-9).unwrap()], Distance::from_m(0.1).unwrap());
        RigDescription { program, slm, camera, has_shutter: false, wavelengths, distance }
    }

    fn take(id: &str) -> Take {
        let pattern = "sha256-0".to_owned();
        let id = id.to_owned();
        Take { id, pattern, exposure_s: 0.01, exposures: 1, dark: false, next_pattern: None, wavelength_m: 515e-9 }
    }

    fn taken(photo: &str) -> Taken {
        let (photo, levels_sha256) = (photo.to_owned(), "00".to_owned());
        Taken { photo, levels_sha256, frame: 1, exposure_time_ms: 0, exposure_s: 0.01, temperature_c: None }
    }

    async fn id_of_next(session: &mut Session) -> String {
        match session.next().await.unwrap() {
            Ask::Take(take) => take.id,
            Ask::Rest => panic!("nothing is asked"),
        }
    }

    #[tokio::test]
    async fn a_request_outlives_the_connection_and_is_asked_again_with_its_id() {
        let rigs = Rigs::default();
        let mut first = rigs.connect("lab", description(), "bench").unwrap();
        let asking = tokio::spawn({
            let rigs = rigs.clone();
            async move { rigs.photograph("lab", &take("a"), LONG).await }
        });
        assert_eq!(id_of_next(&mut first).await, "a");
        assert!(rigs.shows("lab", "sha256-0") && !rigs.shows("lab", "sha256-1") && !rigs.shows("other", "sha256-0"));
        drop(first);
        assert!(rigs.of("lab").is_none() && rigs.labels().borrow().is_empty());
        let mut second = rigs.connect("lab", description(), "bench").unwrap();
        assert!(rigs.labels().borrow().contain(&Labels::of_rig("lab")));
        assert_eq!(id_of_next(&mut second).await, "a");
        second.answered("b", Ok(taken("of another request")));
        second.answered("a", Ok(taken("photo")));
        assert_eq!(asking.await.unwrap().unwrap().photo, "photo");
    }

    #[tokio::test]
    async fn a_later_connection_of_the_same_holder_replaces_the_earlier_one() {
        let rigs = Rigs::default();
        let mut first = rigs.connect("lab", description(), "bench").unwrap();
        let busy = rigs.connect("lab", description(), "other").unwrap_err();
        assert_eq!(busy, Refusal::Busy { holder: "bench".to_owned() });
        assert_eq!(Rigs::refusing().connect("lab", description(), "bench").unwrap_err(), Refusal::NoJobs);
        let _second = rigs.connect("lab", description(), "bench").unwrap();
        assert!(first.next().await.is_none());
        drop(first);
        assert!(rigs.of("lab").is_some(), "the end of the earlier connection ends only itself");
    }

    #[tokio::test]
    async fn silent_and_absent_rigs_and_failures_are_errors_that_tell_them_apart() {
        let rigs = Rigs::default();
        let absent = rigs.photograph("lab", &take("a"), LONG).await.unwrap_err();
        assert_eq!(absent, TakeError::Absent("lab".to_owned()));
        let mut session = rigs.connect("lab", description(), "bench").unwrap();
        let silent = rigs.photograph("lab", &take("a"), Duration::from_millis(50)).await.unwrap_err();
        assert!(matches!(silent, TakeError::Silent { .. }), "{silent}");
        let asking = tokio::spawn({
            let rigs = rigs.clone();
            async move { rigs.photograph("lab", &take("b"), LONG).await }
        });
        while id_of_next(&mut session).await != "b" {}
        session.answered("b", Err(Failure { message: "the exposure is too long".to_owned(), retryable: false }));
        let failed = asking.await.unwrap().unwrap_err();
        assert_eq!(failed.to_string(), "the rig of displays/lab: the exposure is too long");
    }
}
