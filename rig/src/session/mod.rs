//! Staying connected: the life of a rig from its start to its end.
//!
//! ```text
//! safe state ─> GetDisplay ─> ServeRig ─> Connected ─> requests and answers ─┐
//!                   └────────── pause that doubles <── link lost ────────────┘
//! ```
//!
//! What was begun goes on while the link is lost. After `safe.lost_link_s` the bench becomes safe all the same.

mod description;
mod desk;
mod patterns;
mod safety;

pub use description::check_display;

use crate::Problem;
use crate::bench::Bench;
use crate::log;
use crate::settings::Settings;
use crate::state::{PauseFile, Remembered, Running};
use crate::take::Photographer;
use desk::{Answers, Desk};
use lightpath::v1::serve_rig_response::Message;
use lightpath::{Client, Code, Error, RigStream, names};
use safety::make_safe;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::watch;
use tokio::time::{Instant, sleep_until, timeout};

/// Times of the connection.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// First wait before another try; it doubles.
    pub retry_min: Duration,
    /// Longest wait before another try.
    pub retry_max: Duration,
    /// Longest wait for the server to answer a description.
    pub connected_limit: Duration,
    /// Time between two looks at the file of a pause.
    pub pause_look: Duration,
}

impl Default for Pace {
    fn default() -> Self {
        Self {
            retry_min: Duration::from_millis(500),
            retry_max: Duration::from_secs(30),
            connected_limit: Duration::from_secs(30),
            pause_look: Duration::from_millis(200),
        }
    }
}

/// Why a connection ended.
enum End {
    /// The rig shall end.
    Stop,
    /// It may be better later.
    Lost(String),
    /// It will never be better.
    Problem(Problem),
}

/// Serves a bench until `stop` becomes true.
///
/// # Errors
///
/// [`Problem`], when a retry can never help. The bench has been made safe then, too.
pub async fn serve(
    settings: &Settings,
    client: Client,
    bench: Arc<Bench>,
    pace: Pace,
    stop: watch::Receiver<bool>,
) -> Result<(), Problem> {
    let _running = Running::take(&settings.state_folder)?;
    make_safe(&bench).await;
    let remembered = Remembered::open(&settings.state_folder)
        .map_err(|error| Problem::Setting(format!("state_folder {}: {error}", settings.state_folder.display())))?;
    let wavelengths_m = settings.wavelengths_m().map_err(Problem::Setting)?;
    let photographer = Photographer::new(settings.bench_limits(), wavelengths_m);
    let pause = PauseFile::in_folder(&settings.state_folder);
    pause.mark_seen(false);
    let (desk, answers) = Desk::new(client.clone(), Arc::clone(&bench), photographer, pause, remembered);
    let desk = Arc::new(desk);
    let work = tokio::spawn(Arc::clone(&desk).work(pace.pause_look));
    let mut link = Link { settings, client, bench: Arc::clone(&bench), desk, answers, pace, stop };
    let ended = link.keep().await;
    work.abort();
    // After its end nothing begins a photograph behind the safe state.
    let _ = work.await;
    make_safe(&bench).await;
    ended
}

struct Link<'a> {
    settings: &'a Settings,
    client: Client,
    bench: Arc<Bench>,
    desk: Arc<Desk>,
    answers: Answers,
    pace: Pace,
    stop: watch::Receiver<bool>,
}

impl Link<'_> {
    /// Connects again and again.
    async fn keep(&mut self) -> Result<(), Problem> {
        let mut wait = self.pace.retry_min;
        // The bench is safe at the start.
        let mut safe_at = None;
        loop {
            match self.connect(&mut safe_at).await {
                Ok(stream) => {
                    wait = self.pace.retry_min;
                    log::line("connected: waiting for requests");
                    let end = self.converse(stream).await;
                    self.desk.link_lost();
                    match end {
                        End::Stop => return Ok(()),
                        End::Problem(problem) => return Err(problem),
                        End::Lost(why) => log::line(format_args!("the link is lost: {why}")),
                    }
                    safe_at = Some(Instant::now() + Duration::from_secs_f64(self.settings.safe.lost_link_s));
                }
                Err(End::Stop) => return Ok(()),
                Err(End::Problem(problem)) => return Err(problem),
                Err(End::Lost(why)) => {
                    log::line(format_args!("{why}; next try in {:.1} s", wait.as_secs_f64()));
                }
            }
            let woken = self.or_safe(&mut safe_at, sleep_until(Instant::now() + wait)).await;
            if woken.is_none() {
                return Ok(());
            }
            wait = (2 * wait).min(self.pace.retry_max);
        }
    }

    /// Opens a connection. Meanwhile the bench becomes safe when it is time.
    async fn connect(&mut self, safe_at: &mut Option<Instant>) -> Result<RigStream, End> {
        let (client, settings, bench) = (self.client.clone(), self.settings.clone(), Arc::clone(&self.bench));
        let limit = self.pace.connected_limit;
        let open = async move {
            let open = open(&client, &settings, &bench);
            timeout(limit, open).await.unwrap_or_else(|_| Err(End::Lost("the server did not answer".to_owned())))
        };
        self.or_safe(safe_at, open).await.unwrap_or(Err(End::Stop))
    }

    /// Waits for something, and makes the bench safe at a time; `None`: the rig shall end.
    async fn or_safe<T>(&mut self, safe_at: &mut Option<Instant>, wait: impl Future<Output = T>) -> Option<T> {
        tokio::pin!(wait);
        loop {
            let due = safe_at.unwrap_or_else(Instant::now);
            tokio::select! {
                done = &mut wait => return Some(done),
                () = stopped(&mut self.stop) => return None,
                () = sleep_until(due), if safe_at.is_some() => {
                    log::line("the link has been lost for safe.lost_link_s: the bench goes to its safe state");
                    make_safe(&self.bench).await;
                    *safe_at = None;
                }
            }
        }
    }

    /// Hands on requests and answers until the connection ends.
    async fn converse(&mut self, mut stream: RigStream) -> End {
        // What was answered to an earlier connection is asked again.
        while self.answers.try_recv().is_ok() {}
        loop {
            tokio::select! {
                () = stopped(&mut self.stop) => return End::Stop,
                Some(answer) = self.answers.recv() => {
                    if let Err(error) = stream.answer(answer) {
                        return End::Lost(error.to_string());
                    }
                }
                message = stream.next() => match message {
                    Ok(Some(response)) => match response.message {
                        Some(Message::Take(take)) => self.desk.ask(take),
                        Some(Message::Rest(_)) => self.desk.rest().await,
                        // A server that is newer may say more; a rig cannot do what it does not know.
                        Some(Message::Connected(_)) | None => {}
                    },
                    Ok(None) => return End::Lost("the server ended the stream".to_owned()),
                    Err(error) => return end_of(&error),
                },
            }
        }
    }
}

/// Ends when the rig shall end.
async fn stopped(stop: &mut watch::Receiver<bool>) {
    if stop.wait_for(|stop| *stop).await.is_err() {
        // Nobody can say it any more.
        std::future::pending::<()>().await;
    }
}

/// Checks the display, and opens the stream.
async fn open(client: &Client, settings: &Settings, bench: &Bench) -> Result<RigStream, End> {
    let name = names::display(settings.display.as_deref().unwrap_or_default());
    let request = lightpath::v1::GetDisplayRequest { name };
    let display = client.get_display(request).await.map_err(|error| end_of(&error))?;
    check_display(&display, settings, bench).map_err(End::Problem)?;
    let description = description::of(&display, settings, bench).map_err(End::Problem)?;
    let mut stream = client.serve_rig(description).await.map_err(|error| end_of(&error))?;
    match stream.next().await.map_err(|error| end_of(&error))?.and_then(|response| response.message) {
        Some(Message::Connected(_)) => Ok(stream),
        _ => Err(End::Lost("the server did not say that the rig is connected".to_owned())),
    }
}

/// What to tell a person while the rig tries again after an error.
///
/// # Errors
///
/// [`Problem`], when a retry can never help.
pub(crate) fn lost_or_problem(error: &Error) -> Result<String, Problem> {
    match end_of(error) {
        End::Lost(why) => Ok(why),
        End::Problem(problem) => Err(problem),
        End::Stop => Ok(String::new()),
    }
}

/// Whether a retry can help after an error, and what to tell a person if not.
fn end_of(error: &Error) -> End {
    let fix = match error.code() {
        None => {
            return match error {
                Error::Protocol { .. } | Error::Damaged { .. } => End::Lost(error.to_string()),
                _ => End::Problem(Problem::Setting(error.to_string())),
            };
        }
        Some(Code::Unauthenticated) => {
            "give a token that the server knows: `lightpathd token create NAME --role rig` makes one"
        }
        Some(Code::PermissionDenied) => "the token needs the role rig, for this display",
        Some(Code::NotFound) => "see `display` in the rig's file, and `lightpath display list`",
        Some(Code::Unimplemented) => "the server is older than this rig: update it",
        // Another rig serves the display, or the server runs no jobs: its own words say what to do.
        Some(Code::FailedPrecondition) => return End::Problem(Problem::Refused(error.to_string())),
        Some(Code::InvalidArgument | Code::OutOfRange) => "correct the rig's file",
        Some(_) => return End::Lost(error.to_string()),
    };
    if error.is_unreachable() {
        return End::Lost(error.to_string());
    }
    End::Problem(Problem::Refused(format!("{error}; {fix}")))
}
