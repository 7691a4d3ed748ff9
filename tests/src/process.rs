//! Runs the programs `lightpath`, `lightpathd`, `lightpath-agent` and `lightpath-rig` as processes.

use lightpath::Client;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};
use std::sync::OnceLock;
use tokio::io::{AsyncBufReadExt as _, BufReader};
use tokio::process::{Child, Command};

/// Path of a program of this workspace.
///
/// `LIGHTPATH_BINARIES` names the folder of the programs. Without it they are built in the profile of the tests.
fn binary(name: &str) -> PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    let given = || std::env::var_os("LIGHTPATH_BINARIES").map(PathBuf::from);
    FOLDER.get_or_init(|| given().unwrap_or_else(build_binaries)).join(name)
}

fn build_binaries() -> PathBuf {
    // The test program is target/{profile}/deps/end_to_end-….
    let test = std::env::current_exe().unwrap();
    let folder = test.ancestors().nth(2).unwrap().to_owned();
    let mut cargo = std::process::Command::new(env!("CARGO"));
    cargo.args(["build", "--quiet", "--locked", "--bins"]).current_dir(env!("CARGO_MANIFEST_DIR").to_owned() + "/..");
    if folder.ends_with("release") {
        cargo.arg("--release");
    }
    assert!(cargo.status().unwrap().success(), "the binaries cannot be built");
    folder
}

/// The command `lightpath` with these arguments. It is killed when its handle is dropped.
pub(crate) fn lightpath_command(server: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new(binary("lightpath"));
    command.args(["--server", server]).args(arguments).env_remove("LIGHTPATH_TOKEN_FILE").stdin(Stdio::null());
    command.kill_on_drop(true);
    command
}

/// Runs `lightpath` on a terminal with this many columns, and returns what the terminal shows. Needs `script` of
/// util-linux.
pub(crate) fn lightpath_on_terminal(server: &str, columns: usize, line: &str) -> String {
    let program = binary("lightpath");
    let command = format!("stty rows 40 cols {columns}; {} --server {server} {line}", program.display());
    let mut script = std::process::Command::new("script");
    let output = script.args(["--quiet", "--return", "--command", &command, "/dev/null"]).stdin(Stdio::null()).output();
    String::from_utf8(output.unwrap().stdout).unwrap().replace('\r', "")
}

/// Runs `lightpath` with these arguments.
pub(crate) async fn lightpath(server: &str, arguments: &[&str]) -> CommandOutput {
    let Output { status, stdout, stderr } = lightpath_command(server, arguments).output().await.unwrap();
    CommandOutput {
        command: arguments.join(" "),
        code: status.code(),
        stdout: String::from_utf8(stdout).unwrap(),
        stderr: String::from_utf8(stderr).unwrap(),
    }
}

/// Runs `lightpathd` with these arguments.
pub(crate) async fn lightpathd(arguments: &[&str]) -> CommandOutput {
    let mut command = Command::new(binary("lightpathd"));
    let Output { status, stdout, stderr } = command.args(arguments).stdin(Stdio::null()).output().await.unwrap();
    CommandOutput {
        command: arguments.join(" "),
        code: status.code(),
        stdout: String::from_utf8(stdout).unwrap(),
        stderr: String::from_utf8(stderr).unwrap(),
    }
}

/// The command `lightpathd` with these arguments. It is killed when its handle is dropped.
pub(crate) fn lightpathd_command(arguments: &[&str]) -> Command {
    let mut command = Command::new(binary("lightpathd"));
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).kill_on_drop(true);
    command
}

/// Starts `lightpath-agent` with these arguments. It is killed when the handle is dropped.
pub(crate) fn agent(arguments: &[&str]) -> Child {
    let mut command = Command::new(binary("lightpath-agent"));
    command.args(arguments).stdin(Stdio::null()).stderr(Stdio::null()).kill_on_drop(true).spawn().unwrap()
}

/// Starts `lightpath-rig` with these arguments. It is killed when the handle is dropped.
pub(crate) fn rig(arguments: &[&str]) -> Child {
    let mut command = Command::new(binary("lightpath-rig"));
    command.args(arguments).stdin(Stdio::null()).stderr(Stdio::null()).kill_on_drop(true).spawn().unwrap()
}

/// Exit code and output of a command that has ended.
#[derive(Debug)]
pub(crate) struct CommandOutput {
    pub(crate) command: String,
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl CommandOutput {
    /// Checks that the command succeeded, and returns its output.
    pub(crate) fn ok(self) -> String {
        assert_eq!(self.code, Some(0), "{self:#?}");
        self.stdout
    }

    /// Checks that the command succeeded, and returns the JSON document that it printed.
    pub(crate) fn json(self) -> serde_json::Value {
        let command = self.command.clone();
        serde_json::from_str(&self.ok()).unwrap_or_else(|error| panic!("{command}: {error}"))
    }

    /// Checks that the command ended with this code, printed all of `signs` on stderr, and printed nothing on stdout.
    pub(crate) fn assert_refused(self, code: i32, signs: &[&str]) {
        assert_eq!(self.code, Some(code), "{self:#?}");
        assert_eq!(self.stdout, "", "{self:#?}");
        for sign in signs {
            assert!(self.stderr.contains(sign), "{sign:?} is not in {self:#?}");
        }
    }
}

/// A running `lightpathd serve`. It is killed when dropped.
pub(crate) struct Daemon {
    pub(crate) client: Client,
    pub(crate) url: String,
    child: Child,
}

impl Daemon {
    /// Starts the server on a free port, and returns when it listens.
    pub(crate) async fn start(data_dir: &Path, settings: &[&str]) -> Self {
        Self::start_at(data_dir, "127.0.0.1:0", settings).await
    }

    /// Starts the server at an address, and returns when it listens.
    pub(crate) async fn start_at(data_dir: &Path, address: &str, settings: &[&str]) -> Self {
        let mut command = Command::new(binary("lightpathd"));
        command.args(["serve", "--listen", address, "--log-level", "error", "--data-dir"]).arg(data_dir);
        command.args(settings).stdin(Stdio::null()).stdout(Stdio::piped()).kill_on_drop(true);
        let mut child = command.spawn().unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let line = lines.next_line().await.unwrap().expect("lightpathd ended before it listened");
        let url = line.strip_prefix("listening on ").expect("lightpathd prints its address").to_owned();
        Self { client: Client::connect(&url).unwrap(), url, child }
    }

    /// Largest memory of the process so far \[KiB\].
    pub(crate) fn memory_peak_kib(&self) -> u64 {
        self.status("VmHWM")
    }

    /// Forgets the largest memory so far: [`Self::memory_peak_kib`] counts from now on.
    pub(crate) fn forget_memory_peak(&self) {
        std::fs::write(format!("/proc/{}/clear_refs", self.id()), "5").unwrap();
    }

    /// Current memory of the process \[KiB\].
    pub(crate) fn memory_kib(&self) -> u64 {
        self.status("VmRSS")
    }

    /// Number of open files and connections.
    pub(crate) fn open_files(&self) -> usize {
        std::fs::read_dir(format!("/proc/{}/fd", self.id())).unwrap().count()
    }

    /// A number from `/proc/{id}/status`.
    fn status(&self, field: &str) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.id())).unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix(field)).expect("/proc has the field");
        line.trim_matches(|c: char| !c.is_ascii_digit()).parse().unwrap()
    }

    fn id(&self) -> u32 {
        self.child.id().expect("lightpathd runs")
    }

    /// Sends the process a signal, for example `STOP`.
    pub(crate) fn signal(&self, name: &str) {
        let id = self.id().to_string();
        let sent = std::process::Command::new("kill").args(["-s", name, &id]).status().unwrap();
        assert!(sent.success(), "kill -s {name} {id}");
    }

    /// Stops the server with SIGTERM, and returns when the process has ended well.
    pub(crate) async fn stop(mut self) {
        self.signal("TERM");
        assert!(self.child.wait().await.unwrap().success());
    }

    /// Waits for the end of the process.
    pub(crate) async fn wait(&mut self) {
        self.child.wait().await.unwrap();
    }

    /// Kills the process with SIGKILL.
    pub(crate) async fn kill(mut self) {
        self.child.kill().await.unwrap();
    }
}
