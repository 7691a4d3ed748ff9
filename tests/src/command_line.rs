//! Runs the command line against its own server, with files in its own folder.

use crate::process::{CommandOutput, lightpath};
use crate::server::TestServer;
use lightpath_server::config::Config;
use serde_json::Value;
use std::path::PathBuf;
use tempfile::TempDir;

/// A server and a folder for the files of commands.
pub(crate) struct CommandLine {
    pub(crate) server: TestServer,
    folder: TempDir,
}

impl CommandLine {
    pub(crate) async fn start() -> Self {
        Self::start_with(|_| ()).await
    }

    /// Starts with settings of the server that `change` has modified.
    pub(crate) async fn start_with(change: impl FnOnce(&mut Config)) -> Self {
        Self { server: TestServer::with(change).await, folder: TempDir::new().unwrap() }
    }

    /// Path of a file in the folder.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file into the folder and returns its path.
    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> String {
        let path = self.path(name);
        std::fs::write(&path, bytes).unwrap();
        path.to_str().unwrap().to_owned()
    }

    /// Names of the files in the folder, sorted.
    pub(crate) fn file_names(&self) -> Vec<std::ffi::OsString> {
        let entries = std::fs::read_dir(self.folder.path()).unwrap();
        let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        names
    }

    /// Runs a command whose arguments are separated by spaces. `@` stands for the folder.
    pub(crate) async fn run(&self, line: &str) -> CommandOutput {
        let folder = self.folder.path().to_str().unwrap();
        let arguments: Vec<String> = line.split_whitespace().map(|part| part.replace('@', folder)).collect();
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        lightpath(self.server.url(), &arguments).await
    }

    /// Runs a command that must succeed, and returns what it printed.
    pub(crate) async fn text(&self, line: &str) -> String {
        self.run(line).await.ok()
    }

    /// Runs a command that must succeed, and returns the JSON that it printed.
    pub(crate) async fn json(&self, line: &str) -> Value {
        self.run(&format!("--output json {line}")).await.json()
    }
}
