//! The commands, one file each, over what they share:
//!
//! - `arguments`, `words`, `submission`, `kernel_choice`: arguments that several commands take.
//! - `session`: the connection and the two forms of output; `failure`: exit codes.
//! - `table`, `show`, `job_text`, `quality_text`, `propagation_text`: how things look to people; `progress`: bars and waiting; `destination`: files to write.

mod arguments;
mod dataset;
mod destination;
mod display;
mod failure;
mod hologram;
mod job;
mod job_text;
mod kernel;
mod kernel_choice;
mod progress;
mod propagation_text;
mod quality_text;
mod queue;
mod session;
mod show;
mod simulate;
mod submission;
mod table;
mod words;

use clap::{CommandFactory as _, Parser, Subcommand};
use failure::Failure;
use session::{Output, Session};
use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

/// Holograms and learned light transport, from a Lightpath server.
///
/// Declare a display, send target pictures and get phase holograms; send photographs of those holograms and get
/// a learned kernel of that display, through which new holograms come out better.
#[derive(Debug, Parser)]
#[command(name = "lightpath", version, max_term_width = 110, after_long_help = EXAMPLES)]
pub(crate) struct Cli {
    /// Address of the server
    #[arg(
        long,
        global = true,
        env = "LIGHTPATH_SERVER",
        default_value = "http://127.0.0.1:7070",
        value_name = "URL",
        help_heading = "Global options"
    )]
    server: String,

    /// File with the access token, where the server wants one
    #[arg(long, global = true, env = "LIGHTPATH_TOKEN_FILE", value_name = "FILE", help_heading = "Global options")]
    token_file: Option<PathBuf>,

    /// PEM file of the authority of the server's certificate, where it is not one of the system's
    #[arg(long, global = true, env = "LIGHTPATH_CA_FILE", value_name = "FILE", help_heading = "Global options")]
    ca_file: Option<PathBuf>,

    /// PEM file of a certificate to show to the server, where it asks for one
    #[arg(
        long,
        global = true,
        env = "LIGHTPATH_CLIENT_CERT",
        value_name = "FILE",
        requires = "client_key",
        help_heading = "Global options"
    )]
    client_cert: Option<PathBuf>,

    /// PEM file of that certificate's private key
    #[arg(
        long,
        global = true,
        env = "LIGHTPATH_CLIENT_KEY",
        value_name = "FILE",
        requires = "client_cert",
        help_heading = "Global options"
    )]
    client_key: Option<PathBuf>,

    /// What stdout gets: tables for people, or the API's messages in protobuf's JSON form and nothing else
    #[arg(long, global = true, default_value = "table", value_name = "FORM", help_heading = "Global options")]
    output: Output,

    #[command(subcommand)]
    command: Command,
}

const EXAMPLES: &str = "\
A first hologram:
  lightpath display create lab-2 --resolution 1920x1080 --pixel-pitch 8um \\
      --wavelength 515nm
  lightpath hologram optimize indian_head.png --display lab-2 --distance 150mm \\
      -o phase.png

A first kernel, from photographs of holograms (some 8 pairs, better 16):
  lightpath dataset create bench-1 --display lab-2 --distance 150mm
  lightpath dataset add bench-1 --phase p01.png --photo c01.png
  lightpath dataset add bench-1 --phase p02.png --photo c02.png
  lightpath dataset finalize bench-1
  lightpath kernel learn --dataset bench-1 --wait
  lightpath kernel promote --display lab-2 --distance 150mm --version 1

Lengths have units: 150mm, 8um, 515nm, 0.15m; a plain number is in metres.

Exit codes: 0 done, 1 a job failed or the server refused, 2 bad usage, 3 the server could not be reached, \
130 interrupted (jobs go on).";

// Where the help is with the arguments, a comment here would hide all but its first line.
#[derive(Debug, Subcommand)]
enum Command {
    /// Declare and look at displays
    #[command(subcommand)]
    Display(display::DisplayCommand),
    /// Make holograms
    #[command(subcommand)]
    Hologram(hologram::HologramCommand),
    /// Collect photographs to learn from
    #[command(subcommand)]
    Dataset(dataset::DatasetCommand),
    /// Learn kernels, look at them, choose the active one, carry them around
    #[command(subcommand)]
    Kernel(kernel::KernelCommand),
    Simulate(simulate::Simulate),
    /// Look at jobs, watch, cancel and retry them
    #[command(subcommand)]
    Job(job::JobCommand),
    /// Look at the queue as a whole, pause and resume it
    #[command(subcommand)]
    Queue(queue::QueueCommand),
    Completions(Completions),
}

/// Print a completion script for a shell.
///
/// For bash: lightpath completions bash > ~/.local/share/bash-completion/completions/lightpath
#[derive(Debug, clap::Args)]
struct Completions {
    /// Which shell
    shell: clap_complete::Shell,
}

/// Reads the command line, runs the command and turns its outcome into an exit code.
pub(crate) fn main() -> ExitCode {
    let cli = Cli::parse();
    let runtime = match tokio::runtime::Builder::new_current_thread().enable_all().build() {
        Ok(runtime) => runtime,
        Err(error) => return failure::tell(&Failure::Output(error)),
    };
    match runtime.block_on(run(cli)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure::tell(&failure),
    }
}

async fn run(cli: Cli) -> Result<(), Failure> {
    if let Command::Completions(completions) = &cli.command {
        return print_completions(completions.shell);
    }
    let certificate = cli.client_cert.as_deref().zip(cli.client_key.as_deref());
    let session =
        Session::open(&cli.server, cli.token_file.as_deref(), cli.ca_file.as_deref(), certificate, cli.output)?;
    match cli.command {
        Command::Display(command) => command.run(&session).await,
        Command::Hologram(command) => command.run(&session).await,
        Command::Dataset(command) => command.run(&session).await,
        Command::Kernel(command) => command.run(&session).await,
        Command::Simulate(command) => command.run(&session).await,
        Command::Job(command) => command.run(&session).await,
        Command::Queue(command) => command.run(&session).await,
        Command::Completions(completions) => print_completions(completions.shell),
    }
}

fn print_completions(shell: clap_complete::Shell) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "lightpath", &mut script);
    std::io::stdout().lock().write_all(&script).map_err(Failure::Output)
}

#[cfg(test)]
mod tests;
