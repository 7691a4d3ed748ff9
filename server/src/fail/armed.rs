//! What a point does in a process that was told so by its environment.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Write as _};
use std::sync::{Mutex, OnceLock, PoisonError};

/// `NAME:COUNT:die` or `NAME:COUNT:fail`: at the COUNTth time that the point is passed.
pub(super) const POINT: &str = "LIGHTPATH_FAIL_POINT";
/// A file that gets a line for each point that is passed.
pub(super) const PASSED: &str = "LIGHTPATH_FAIL_PASSED";

/// Dies or fails where the environment says so.
pub(crate) fn point(name: &'static str) -> io::Result<()> {
    static ARMED: OnceLock<Option<Armed>> = OnceLock::new();
    match ARMED.get_or_init(Armed::by_environment) {
        Some(armed) => armed.pass(name),
        None => Ok(()),
    }
}

/// How a point breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Break {
    Die,
    Fail,
}

struct Armed {
    at: Option<(String, u32, Break)>,
    passed: Option<File>,
    counts: Mutex<HashMap<&'static str, u32>>,
}

impl Armed {
    fn by_environment() -> Option<Self> {
        let passed = std::env::var_os(PASSED).map(|path| File::options().create(true).append(true).open(path).unwrap());
        let at = std::env::var(POINT).ok().map(|text| {
            let [name, count, how] = text.split(':').collect::<Vec<_>>()[..] else { panic!("{POINT} is {text}") };
            let how = if how == "die" { Break::Die } else { Break::Fail };
            (name.to_owned(), count.parse().unwrap(), how)
        });
        (passed.is_some() || at.is_some()).then(|| Self { at, passed, counts: Mutex::default() })
    }

    fn pass(&self, name: &'static str) -> io::Result<()> {
        let mut counts = self.counts.lock().unwrap_or_else(PoisonError::into_inner);
        let count = counts.entry(name).or_default();
        *count += 1;
        if let Some(mut passed) = self.passed.as_ref() {
            writeln!(passed, "{name}")?;
        }
        match &self.at {
            Some((wanted, at, Break::Die)) if wanted == name && at == count => std::process::abort(),
            Some((wanted, at, Break::Fail)) if wanted == name && at == count => {
                Err(io::Error::other(format!("{name} fails, as the test wants it")))
            }
            _ => Ok(()),
        }
    }
}
