//! The connection to the server, the two forms of output, and lists over several pages.

use super::failure::Failure;
use clap::ValueEnum;
use lightpath::{Client, Credentials};
use serde::Serialize;
use std::io::{self, Write as _};
use std::path::Path;

/// Largest page that a command requests from the server.
const PAGE_SIZE_MAX: u32 = 1000;

/// Form of the output on stdout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Output {
    /// Print tables for people.
    Table,
    /// Print messages in protobuf's JSON form.
    Json,
}

/// The client and the form of output of a command.
#[derive(Debug)]
pub(crate) struct Session {
    pub(crate) client: Client,
    pub(crate) output: Output,
}

impl Session {
    pub(crate) fn open(
        url: &str,
        token_file: Option<&Path>,
        authority: Option<&Path>,
        certificate_and_key: Option<(&Path, &Path)>,
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
        };
        Ok(Self { client: Client::connect_as(url, &credentials)?, output })
    }

    pub(crate) fn is_json(&self) -> bool {
        self.output == Output::Json
    }

    /// Prints a message: as an indented JSON document, or as the text that `text` returns.
    pub(crate) fn print<M: Serialize>(&self, message: &M, text: impl FnOnce(&M) -> String) -> Result<(), Failure> {
        match self.output {
            Output::Json => write_out(&json(serde_json::to_string_pretty(message))?),
            Output::Table => write_out(text(message).trim_end()),
        }
    }

    /// Prints a message as one line of JSON, for commands that print several. Prints nothing in the table form.
    pub(crate) fn print_json_line<M: Serialize>(&self, message: &M) -> Result<(), Failure> {
        match self.output {
            Output::Json => write_out(&json(serde_json::to_string(message))?),
            Output::Table => Ok(()),
        }
    }

    /// Prints text for people. Prints nothing in the JSON form.
    pub(crate) fn print_text(&self, text: &str) -> Result<(), Failure> {
        match self.output {
            Output::Json => Ok(()),
            Output::Table => write_out(text.trim_end()),
        }
    }
}

fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    Ok(std::fs::read(path).map_err(|source| lightpath::Error::File {
        action: "read",
        path: path.to_owned(),
        source,
    })?)
}

/// Prints a note for people on stderr, in both forms of output.
pub(crate) fn print_note(text: &str) {
    // If stderr fails, the error cannot be reported anywhere.
    let _ = writeln!(io::stderr().lock(), "{text}");
}

/// Requests pages until there are `limit` items, or all items if `limit` is 0. Returns the items and the token of the
/// next page.
pub(crate) async fn pages<T>(
    limit: u32,
    mut page: impl AsyncFnMut(u32, String) -> lightpath::Result<(Vec<T>, String)>,
) -> Result<(Vec<T>, String), Failure> {
    let limit = if limit == 0 { usize::MAX } else { limit as usize };
    let (mut items, mut token) = (Vec::new(), String::new());
    loop {
        let wanted = (limit - items.len()).min(PAGE_SIZE_MAX as usize) as u32;
        let (more, next) = page(wanted, token).await?;
        items.extend(more);
        token = next;
        if token.is_empty() || items.len() >= limit {
            return Ok((items, token));
        }
    }
}

/// The line below a list that was cut at its limit. Empty for a complete list.
pub(crate) fn more_hint(next_page_token: &str) -> &'static str {
    if next_page_token.is_empty() { "" } else { "(more entries exist: --limit 0 shows all)\n" }
}

fn json(text: serde_json::Result<String>) -> Result<String, Failure> {
    text.map_err(|error| Failure::Output(io::Error::other(error)))
}

fn write_out(text: &str) -> Result<(), Failure> {
    let mut stdout = io::stdout().lock();
    writeln!(stdout, "{text}").and_then(|()| stdout.flush()).map_err(Failure::Output)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn pages_are_joined_up_to_the_limit() {
        let all: Vec<u32> = (0..2500).collect();
        let ask = async |limit| {
            pages(limit, async |size, token: String| {
                let start: usize = token.parse().unwrap_or(0);
                let end = (start + size as usize).min(all.len());
                let next = if end < all.len() { end.to_string() } else { String::new() };
                Ok((all[start..end].to_vec(), next))
            })
            .await
            .unwrap()
        };
        assert_eq!(ask(0).await, (all.clone(), String::new()));
        assert_eq!(ask(1500).await, (all[..1500].to_vec(), "1500".to_owned()));
        assert_eq!(ask(3).await, (vec![0, 1, 2], "3".to_owned()));
    }
}
