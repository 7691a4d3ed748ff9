//! Named points before every flush, rename, removal and commit. At each point a test can make the process die or the
//! call fail.
//!
//! A point has no effect until [`arm_by_environment`] is called. Only tests call it, in a process that they start for
//! this.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Write as _};
use std::sync::{Mutex, OnceLock, PoisonError};

/// Environment variable that selects the failure: `NAME:COUNT:die` or `NAME:COUNT:fail`. The process dies or the call
/// fails when the point `NAME` is passed for the `COUNT`-th time.
pub const POINT: &str = "LIGHTPATH_FAIL_POINT";
/// Environment variable with the path of a file. A line is appended to the file for each point that is passed.
pub const PASSED: &str = "LIGHTPATH_FAIL_PASSED";

static ARMED: OnceLock<Armed> = OnceLock::new();

/// A point of the program at which the state of the disk matters. It fails only if a test has armed the process.
///
/// # Errors
///
/// The error that a test has requested for this point.
#[inline]
pub fn point(name: &'static str) -> io::Result<()> {
    ARMED.get().map_or(Ok(()), |armed| armed.pass(name))
}

/// Reads the environment: from now on points fail as [`POINT`] says, and are logged to the file in [`PASSED`].
///
/// # Errors
///
/// An error if [`PASSED`] names a file that cannot be opened, or [`POINT`] is malformed.
pub fn arm_by_environment() -> io::Result<()> {
    let open = |path| File::options().create(true).append(true).open(path);
    let passed = std::env::var_os(PASSED).map(open).transpose()?;
    let failure = std::env::var(POINT).ok().map(|text| Failure::parse(&text)).transpose()?;
    ARMED.get_or_init(|| Armed { failure, passed, counts: Mutex::default() });
    Ok(())
}

/// Kind of a failure at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FailureKind {
    Die,
    Fail,
}

/// A failure to be caused: the point, the passage and the kind.
#[derive(Debug)]
struct Failure {
    point: String,
    passage: u32,
    kind: FailureKind,
}

impl Failure {
    fn parse(text: &str) -> io::Result<Self> {
        let wrong = || io::Error::other(format!("{POINT} is {text}, but must be NAME:COUNT:die or NAME:COUNT:fail"));
        let [point, passage, kind] = text.split(':').collect::<Vec<_>>()[..] else { return Err(wrong()) };
        let kind = match kind {
            "die" => FailureKind::Die,
            "fail" => FailureKind::Fail,
            _ => return Err(wrong()),
        };
        Ok(Self { point: point.to_owned(), passage: passage.parse().map_err(|_| wrong())?, kind })
    }
}

/// Fail points of a process that a test has armed.
#[derive(Debug)]
struct Armed {
    failure: Option<Failure>,
    passed: Option<File>,
    counts: Mutex<HashMap<&'static str, u32>>,
}

impl Armed {
    fn pass(&self, name: &'static str) -> io::Result<()> {
        let mut counts = self.counts.lock().unwrap_or_else(PoisonError::into_inner);
        let count = counts.entry(name).or_default();
        *count += 1;
        if let Some(mut passed) = self.passed.as_ref() {
            writeln!(passed, "{name}")?;
        }
        match &self.failure {
            Some(failure) if failure.point == name && failure.passage == *count => match failure.kind {
                FailureKind::Die => std::process::abort(),
                FailureKind::Fail => Err(io::Error::other(format!("{name} failed because a test requested it"))),
            },
            _ => Ok(()),
        }
    }
}
