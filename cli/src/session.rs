//! The connection to the server, and the forms of output.

use super::failure::Failure;
use super::show;
use clap::ValueEnum;
use lightpath::v1::Job;
use lightpath::{Client, Credentials};
use serde::Serialize;
use std::cell::Cell;
use std::io::{self, IsTerminal as _, Write as _};
use std::path::Path;
use std::pin::pin;
use std::time::Duration;
use tokio::time::{Instant, interval_at};

/// Interval between lines about what takes long.
pub(crate) const LINES: Duration = Duration::from_secs(10);

/// Form of the output on stdout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Output {
    /// Print tables for people, fitted to the terminal.
    Table,
    /// Print one document of messages in protobuf's JSON form.
    Json,
    /// Print the same messages as lines of JSON: one for each job, pair or entry of a list.
    Jsonl,
}

/// The client and the form of output of a command.
#[derive(Debug)]
pub(crate) struct Session {
    pub(crate) client: Client,
    pub(crate) output: Output,
    pub(crate) stdout: Stdout,
}

/// What standard output is used for: text, or one file.
#[derive(Debug, Default)]
pub(crate) struct Stdout {
    holds_file: Cell<bool>,
    is_json: bool,
}

/// Several jobs as one document, in the form of a list of jobs.
#[derive(Serialize)]
struct Jobs<'a> {
    jobs: &'a [Job],
}

impl Session {
    pub(crate) fn open(
        url: &str,
        token_file: Option<&Path>,
        authority: Option<&Path>,
        certificate_and_key: Option<(&Path, &Path)>,
        token_over_http: bool,
        output: Output,
    ) -> Result<Self, Failure> {
        let token = token_file
            .map(read)
            .transpose()?
            .map(|bytes| String::from_utf8(bytes).map_err(|_| lightpath::Error::Token));
        let credentials = Credentials {
            token: token.transpose()?,
            authority_pem: authority.map(read).transpose()?,
            certificate_and_key_pem: match certificate_and_key {
                None => None,
                Some((certificate, key)) => Some((read(certificate)?, read(key)?)),
            },
            token_over_http,
        };
        let stdout = Stdout { holds_file: Cell::new(false), is_json: output != Output::Table };
        Ok(Self { client: Client::connect_as(url, &credentials)?, output, stdout })
    }

    /// Stores a file's content on the server and returns its digest. A long upload prints a line every ten seconds.
    pub(crate) async fn upload(&self, path: &Path) -> lightpath::Result<String> {
        let begin = Instant::now();
        let (mut upload, mut lines) = (pin!(self.client.upload_file(path)), interval_at(begin + LINES, LINES));
        loop {
            tokio::select! {
                digest = &mut upload => return digest,
                _ = lines.tick() => {
                    let so_far = show::about(begin.elapsed().as_secs_f64());
                    print_note(&format!("uploading {}: {so_far} so far", path.display()));
                }
            }
        }
    }

    /// True if the command prints messages instead of text for people.
    pub(crate) fn is_json(&self) -> bool {
        self.output != Output::Table
    }

    /// Prints a message: as an indented JSON document, as a line of JSON, or as the text that `text` returns.
    pub(crate) fn print<M: Serialize>(&self, message: &M, text: impl FnOnce(&M) -> String) -> Result<(), Failure> {
        match self.output {
            Output::Json => self.write(&json(serde_json::to_string_pretty(message))?),
            Output::Jsonl => self.print_compact(message),
            Output::Table => self.write(&show::plain_lines(text(message).trim_end())),
        }
    }

    /// Prints a list: as one document, as a line for each of its items, or as text.
    pub(crate) fn print_list<M: Serialize, T: Serialize>(
        &self,
        list: &M,
        items: impl FnOnce(&M) -> &[T],
        text: impl FnOnce(&M) -> String,
    ) -> Result<(), Failure> {
        match self.output {
            Output::Jsonl => items(list).iter().try_for_each(|item| self.print_line(item)),
            Output::Json | Output::Table => self.print(list, text),
        }
    }

    /// Prints jobs: one as itself, several as a document with the field `jobs`, or each as a line; or else the text.
    pub(crate) fn print_jobs(&self, jobs: &[Job], text: &str) -> Result<(), Failure> {
        match (self.output, jobs) {
            (Output::Table, _) => self.print_text(text),
            (Output::Json, [job]) => self.print(job, |_| String::new()),
            (Output::Json, jobs) => self.print(&Jobs { jobs }, |_| String::new()),
            (Output::Jsonl, jobs) => jobs.iter().try_for_each(|job| self.print_line(job)),
        }
    }

    /// Prints a message as one line of JSON. Prints nothing in the other forms.
    pub(crate) fn print_line<M: Serialize>(&self, message: &M) -> Result<(), Failure> {
        match self.output {
            Output::Jsonl => self.print_compact(message),
            Output::Json | Output::Table => Ok(()),
        }
    }

    /// Prints a message as one line of JSON, in all forms: for commands that print without end.
    pub(crate) fn print_compact<M: Serialize>(&self, message: &M) -> Result<(), Failure> {
        self.write(&json(serde_json::to_string(message))?)
    }

    /// Prints text for people. Prints nothing in the JSON forms.
    pub(crate) fn print_text(&self, text: &str) -> Result<(), Failure> {
        if self.is_json() { Ok(()) } else { self.write(&show::plain_lines(text.trim_end())) }
    }

    /// Prints that something was done: the answer in the JSON forms, or a note.
    pub(crate) fn print_done<M: Serialize>(&self, answer: &M, note: &str) -> Result<(), Failure> {
        if self.is_json() {
            return self.print(answer, |_| String::new());
        }
        print_note(note);
        Ok(())
    }

    /// Writes to stdout, or to stderr if stdout holds a file.
    fn write(&self, text: &str) -> Result<(), Failure> {
        if self.stdout.holds_file.get() {
            print_note(text);
            return Ok(());
        }
        let mut stdout = io::stdout().lock();
        writeln!(stdout, "{text}").and_then(|()| stdout.flush()).map_err(Failure::Output)
    }
}

impl Stdout {
    /// Reserves stdout for a file, so that text goes to stderr. `option` is the option that asked for it.
    pub(crate) fn reserve(&self, option: &str) -> Result<(), Failure> {
        if self.is_json {
            return Err(Failure::Usage(format!(
                "{option} - writes the file to standard output, where JSON would be, too; leave out --output or name a file"
            )));
        }
        if self.holds_file.replace(true) {
            return Err(Failure::Usage("two files cannot both go to standard output: name a file for one".to_owned()));
        }
        if io::stdout().is_terminal() {
            return Err(Failure::Usage(format!(
                "{option} - would write a binary file to the terminal: name a file, or send the output elsewhere with > or |"
            )));
        }
        Ok(())
    }

    /// Writes the file that stdout was reserved for.
    pub(crate) fn write_file(bytes: &[u8]) -> Result<(), Failure> {
        let mut stdout = io::stdout().lock();
        stdout.write_all(bytes).and_then(|()| stdout.flush()).map_err(Failure::Output)
    }
}

fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    let read_error = |source| lightpath::Error::File { action: "read", path: path.to_owned(), source };
    Ok(std::fs::read(path).map_err(read_error)?)
}

/// Prints a note for people on stderr, in all forms of output.
pub(crate) fn print_note(text: &str) {
    // If stderr fails, the error cannot be reported anywhere.
    let _ = writeln!(io::stderr().lock(), "{}", show::plain_lines(text));
}

fn json(text: serde_json::Result<String>) -> Result<String, Failure> {
    text.map_err(|error| Failure::Output(io::Error::other(error)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stdout_holds_one_file_and_no_json() {
        let json = Stdout { is_json: true, ..Stdout::default() };
        assert!(matches!(json.reserve("-o"), Err(Failure::Usage(text)) if text.contains("JSON")));
        let taken = Stdout { holds_file: Cell::new(true), is_json: false };
        assert!(matches!(taken.reserve("--npy"), Err(Failure::Usage(text)) if text.contains("two files")));
    }
}
