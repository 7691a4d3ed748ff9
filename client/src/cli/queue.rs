//! The commands `lightpath queue …`.

use super::failure::Failure;
use super::session::Session;
use super::show;
use super::table::Table;
use clap::{Args, Subcommand};
use lightpath::{names, v1};

/// Commands for the queue as a whole.
#[derive(Debug, Subcommand)]
pub(crate) enum QueueCommand {
    /// Show the number of queued and running jobs of each owner, and what is paused
    Show,
    /// Start no further jobs; running jobs continue, and new jobs are accepted
    Pause(Pause),
    /// Start jobs again after a pause
    Resume(Part),
}

/// The part of the queue that a command applies to.
#[derive(Debug, Args)]
pub(crate) struct Part {
    /// Apply only to jobs on the display with this id [default: all jobs]
    #[arg(long, value_name = "ID")]
    display: Option<String>,
}

/// Arguments of `queue pause`.
#[derive(Debug, Args)]
pub(crate) struct Pause {
    #[command(flatten)]
    part: Part,

    /// Give a reason, which queue show prints [default: none]
    #[arg(long, value_name = "TEXT", default_value = "", hide_default_value = true)]
    reason: String,
}

impl QueueCommand {
    pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
        let client = &session.client;
        let queue = match self {
            Self::Show => client.get_queue(v1::GetQueueRequest {}).await?,
            Self::Pause(pause) => {
                let request = v1::PauseQueueRequest { display: pause.part.name(), reason: pause.reason };
                client.pause_queue(request).await?
            }
            Self::Resume(part) => client.resume_queue(v1::ResumeQueueRequest { display: part.name() }).await?,
        };
        session.print(&queue, text)
    }
}

impl Part {
    fn name(&self) -> String {
        self.display.as_deref().map(names::display).unwrap_or_default()
    }
}

fn text(queue: &v1::Queue) -> String {
    let mut turns = Table::new(&["owner", ">queued", ">running"]);
    for turn in &queue.turns {
        let owner = if turn.owner.is_empty() { "–" } else { turn.owner.as_str() };
        turns.row([owner.to_owned(), turn.queued.to_string(), turn.running.to_string()]);
    }
    let mut lines = vec![turns.text_or("no queued or running jobs")];
    for pause in &queue.pauses {
        let part = if pause.display.is_empty() { "all jobs" } else { pause.display.as_str() };
        let reason = if pause.reason.is_empty() { String::new() } else { format!(": {}", pause.reason) };
        lines.push(format!("paused: {part}, since {}{reason}", show::time_or_dash(pause.since.as_ref())));
    }
    lines.join("\n")
}
