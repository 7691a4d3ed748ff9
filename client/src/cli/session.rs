//! The connection to the server, and the two forms of output.

use super::failure::Failure;
use clap::ValueEnum;
use lightpath::{Client, Credentials};
use serde::Serialize;
use std::io::{self, Write as _};
use std::path::Path;

/// Most items that are asked for at once.
const PAGE_SIZE_MAX: u32 = 1000;

/// What stdout gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Output {
    /// Tables for people.
    Table,
    /// Protobuf's JSON form.
    Json,
}

/// What every command works with.
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

    /// One message, as an indented JSON document or as `text` makes it.
    pub(crate) fn print<M: Serialize>(&self, message: &M, text: impl FnOnce(&M) -> String) -> Result<(), Failure> {
        match self.output {
            Output::Json => write_out(&json(serde_json::to_string_pretty(message))?),
            Output::Table => write_out(text(message).trim_end()),
        }
    }

    /// One message as a JSON line, for commands that print several; nothing where people read.
    pub(crate) fn print_json_line<M: Serialize>(&self, message: &M) -> Result<(), Failure> {
        match self.output {
            Output::Json => write_out(&json(serde_json::to_string(message))?),
            Output::Table => Ok(()),
        }
    }

    /// Text for people; nothing where a program reads.
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

/// A remark for people, on stderr whatever the form of output.
pub(crate) fn say(text: &str) {
    // Nobody is left to tell when this fails.
    let _ = writeln!(io::stderr().lock(), "{text}");
}

/// Asks for page after page until `limit` items are there (0: all). Returns them with the token of the page after.
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

/// The line under a list that was cut.
pub(crate) fn more_hint(next_page_token: &str) -> &'static str {
    if next_page_token.is_empty() { "" } else { "(there are more: --limit 0 shows all)\n" }
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
