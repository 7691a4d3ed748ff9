//! `lightpathd`: the Lightpath server.

mod freed_memory;

use anyhow::Context as _;
use clap::{CommandFactory as _, Parser, Subcommand};
use lightpath_server::config::{Config, Effective, LogFormat, ServeFlags, Settings, WorkerFlags};
use lightpath_server::demo::{self, DemoArgs};
use lightpath_server::devices::DevicesArgs;
use lightpath_server::upkeep::{
    BackupArgs, CheckArgs, CollectArgs, KeyCommand, MigrateArgs, RestoreArgs, RestoredArgs, TokenCommand,
};
use lightpath_server::{job_process, listening, server, worker_process};
use lightpath_worker::JobInput;
use std::future::Future;
use std::io::{IsTerminal as _, Write as _};
use std::path::PathBuf;
use std::process::ExitCode;
use tokio::net::TcpListener;
use tokio::signal::unix::{SignalKind, signal};
use tracing_subscriber::filter::Targets;
use tracing_subscriber::prelude::*;

/// Computer-generated holography as a service: a queue of hologram and learning jobs, and a registry of learned
/// kernels, behind one gRPC and HTTP port.
#[derive(Debug, Parser)]
#[command(name = "lightpathd", version, max_term_width = 80, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Serve(Serve),
    Worker(Worker),
    Check(CheckArgs),
    Backup(BackupArgs),
    Restore(RestoreArgs),
    Restored(RestoredArgs),
    Collect(CollectArgs),
    Migrate(MigrateArgs),
    /// Create, list and revoke access tokens
    #[command(subcommand)]
    Token(TokenCommand),
    #[command(subcommand)]
    Key(KeyCommand),
    Demo(DemoArgs),
    Devices(DevicesArgs),
    Man(Man),
    /// Run one job in a process of its own; servers and workers call this
    #[command(name = job_process::COMMAND, hide = true)]
    Job,
}

/// Run the server until SIGTERM or ctrl-c. Then running jobs save their state and return to the queue.
#[derive(Debug, clap::Args)]
#[command(after_help = SERVE_HELP)]
struct Serve {
    #[command(flatten)]
    source: Source,
    #[command(flatten)]
    flags: ServeFlags,
}

/// Run jobs of a server on another machine until SIGTERM or ctrl-c. Then they save their state and return to the queue.
#[derive(Debug, clap::Args)]
#[command(after_help = WORKER_HELP)]
struct Worker {
    #[command(flatten)]
    source: Source,
    #[command(flatten)]
    flags: WorkerFlags,
}

/// Where settings come from besides flags, and what to do with them.
#[derive(Debug, clap::Args)]
struct Source {
    /// TOML file of settings; its keys are the names of the flags with underscores
    #[arg(long, env = "LIGHTPATH_CONFIG", value_name = "FILE")]
    config: Option<PathBuf>,
    /// Print the settings in effect and the source of each, then exit
    #[arg(long)]
    print_config: bool,
}

/// Write the man pages of lightpathd and of all its commands.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  lightpathd man --out ~/.local/share/man/man1")]
struct Man {
    /// Folder for the pages; a missing one is created
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

const SERVE_HELP: &str = "\
Flags override environment variables, environment variables override the file, and the file overrides the \
defaults.

Examples:
  lightpathd serve
  lightpathd token create ada --role admin > ada.token
  lightpathd serve --data-dir /srv/lightpath --listen 0.0.0.0:7070 \\
      --tls-cert cert.pem --tls-key key.pem
  lightpathd serve --config lightpath.toml --log-level debug
  lightpathd serve --print-config > lightpath.toml

The server prints its address on stdout and its log on stderr. Health is at /healthz, metrics are at /metrics.";

const WORKER_HELP: &str = "\
Any number of workers and servers share one PostgreSQL database and one bucket. Each has a data folder of its own, which \
is only a cache. A worker that dies loses nothing: its jobs go on elsewhere from their last saved state.

Examples:
  lightpathd worker --database-url postgres://lightpath@db.example/lightpath \\
      --artifacts-url s3://lightpath/artifacts --data-dir /var/cache/lightpath
  lightpathd worker --config lightpath.toml --workers 4 \\
      --status-listen 127.0.0.1:7071

The worker prints its log on stderr.";

fn main() -> ExitCode {
    let outcome = match Cli::parse().command {
        Command::Serve(serve) => serve.run().map(|()| ExitCode::SUCCESS),
        Command::Worker(worker) => worker.run().map(|()| ExitCode::SUCCESS),
        Command::Check(args) => Ok(args.run()),
        Command::Backup(args) => Ok(args.run()),
        Command::Restore(args) => Ok(args.run()),
        Command::Restored(args) => Ok(args.run()),
        Command::Collect(args) => Ok(args.run()),
        Command::Migrate(args) => Ok(args.run()),
        Command::Token(command) => Ok(command.run()),
        Command::Key(command) => Ok(command.run()),
        Command::Demo(args) => demo::run(args).map(|()| ExitCode::SUCCESS),
        Command::Devices(args) => print(&args.run()).map(|()| ExitCode::SUCCESS),
        Command::Man(man) => man.run().map(|()| ExitCode::SUCCESS),
        Command::Job => run_job().map(|()| ExitCode::SUCCESS),
    };
    match outcome {
        Ok(code) => code,
        Err(error) => {
            let text = format!("lightpathd: {error:#}");
            let _ = writeln!(std::io::stderr().lock(), "{text}");
            // `lightpathd serve 2> server.log &` would end without a word in the terminal.
            if !std::io::stderr().is_terminal() && std::io::stdout().is_terminal() {
                let _ = writeln!(std::io::stdout().lock(), "{text}");
            }
            ExitCode::FAILURE
        }
    }
}

fn print(text: &str) -> anyhow::Result<()> {
    Ok(write!(std::io::stdout().lock(), "{text}")?)
}

impl Man {
    fn run(&self) -> anyhow::Result<()> {
        let written = lightpath_program_docs::write_man_pages(documented(), &self.out);
        written.with_context(|| format!("cannot write the pages to {}", self.out.display()))?;
        Ok(())
    }
}

/// The command line for documents, which are the same on every machine: a default that the help explains in words depends
/// on the machine, and is left out.
fn documented() -> clap::Command {
    let general = |argument: clap::Arg| {
        let help = argument.get_help().map(ToString::to_string).unwrap_or_default();
        match help.split_once(" [default: ") {
            Some((words, _)) if words.contains("by default ") => argument.help(words.to_owned()),
            _ => argument,
        }
    };
    Cli::command().mut_subcommands(|command| command.mut_args(general))
}

impl Serve {
    fn run(self) -> anyhow::Result<()> {
        self.source.run(self.flags.0, serve)
    }
}

impl Worker {
    fn run(self) -> anyhow::Result<()> {
        self.source.run(self.flags.0, work)
    }
}

impl Source {
    /// Runs `process` with the settings in effect, or prints them.
    fn run<F>(self, given: Settings, process: fn(Config) -> F) -> anyhow::Result<()>
    where
        F: Future<Output = anyhow::Result<()>>,
    {
        let file = self.config.as_deref().map(Settings::read).transpose()?.unwrap_or_default();
        let effective = Effective::merge(given, file)?;
        if self.print_config {
            write!(std::io::stdout().lock(), "{effective}")?;
            return Ok(());
        }
        start_log(&effective.config)?;
        run_to_end(process(effective.config))
    }
}

/// Runs a process until its future ends.
fn run_to_end(process: impl Future<Output = anyhow::Result<()>>) -> anyhow::Result<()> {
    freed_memory::give_back();
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    let outcome = runtime.block_on(process);
    // The blocking threads that still run belong to cancelled requests, so the process need not wait for them.
    runtime.shutdown_background();
    outcome
}

fn run_job() -> anyhow::Result<()> {
    let input = JobInput::read().context("this command is called by servers and workers, with a job to run")?;
    let config: Config = serde_json::from_str(&input.settings)?;
    start_log(&config)?;
    run_to_end(async {
        // Whoever stops a server may send the signal to all of its processes. The server tells this one what to do.
        let _ignored = stop_signal()?;
        Ok(job_process::run(input, config).await?)
    })
}

async fn work(config: Config) -> anyhow::Result<()> {
    let stop = stop_signal()?;
    let status = match config.status_listen {
        None => None,
        Some(requested) => {
            let listener = TcpListener::bind(requested).await;
            Some(listener.with_context(|| format!("cannot listen on {requested}; choose another --status-listen"))?)
        }
    };
    tracing::info!(data_dir = %config.data_dir.display(), "starting");
    let program = job_process::this_program(&config)?;
    worker_process::run(status, config, Some(program), stop).await?;
    Ok(())
}

async fn serve(config: Config) -> anyhow::Result<()> {
    let stop = stop_signal()?;
    let listener = listening::listen(config.listen, &config.data_dir).await?;
    let address = listener.local_addr()?;
    tracing::info!(%address, data_dir = %config.data_dir.display(), "starting");
    // Clients that connect from now on wait in the backlog until the server has checked everything.
    let scheme = if config.tls_cert.is_some() { "https" } else { "http" };
    let announce = |address| writeln!(std::io::stdout().lock(), "listening on {scheme}://{address}");
    let program = job_process::this_program(&config)?;
    server::run_and_announce(listener, config, Some(program), announce, stop).await?;
    Ok(())
}

/// A future that ends at the first SIGTERM or ctrl-c.
fn stop_signal() -> anyhow::Result<impl Future<Output = ()> + Send> {
    let (mut terminate, mut interrupt) = (signal(SignalKind::terminate())?, signal(SignalKind::interrupt())?);
    Ok(async move {
        tokio::select! {
            _ = terminate.recv() => {}
            _ = interrupt.recv() => {}
        }
    })
}

fn start_log(config: &Config) -> anyhow::Result<()> {
    let filter: Targets = config.log_level.parse().with_context(|| {
        format!("log_level is {:?}, but must be a filter such as info or lightpath_api=debug", config.log_level)
    })?;
    let is_terminal = std::io::stderr().is_terminal();
    let lines = tracing_subscriber::fmt::layer().with_writer(std::io::stderr).with_ansi(is_terminal);
    let log = tracing_subscriber::registry();
    match config.log_format {
        LogFormat::Auto if is_terminal => log.with(lines.with_filter(filter)).init(),
        LogFormat::Text => log.with(lines.with_filter(filter)).init(),
        LogFormat::Auto | LogFormat::Json => log.with(lines.json().with_filter(filter)).init(),
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_program_docs::{check_document, check_help, markdown};
    use std::path::Path;

    #[test]
    fn help_is_complete_and_fits_a_terminal() {
        check_help(Cli::command()).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    }

    #[test]
    fn reference_in_the_documents_is_up_to_date() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference/command-line.md");
        let reference = markdown(documented());
        assert!(!reference.contains("for each core \\[default"), "a document is the same on every machine");
        assert_eq!(check_document(&path, "lightpathd", &reference), Ok(()));
    }
}
