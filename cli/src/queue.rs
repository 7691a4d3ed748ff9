//! The commands `lightpath queue …`.

use super::failure::Failure;
use super::session::Session;
use super::show;
use super::table::Table;
use clap::{Args, Subcommand};
use lightpath::v1::queue::process::Kind;
use lightpath::{names, v1};

/// Commands for the queue as a whole.
#[derive(Debug, Subcommand)]
pub(crate) enum QueueCommand {
    /// Show the number of queued and running jobs of each owner, what is paused, and the living processes
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
    let mut turns = Table::new("owner|>queued|>running");
    for turn in &queue.turns {
        let owner = if turn.owner.is_empty() { "–" } else { turn.owner.as_str() };
        turns.row([owner.to_owned(), turn.queued.to_string(), turn.running.to_string()]);
    }
    let mut lines = vec![turns.text_or("no queued or running jobs")];
    for pause in &queue.pauses {
        let part = if pause.display.is_empty() { "all jobs" } else { pause.display.as_str() };
        let reason = if pause.reason.is_empty() { String::new() } else { format!(": {}", show::plain(&pause.reason)) };
        lines.push(format!("paused: {part}, since {}{reason}", show::time_or_dash(pause.since.as_ref())));
    }
    if !queue.processes.is_empty() {
        lines.push(format!("\n{}", processes(queue)));
    }
    lines.join("\n")
}

/// The living processes as a table.
fn processes(queue: &v1::Queue) -> String {
    let mut table = Table::new("process~|does|labels~|>memory|>jobs?|version??|seen???|started????");
    for process in &queue.processes {
        let does = match process.kind() {
            Kind::Both => "serves and works",
            Kind::Server => "serves",
            Kind::Worker => "works",
            Kind::Unspecified => "–",
        };
        let works = process.workers > 0;
        table.row([
            show::plain(&process.name),
            does.to_owned(),
            show::or_dash(&process.labels.join(", ")),
            process.memory_bytes.map_or_else(|| "–".to_owned(), show::bytes),
            if works { process.workers.to_string() } else { "–".to_owned() },
            process.version.clone(),
            show::age_or_dash(process.seen_time.as_ref()),
            show::age_or_dash(process.start_time.as_ref()),
        ]);
    }
    table.text_or("no living processes")
}
