//! The command line of the program `lightpath-rig`.

use clap::{Args, Parser, Subcommand};
use std::path::PathBuf;

const EXAMPLES: &str = "\
The first ten minutes, without hardware:
  lightpath-rig init                  writes rig.toml, with a simulated bench
  lightpath-rig check                 shows and photographs once
  lightpathd token create bench-1 --role rig --display lab
  LIGHTPATH_TOKEN=lp_… lightpath-rig serve

While you work at the bench:
  lightpath-rig pause --reason \"aligning, Ada\"
  lightpath-rig resume

Exit codes: 0 ended as asked, 2 wrong settings, 3 the server refuses this rig for good (token, display, another rig), \
4 devices cannot be used.";

/// Show patterns and take photographs at the bench of a display.
///
/// The program runs at the computer with SLM and camera. It connects out to the server, shows the patterns that the
/// server asks for, photographs them and uploads the photographs. What it drives, and what it must never do, is in its
/// own file, rig.toml. After a lost link it connects again; the bench is in its safe state whenever nothing is to be
/// done.
#[derive(Debug, Parser)]
#[command(name = "lightpath-rig", version, max_term_width = 80, after_long_help = EXAMPLES, subcommand_required = true)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Write a commented example of rig.toml
    Init(SettingsArguments),
    /// Show a pattern and photograph it, without a server, and print what was measured
    Check(SettingsArguments),
    /// Photograph for the server, until this program is ended
    Serve(ServeArguments),
    /// Let requests wait while a person works at the bench, after it has become safe
    Pause(PauseArguments),
    /// End a pause
    Resume(SettingsArguments),
}

/// Where the rig's file is.
#[derive(Clone, Debug, Args)]
pub(crate) struct SettingsArguments {
    /// The file that describes the bench
    #[arg(long, env = "LIGHTPATH_RIG_SETTINGS", value_name = "FILE", default_value = "rig.toml")]
    pub(crate) settings: PathBuf,
}

#[derive(Clone, Debug, Args)]
pub(crate) struct PauseArguments {
    #[command(flatten)]
    pub(crate) settings: SettingsArguments,
    /// Who works at the bench and why, for example "aligning, Ada"
    #[arg(long, value_name = "TEXT")]
    pub(crate) reason: String,
}

/// How the server is reached.
#[derive(Clone, Args)]
pub(crate) struct ServeArguments {
    #[command(flatten)]
    pub(crate) settings: SettingsArguments,
    /// Access token, of the role rig for this display; better in the environment or in a file, where no list of processes
    /// shows it
    #[arg(long, env = "LIGHTPATH_TOKEN", value_name = "TOKEN", hide_env_values = true)]
    pub(crate) token: Option<String>,
    /// Read the access token from this file; it counts before LIGHTPATH_TOKEN
    #[arg(long, env = "LIGHTPATH_TOKEN_FILE", value_name = "FILE")]
    pub(crate) token_file: Option<PathBuf>,
    /// Trust the certificate authority in this PEM file, besides those of the system
    #[arg(long, env = "LIGHTPATH_CA_FILE", value_name = "FILE")]
    pub(crate) ca_file: Option<PathBuf>,
    /// Send the client certificate in this PEM file, for a server that requires one; needs --client-key
    #[arg(long, env = "LIGHTPATH_CLIENT_CERT", value_name = "FILE", requires = "client_key")]
    pub(crate) client_cert: Option<PathBuf>,
    /// Use the private key in this PEM file for --client-cert
    #[arg(long, env = "LIGHTPATH_CLIENT_KEY", value_name = "FILE", requires = "client_cert")]
    pub(crate) client_key: Option<PathBuf>,
    /// Send the token unencrypted to another machine; only if nobody else is on the network
    #[arg(long, env = "LIGHTPATH_TOKEN_OVER_HTTP")]
    pub(crate) token_over_http: bool,
}

/// Hides the token.
impl std::fmt::Debug for ServeArguments {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ServeArguments").field("settings", &self.settings).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory as _;

    #[test]
    fn help_is_complete_and_tokens_are_not_shown() {
        Cli::command().debug_assert();
        lightpath_program_docs::check_help(Cli::command()).unwrap_or_else(|mistakes| panic!("{mistakes}"));
        let words = ["lightpath-rig", "serve", "--token", "lp_secret"];
        let parsed = Cli::try_parse_from(words).unwrap();
        assert!(!format!("{parsed:?}").contains("secret"));
        assert!(Cli::try_parse_from(["lightpath-rig", "pause"]).unwrap_err().to_string().contains("--reason"));
    }
}
