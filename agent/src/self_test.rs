//! The device's own test of a kernel, before it is used.

use crate::http::one_line;
use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};
use std::io::{self, Read as _};
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc;
use std::thread;
use std::time::{Duration, Instant};

/// Limit on the output that is kept \[bytes\].
const OUTPUT_BYTES_MAX: u64 = 64 << 10;
/// Time between two looks at the program.
const LOOK: Duration = Duration::from_millis(10);
/// Time for the rest of the output after the program has ended.
const REST: Duration = Duration::from_secs(1);
/// Limit on the last line of the output in a message \[characters\].
const LINE_CHARS_MAX: usize = 300;

/// What a test said about a kernel.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Verdict {
    /// The kernel is good. The loss is that of the line `loss NUMBER`, if there is one.
    Good(Option<f64>),
    /// The kernel must not be used, for this reason.
    Bad(String),
}

/// Runs `program` with the path of the kernel as its argument.
///
/// # Errors
///
/// That of the system, if the program cannot be started. It says nothing about the kernel.
pub(crate) fn run(program: &Path, kernel: &Path, limit: Duration) -> io::Result<Verdict> {
    let mut command = Command::new(program);
    // A group of its own, so that the programs which the test starts end with it.
    command.arg(kernel).stdin(Stdio::null()).stdout(Stdio::piped()).process_group(0);
    let mut child = command.spawn()?;
    let output = collect(&mut child);
    let ended = wait(&mut child, limit);
    let output = output.recv_timeout(REST).unwrap_or_default();
    let text = match ended {
        Ok(Some(status)) if status.success() => return Ok(Verdict::Good(loss(&output))),
        Ok(Some(status)) => status.to_string(),
        Ok(None) => format!("no end within {} s", limit.as_secs_f64()),
        Err(error) => error.to_string(),
    };
    let last = output.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or_default();
    Ok(Verdict::Bad(one_line(&format!("{text}: {last}"), LINE_CHARS_MAX).trim_end_matches(':').to_owned()))
}

/// Reads the output in a thread of its own, so that a program with much output does not wait for ever.
fn collect(child: &mut Child) -> mpsc::Receiver<String> {
    let (sender, receiver) = mpsc::channel();
    if let Some(mut stdout) = child.stdout.take() {
        thread::spawn(move || {
            let mut bytes = Vec::new();
            let _ = stdout.by_ref().take(OUTPUT_BYTES_MAX).read_to_end(&mut bytes);
            let _ = sender.send(String::from_utf8_lossy(&bytes).into_owned());
            let _ = io::copy(&mut stdout, &mut io::sink());
        });
    }
    receiver
}

/// Waits for the end of the program, and ends what it started: nothing may change the kernel afterwards. `None`: it ran
/// past its limit and was killed.
fn wait(child: &mut Child, limit: Duration) -> io::Result<Option<ExitStatus>> {
    let pid = i32::try_from(child.id()).ok().and_then(Pid::from_raw);
    let pid = pid.ok_or_else(|| io::Error::other("the system gave the program no id"))?;
    let has_ended = wait_for_end(pid, limit)?;
    // Until the program is waited for, no other gets the number of its group.
    let _ = kill_process_group(pid, Signal::KILL);
    let status = child.wait()?;
    Ok(has_ended.then_some(status))
}

/// Waits until a program has ended, which keeps its number. False: it ran past its limit.
fn wait_for_end(pid: Pid, limit: Duration) -> io::Result<bool> {
    let begin = Instant::now();
    let look = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
    loop {
        if waitid(WaitId::Pid(pid), look)?.is_some() {
            return Ok(true);
        }
        if begin.elapsed() >= limit {
            return Ok(false);
        }
        thread::sleep(LOOK);
    }
}

/// The number of the last line `loss NUMBER`, which must not be negative.
fn loss(output: &str) -> Option<f64> {
    let mut numbers = output.lines().filter_map(|line| line.trim().strip_prefix("loss ")?.trim().parse::<f64>().ok());
    numbers.rfind(|loss| loss.is_finite() && *loss >= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt as _;

    fn verdict(script: &str, limit_ms: u64) -> Verdict {
        let folder = tempfile::tempdir().unwrap();
        let program = folder.path().join("test");
        std::fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o700)).unwrap();
        run(&program, Path::new("/kernel"), Duration::from_millis(limit_ms)).unwrap()
    }

    #[test]
    fn exit_status_decides_and_the_loss_is_read() {
        assert_eq!(verdict("echo begin; echo loss 0.5; echo loss 0.0123", 10_000), Verdict::Good(Some(0.0123)));
        assert_eq!(verdict("test $1 = /kernel; echo loss none", 10_000), Verdict::Good(None));
        let bad = Verdict::Bad("exit status: 3: too blurred".to_owned());
        assert_eq!(verdict("echo too blurred; exit 3", 10_000), bad);
        assert_eq!(verdict("exit 1", 10_000), Verdict::Bad("exit status: 1".to_owned()));
        assert_eq!(verdict("head -c 1000000 /dev/zero; exit 0", 10_000), Verdict::Good(None));
    }

    #[test]
    fn programs_that_hang_refuse_the_kernel_and_missing_ones_say_nothing_about_it() {
        let begin = Instant::now();
        assert_eq!(verdict("echo wait; sleep 60", 200), Verdict::Bad("no end within 0.2 s: wait".to_owned()));
        assert!(begin.elapsed() < Duration::from_secs(20), "the program that the test started ended, too");
        let missing = run(Path::new("/missing"), Path::new("/kernel"), Duration::from_secs(1));
        assert_eq!(missing.unwrap_err().kind(), io::ErrorKind::NotFound);
    }
}
