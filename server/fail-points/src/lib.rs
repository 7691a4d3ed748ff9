//! Named places before every flush, rename, removal and commit, at which a test can make the process die or the call fail.
//!
//! Nothing happens at a point until [`arm_by_environment`] is called, which only tests do, in a process that they
//! start for this.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Write as _};
use std::sync::{Mutex, OnceLock, PoisonError};

/// Environment variable that says what breaks: `NAME:COUNT:die` or `NAME:COUNT:fail`, at the COUNTth time that the point is passed.
pub const POINT: &str = "LIGHTPATH_FAIL_POINT";
/// Environment variable with the path of a file that gets a line for each point that is passed.
pub const PASSED: &str = "LIGHTPATH_FAIL_PASSED";

static ARMED: OnceLock<Armed> = OnceLock::new();

/// A place at which it matters what is on disk.
///
/// # Errors
///
/// Never, unless a test has armed the process.
#[inline]
pub fn point(name: &'static str) -> io::Result<()> {
    ARMED.get().map_or(Ok(()), |armed| armed.pass(name))
}

/// From now on points break as [`POINT`] says, and are written down where [`PASSED`] says.
///
/// # Errors
///
/// [`PASSED`] names a file that cannot be opened, or [`POINT`] has another form.
pub fn arm_by_environment() -> io::Result<()> {
    let open = |path| File::options().create(true).append(true).open(path);
    let passed = std::env::var_os(PASSED).map(open).transpose()?;
    let at = std::env::var(POINT).ok().map(|text| Breakage::parse(&text)).transpose()?;
    ARMED.get_or_init(|| Armed { at, passed, counts: Mutex::default() });
    Ok(())
}

/// How a point breaks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum How {
    Die,
    Fail,
}

/// Which passage of which point breaks, and how.
#[derive(Debug)]
struct Breakage {
    point: String,
    passage: u32,
    how: How,
}

impl Breakage {
    fn parse(text: &str) -> io::Result<Self> {
        let wrong = || io::Error::other(format!("{POINT} is {text}, but must be NAME:COUNT:die or NAME:COUNT:fail"));
        let [point, passage, how] = text.split(':').collect::<Vec<_>>()[..] else { return Err(wrong()) };
        let how = match how {
            "die" => How::Die,
            "fail" => How::Fail,
            _ => return Err(wrong()),
        };
        Ok(Self { point: point.to_owned(), passage: passage.parse().map_err(|_| wrong())?, how })
    }
}

#[derive(Debug)]
struct Armed {
    at: Option<Breakage>,
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
        match &self.at {
            Some(at) if at.point == name && at.passage == *count => match at.how {
                How::Die => std::process::abort(),
                How::Fail => Err(io::Error::other(format!("{name} fails, as the test wants it"))),
            },
            _ => Ok(()),
        }
    }
}
