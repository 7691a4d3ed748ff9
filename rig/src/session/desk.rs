//! Requests and what became of them, independent of the connection.
//!
//! A request waits, is photographed, is uploaded, and is remembered. One that is asked for again joins what was begun, or
//! gets the remembered answer; so there is one photograph for each. While one photograph is uploaded the next is taken.

use super::patterns::Patterns;
use super::safety::make_safe;
use crate::bench::Bench;
use crate::log;
use crate::state::{PauseFile, Remembered};
use crate::take::{NoPhotograph, Order, Photograph, Photographer};
use lightpath::Client;
use lightpath::v1::serve_rig_request::{Failed, Message, Taken};
use lightpath::v1::serve_rig_response::Take;
use lightpath_proto::Timestamp;
use std::collections::{HashSet, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, UNIX_EPOCH};
use tokio::sync::{Notify, OwnedSemaphorePermit, Semaphore, mpsc};

/// Requests that may wait. The server asks for a few at a time.
const WAITING_MAX: usize = 1024;
/// Photographs in memory that are being taken or uploaded.
const UPLOADS_MAX: usize = 2;
/// Photographs in memory that could not be uploaded yet.
const UNSENT_MAX: usize = 8;
/// Limit on the text of a failure \[bytes\], from the protocol.
const MESSAGE_BYTES_MAX: usize = 1024;

/// Answers for the server.
pub(super) type Answers = mpsc::UnboundedReceiver<Message>;

/// Where requests are worked off.
pub(super) struct Desk {
    client: Client,
    bench: Arc<Bench>,
    photographer: Arc<Photographer>,
    pause: PauseFile,
    patterns: Arc<Patterns>,
    papers: Mutex<Papers>,
    wake: Notify,
    uploads: Arc<Semaphore>,
    answers: mpsc::UnboundedSender<Message>,
}

struct Papers {
    waiting: VecDeque<Take>,
    /// Requests that are photographed or uploaded.
    begun: HashSet<String>,
    /// Requests whose answer the server waits for.
    wanted: HashSet<String>,
    /// Photographs that could not be uploaded, because the link was lost.
    unsent: VecDeque<(String, Arc<Photograph>)>,
    remembered: Remembered,
}

impl Desk {
    pub(super) fn new(
        client: Client,
        bench: Arc<Bench>,
        photographer: Photographer,
        pause: PauseFile,
        remembered: Remembered,
    ) -> (Self, Answers) {
        let (answers, received) = mpsc::unbounded_channel();
        let patterns = Arc::new(Patterns::new(client.clone(), Arc::clone(&bench)));
        let (waiting, begun, wanted, unsent) = Default::default();
        let desk = Self {
            client,
            bench,
            photographer: Arc::new(photographer),
            pause,
            patterns,
            papers: Mutex::new(Papers { waiting, begun, wanted, unsent, remembered }),
            wake: Notify::new(),
            uploads: Arc::new(Semaphore::new(UPLOADS_MAX)),
            answers,
        };
        (desk, received)
    }

    /// Takes a request.
    pub(super) fn ask(self: &Arc<Self>, take: Take) {
        let id = take.take.clone();
        let mut papers = self.papers();
        if let Some(taken) = papers.remembered.answer(&id) {
            return self.send(Message::Taken(taken));
        }
        papers.wanted.insert(id.clone());
        if papers.begun.contains(&id) || papers.waiting.iter().any(|waiting| waiting.take == id) {
            return;
        }
        if let Some(at) = papers.unsent.iter().position(|(unsent, _)| *unsent == id)
            && let Some((_, photograph)) = papers.unsent.remove(at)
        {
            papers.begun.insert(id.clone());
            tokio::spawn(Arc::clone(self).upload(id, photograph, None));
            return;
        }
        if papers.waiting.len() >= WAITING_MAX {
            drop(papers);
            return self.fail(&id, &format!("{WAITING_MAX} requests wait already; ask again later"), true);
        }
        papers.waiting.push_back(take);
        drop(papers);
        self.wake.notify_one();
    }

    /// Forgets all requests, and makes the bench safe. What is uploaded is remembered all the same.
    pub(super) async fn rest(&self) {
        {
            let mut papers = self.papers();
            papers.waiting.clear();
            papers.wanted.clear();
        }
        log::line("nothing to do: the bench goes to its safe state");
        make_safe(&self.bench).await;
    }

    /// Forgets what has not begun: the server asks again. What was begun goes on.
    pub(super) fn link_lost(&self) {
        let mut papers = self.papers();
        papers.waiting.clear();
        papers.wanted.clear();
    }

    /// Works off requests, one photograph at a time, for ever.
    pub(super) async fn work(self: Arc<Self>, look: Duration) {
        let mut is_paused = false;
        loop {
            if let Some(pause) = self.pause.read() {
                if !is_paused {
                    log::line(format_args!("{}; requests wait until `lightpath-rig resume`", pause.in_words()));
                    make_safe(&self.bench).await;
                    self.pause.mark_seen(true);
                    is_paused = true;
                }
                tokio::time::sleep(look).await;
                continue;
            }
            if is_paused {
                log::line("the pause has ended: requests are worked off");
                self.pause.mark_seen(false);
                is_paused = false;
            }
            let next = {
                let mut papers = self.papers();
                let next = papers.waiting.pop_front();
                papers.begun.extend(next.iter().map(|take| take.take.clone()));
                next
            };
            match next {
                Some(take) => self.take(take).await,
                // The wait is short because a pause is a file, which nobody announces.
                None => drop(tokio::time::timeout(look, self.wake.notified()).await),
            }
        }
    }

    async fn take(self: &Arc<Self>, take: Take) {
        let id = take.take.clone();
        let levels = match self.patterns.levels(&take.pattern).await {
            Ok(levels) => levels,
            Err(error) => return self.give_up(&id, &error.message, error.retryable),
        };
        // Waits while too many photographs are in memory.
        let Ok(place) = Arc::clone(&self.uploads).acquire_owned().await else { return };
        let permit = self.bench.permit();
        {
            let mut papers = self.papers();
            // After a rest nobody waits for it. The permit is older than this look, so a later rest stops the photograph.
            if !papers.wanted.contains(&id) {
                papers.begun.remove(&id);
                return;
            }
        }
        self.read_ahead(take.next_pattern);
        let Take { exposure_s, exposure_count: frames, dark, wavelength_m, .. } = take;
        let order = Order { levels, exposure_s, frames, dark, wavelength_m };
        let (photographer, bench) = (Arc::clone(&self.photographer), Arc::clone(&self.bench));
        let taking = tokio::task::spawn_blocking(move || photographer.photograph(&bench, permit, &order));
        let failure = match taking.await {
            Ok(Ok(photograph)) => {
                tokio::spawn(Arc::clone(self).upload(id, Arc::new(photograph), Some(place)));
                return;
            }
            Ok(Err(failure)) => failure,
            Err(error) => NoPhotograph::Failed(format!("the rig failed: {error}")),
        };
        match failure {
            NoPhotograph::Stopped => self.give_up(&id, "the bench was made safe before the photograph was taken", true),
            NoPhotograph::Refused(message) => self.give_up(&id, &message, false),
            NoPhotograph::Failed(message) => {
                // Closes the shutter, whatever the device did, and opens devices anew whose code panicked.
                make_safe(&self.bench).await;
                self.give_up(&id, &message, true);
            }
        }
    }

    /// Reads the next pattern meanwhile. If that fails, the request for it says so.
    fn read_ahead(&self, pattern: String) {
        if !pattern.is_empty() {
            let patterns = Arc::clone(&self.patterns);
            tokio::spawn(async move { drop(patterns.levels(&pattern).await) });
        }
    }

    /// Uploads a photograph and answers. It holds its place in memory until then.
    async fn upload(self: Arc<Self>, id: String, photograph: Arc<Photograph>, place: Option<OwnedSemaphorePermit>) {
        let uploaded = self.client.upload_bytes(photograph.png.clone()).await;
        drop(place);
        let error = match uploaded {
            Ok(photo) => return self.answer(id, &photograph, photo),
            Err(error) => error,
        };
        let mut papers = self.papers();
        papers.begun.remove(&id);
        papers.unsent.push_back((id.clone(), photograph));
        if papers.unsent.len() > UNSENT_MAX {
            papers.unsent.pop_front();
        }
        drop(papers);
        self.fail(&id, &format!("the photograph could not be uploaded: {error}"), true);
    }

    fn answer(&self, id: String, photograph: &Photograph, photo: String) {
        let since = photograph.exposure_time.duration_since(UNIX_EPOCH).unwrap_or_default();
        let time = Timestamp { seconds: since.as_secs() as i64, nanos: since.subsec_nanos() as i32 };
        let taken = Taken {
            take: id.clone(),
            photo,
            levels_sha256: photograph.levels_sha256.clone(),
            frame: photograph.frame,
            exposure_time: Some(time),
            exposure_s: photograph.exposure_s,
            temperature_c: photograph.temperature_c,
        };
        let mut papers = self.papers();
        papers.begun.remove(&id);
        if let Err(error) = papers.remembered.add(taken.clone()) {
            log::line(format_args!("a photograph is remembered only until the rig ends: {error}"));
        }
        if papers.wanted.remove(&id) {
            self.send(Message::Taken(taken));
        }
    }

    /// Ends a request that came to nothing.
    fn give_up(&self, id: &str, message: &str, retryable: bool) {
        self.papers().begun.remove(id);
        self.fail(id, message, retryable);
    }

    /// Says that a request came to nothing, if the server still waits for it.
    fn fail(&self, id: &str, message: &str, retryable: bool) {
        if self.papers().wanted.remove(id) {
            log::line(format_args!("no photograph: {message}"));
            let end = message.floor_char_boundary(MESSAGE_BYTES_MAX);
            let (take, message) = (id.to_owned(), message[..end].to_owned());
            self.send(Message::Failed(Failed { take, message, retryable }));
        }
    }

    fn send(&self, answer: Message) {
        // Without a connection nobody takes it, and the server asks again.
        let _ = self.answers.send(answer);
    }

    fn papers(&self) -> MutexGuard<'_, Papers> {
        // Nothing panics while the lock is held.
        self.papers.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
