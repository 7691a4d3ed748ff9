//! The command line of the program `lightpath-agent`.

use crate::optics::{distance_nm, wavelength_pm};
use crate::settings::is_word;
use crate::{Clock, Pace, Problem, Settings, keep, status};
use clap::{Args, CommandFactory as _, FromArgMatches as _, Parser, Subcommand};
use lightpath_manifest::{Optics, PublicKey};
use std::ffi::OsString;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// Formats of kernel files.
const FORMATS: [&str; 7] = ["compact", "safetensors", "f16", "complex64", "npz", "npy", "pt"];

/// What must be given, in lines that fit a terminal.
const USAGE: &str = "\
lightpath-agent [OPTIONS] --server <URL> --display <ID> --device <NAME>
           --wavelength <LENGTH> --distance <LENGTH> --root <PUBLIC-KEY>
           --directory <DIR>
       lightpath-agent status --directory <DIR>";

const EXAMPLES: &str = "\
A display that is always up to date:
  lightpath-agent --server https://lab:7070 --display pluto --device bench-7 \\
      --wavelength 515nm --distance 150mm \\
      --root 3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c \\
      --token-file /etc/lightpath/token --directory /var/lib/lightpath
The application opens /var/lib/lightpath/current/kernel.

On the server, the first command prints the token, and the second the root key:
  lightpathd token create bench-7 --role firmware --display pluto
  lightpathd key list

Three colours, whose kernels change together:
  lightpath-agent … --wavelength 638nm --wavelength 515nm --wavelength 450nm
The application opens /var/lib/lightpath/current/638nm/kernel and the others.

One check, for a timer or for a trial:
  lightpath-agent --once …
What is installed, without a server:
  lightpath-agent status --directory /var/lib/lightpath

Exit codes of --once and status: 0 a verified kernel is in use (with --once: the one that the server offers), 1 it is \
not, 2 wrong usage.";

/// Keep a verified kernel on a display in the field.
///
/// The agent asks the server which version of a kernel is active, fetches its file, checks signatures, size and digest,
/// runs the device's own test, and only then replaces the link DIR/current in one step. The last good kernel stays in
/// use whatever happens: cuts, full disks, power failures, wrong files. Every option can be given by its environment
/// variable instead.
#[derive(Debug, Parser)]
#[command(
    name = "lightpath-agent",
    version,
    max_term_width = 80,
    override_usage = USAGE,
    after_long_help = EXAMPLES,
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true
)]
pub struct Cli {
    /// What to do instead of keeping a kernel.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// How to keep a kernel.
    #[command(flatten)]
    pub run: RunArguments,
}

/// What the command line asks for.
#[derive(Debug)]
pub enum Task {
    /// Keep a kernel.
    Run(Box<RunArguments>),
    /// Do something else.
    Other(Command),
}

/// What to do instead of keeping a kernel.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Print what is installed in a directory, without asking the server
    Status(StatusArguments),
}

/// Arguments of `lightpath-agent status`.
#[derive(Debug, Args)]
pub struct StatusArguments {
    /// Look into this directory
    #[arg(long, env = "LIGHTPATH_DIRECTORY", value_name = "DIR")]
    pub directory: PathBuf,
}

/// Arguments of `lightpath-agent`.
#[derive(Debug, Args)]
pub struct RunArguments {
    /// Ask the server at this address
    #[arg(long, env = "LIGHTPATH_SERVER", value_name = "URL", value_parser = server)]
    pub server: String,

    /// Keep a kernel of the display with this id
    #[arg(long, env = "LIGHTPATH_DISPLAY", value_name = "ID", value_parser = word)]
    pub display: String,

    /// Report under this name, for example bench-7
    #[arg(long, env = "LIGHTPATH_DEVICE", value_name = "NAME", value_parser = word)]
    pub device: String,

    /// Keep the kernel for this wavelength in vacuum, for example 515nm; a manifest for another one is refused. Give the
    /// option once for each kernel of a set, for example one of each colour: they change together, or not at all
    #[arg(
        long = "wavelength",
        env = "LIGHTPATH_WAVELENGTH",
        value_name = "LENGTH",
        value_parser = wavelength_pm,
        value_delimiter = ',',
        required = true
    )]
    pub wavelengths: Vec<i64>,

    /// Keep the kernel for this distance from the SLM, for example 150mm; a manifest for another place is refused
    #[arg(long, env = "LIGHTPATH_DISTANCE", value_name = "LENGTH", value_parser = distance_nm, allow_hyphen_values = true)]
    pub distance: i64,

    /// Use this id of the kernel in addresses instead of asking the server for it: for a mirror, which has no list. Of a
    /// set, one for each --wavelength in the same order
    #[arg(long = "kernel", env = "LIGHTPATH_KERNEL", value_name = "ID", value_parser = word, value_delimiter = ',')]
    pub kernels: Vec<String>,

    /// Change a set of kernels only after none of the display's kernels has moved for this time, in seconds: an
    /// operator promotes one after another
    #[arg(
        long,
        env = "LIGHTPATH_SETTLE_S",
        value_name = "SECONDS",
        default_value_t = 10,
        value_parser = clap::value_parser!(u64).range(0..=3600)
    )]
    pub settle_s: u64,

    /// Fetch the kernel in this format
    #[arg(long, env = "LIGHTPATH_FORMAT", value_name = "FORMAT", default_value = "compact", value_parser = FORMATS)]
    pub format: String,

    /// Trust keyrings that this root key signed: 64 hexadecimal digits; give the option once for each root key
    #[arg(long = "root", env = "LIGHTPATH_ROOT", value_name = "PUBLIC-KEY", value_delimiter = ',', required = true)]
    pub roots: Vec<PublicKey>,

    /// Read the access token from this file
    #[arg(long, env = "LIGHTPATH_TOKEN_FILE", value_name = "FILE")]
    pub token_file: Option<PathBuf>,

    /// Trust the certificate authorities in this PEM file instead of those of the system
    #[arg(long, env = "LIGHTPATH_CA_FILE", value_name = "FILE")]
    pub ca_file: Option<PathBuf>,

    /// Send the client certificate in this PEM file, for a server that requires one; needs --client-key
    #[arg(long, env = "LIGHTPATH_CLIENT_CERT", value_name = "FILE", requires = "client_key")]
    pub client_cert: Option<PathBuf>,

    /// Use the private key in this PEM file for --client-cert
    #[arg(long, env = "LIGHTPATH_CLIENT_KEY", value_name = "FILE", requires = "client_cert")]
    pub client_key: Option<PathBuf>,

    /// Keep the kernel in this directory, which belongs to the agent alone
    #[arg(long, env = "LIGHTPATH_DIRECTORY", value_name = "DIR")]
    pub directory: PathBuf,

    /// Run this program with the path of a new kernel before it is used; the exit status 0 means that the kernel is
    /// good, and a line "loss 0.0123" on stdout is reported
    #[arg(long, env = "LIGHTPATH_SELF_TEST", value_name = "COMMAND")]
    pub self_test: Option<PathBuf>,

    /// End the self-test after this time, in seconds, and take the kernel for bad
    #[arg(
        long,
        env = "LIGHTPATH_SELF_TEST_LIMIT_S",
        value_name = "SECONDS",
        default_value_t = 60,
        value_parser = clap::value_parser!(u64).range(1..=86_400)
    )]
    pub self_test_limit_s: u64,

    /// Use no clock, on a device that has none: it is at least as late as its latest document says
    #[arg(long, env = "LIGHTPATH_NO_CLOCK")]
    pub no_clock: bool,

    /// Check once, and exit
    #[arg(long)]
    pub once: bool,
}

impl RunArguments {
    /// What the agent is told about each of its kernels.
    ///
    /// # Errors
    ///
    /// [`Problem::Setting`] if there are ids of kernels, but not one for each wavelength.
    pub fn settings(self) -> Result<Vec<Settings>, Problem> {
        let (wavelengths, ids) = (self.wavelengths.clone(), self.kernels.clone());
        if !ids.is_empty() && ids.len() != wavelengths.len() {
            let counts = format!("--kernel is given {} times, and --wavelength {}", ids.len(), wavelengths.len());
            return Err(Problem::Setting(format!("{counts}: give an id for each wavelength, or none")));
        }
        let ids = ids.into_iter().map(Some).chain(std::iter::repeat(None));
        let common = self.common();
        let of = |(wavelength, kernel): (i64, Option<String>)| Settings {
            optics: Optics { wavelength_pm: wavelength, ..common.optics.clone() },
            kernel,
            ..common.clone()
        };
        Ok(wavelengths.into_iter().zip(ids).map(of).collect())
    }

    /// What is the same for all kernels. The wavelength is none of them.
    fn common(self) -> Settings {
        Settings {
            server: self.server,
            display: self.display,
            device: self.device,
            optics: Optics::at_distance(0, self.distance),
            kernel: None,
            format: self.format,
            roots: self.roots,
            token_file: self.token_file,
            ca_file: self.ca_file,
            client: self.client_cert.zip(self.client_key),
            directory: self.directory,
            self_test: self.self_test,
            self_test_limit: Duration::from_secs(self.self_test_limit_s),
            pace: Pace::default(),
            clock: if self.no_clock { Clock::none() } else { Clock::system() },
        }
    }
}

impl Cli {
    /// Reads a command line. (The derived parser would ask for the arguments of the agent also before a command, as soon
    /// as the environment has one of them.)
    ///
    /// # Errors
    ///
    /// The text that explains what is wrong, or the help.
    pub fn task(words: impl IntoIterator<Item = OsString>) -> Result<Task, clap::Error> {
        let matches = Self::command().try_get_matches_from(words)?;
        match matches.subcommand_name() {
            Some(_) => Command::from_arg_matches(&matches).map(Task::Other),
            None => RunArguments::from_arg_matches(&matches).map(|arguments| Task::Run(Box::new(arguments))),
        }
    }

    /// Parses the command line, runs the agent and returns the exit code.
    #[must_use]
    pub fn run() -> ExitCode {
        match Self::task(std::env::args_os()) {
            Ok(Task::Run(arguments)) => {
                let (settle, once) = (Duration::from_secs(arguments.settle_s), arguments.once);
                keep::keep(arguments.settings(), settle, once)
            }
            Ok(Task::Other(Command::Status(arguments))) => print_status(&arguments),
            Err(error) => error.exit(),
        }
    }
}

fn print_status(arguments: &StatusArguments) -> ExitCode {
    let (text, is_good) = status(&arguments.directory);
    if writeln!(std::io::stdout().lock(), "{text}").is_ok() && is_good { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn server(text: &str) -> Result<String, String> {
    let rest = text.strip_prefix("https://").or_else(|| text.strip_prefix("http://"));
    let is_plain = |rest: &&str| {
        !rest.is_empty() && rest.bytes().all(|byte| byte.is_ascii_graphic()) && !rest.contains(['?', '#', '@'])
    };
    match rest.map(|rest| rest.trim_end_matches('/')).filter(is_plain) {
        Some(_) => Ok(text.trim_end_matches('/').to_owned()),
        None => Err("must be an address such as https://lab:7070".to_owned()),
    }
}

fn word(text: &str) -> Result<String, String> {
    if is_word(text) {
        Ok(text.to_owned())
    } else {
        Err("must be 1 to 63 characters of a-z, A-Z, 0-9, '.', '_' and '-'".into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "lightpath-agent --server https://lab:7070/ --display pluto --device bench-7 --wavelength 515nm --distance 150mm \
        --root 3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c --directory /var/lib/lightpath";

    fn parsed(line: &str) -> Result<Task, clap::Error> {
        Cli::task(line.split_whitespace().map(OsString::from))
    }

    #[test]
    fn arguments_become_settings() {
        Cli::command().debug_assert();
        lightpath_program_docs::check_help(Cli::command()).unwrap_or_else(|mistakes| panic!("{mistakes}"));
        let Task::Run(arguments) = parsed(GOOD).unwrap() else { panic!() };
        let [settings] = <[Settings; 1]>::try_from(arguments.settings().unwrap()).unwrap();
        assert_eq!((&*settings.server, &*settings.format), ("https://lab:7070", "compact"));
        assert_eq!((settings.optics, settings.kernel), (Optics::at_distance(515_000, 150_000_000), None));
        let behind = GOOD.replace("150mm", "-12.5mm --kernel k7");
        let Task::Run(arguments) = parsed(&behind).unwrap() else { panic!() };
        let [other] = <[Settings; 1]>::try_from(arguments.settings().unwrap()).unwrap();
        assert_eq!((other.optics.distance_nm(), other.kernel.as_deref()), (Some(-12_500_000), Some("k7")));
        assert_eq!(settings.self_test_limit, Duration::from_secs(60));
        assert!(matches!(parsed("lightpath-agent status --directory /x"), Ok(Task::Other(Command::Status(_)))));
    }

    #[test]
    fn several_wavelengths_are_a_set() {
        let line = GOOD.replace("515nm", "638nm,515nm --wavelength 450nm --kernel red --kernel green,blue");
        let Task::Run(arguments) = parsed(&line).unwrap() else { panic!() };
        assert_eq!(arguments.settle_s, 10);
        let kernels = arguments.settings().unwrap();
        let of = |settings: &Settings| (settings.optics.wavelength_pm, settings.kernel.clone().unwrap());
        let expected = [(638_000, "red"), (515_000, "green"), (450_000, "blue")].map(|(pm, id)| (pm, id.to_owned()));
        assert_eq!(kernels.iter().map(of).collect::<Vec<_>>(), expected);
        assert!(kernels.iter().all(|settings| settings.optics.distance_nm() == Some(150_000_000)));
        let Task::Run(arguments) = parsed(&line.replace("green,blue", "green")).unwrap() else { panic!() };
        assert!(
            arguments.settings().unwrap_err().to_string().contains("--kernel is given 2 times, and --wavelength 3")
        );
    }

    #[test]
    fn wrong_arguments_say_what_is_right() {
        for (from, to, text) in [
            ("https://lab", "lab", "https://lab:7070"),
            ("--display pluto", "--display ../x", "1 to 63 characters"),
            ("515nm", "515", "write 515nm"),
            ("150mm", "0mm", "must not be 0"),
            ("--device bench-7", "--device bench-7 --kernel a/b", "1 to 63 characters"),
            ("3d4017", "3D4017", "64 hexadecimal digits"),
            ("--device bench-7", "--device bench-7 --format lpk", "safetensors"),
            ("--device bench-7", "--device bench-7 --client-cert x.pem", "--client-key"),
            ("--device bench-7", "", "--device"),
        ] {
            let line = GOOD.replacen(from, to, 1);
            let error = parsed(&line).unwrap_err().to_string();
            assert!(error.contains(text), "{line}: {error}");
        }
        assert!(parsed("lightpath-agent").unwrap_err().to_string().contains("--server"));
    }
}
