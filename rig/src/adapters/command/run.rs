//! Running a program until its end or its deadline.

use crate::device::{DeviceError, Result};
use rustix::process::{Pid, Signal, kill_process_group};
use std::io::Read as _;
use std::os::unix::process::CommandExt as _;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc;
use std::thread;
use std::time::{Duration, Instant};

/// Time between two looks at the program.
const LOOK: Duration = Duration::from_millis(2);
/// Time for the rest of what it writes after its end.
const REST: Duration = Duration::from_millis(500);
/// Limit on what is kept of stderr \[bytes\].
const STDERR_BYTES_MAX: u64 = 16 << 10;
/// Limit on what an error repeats of stderr \[characters\].
const SAID_CHARS_MAX: usize = 400;

/// Runs a program with its arguments, in which names are replaced by values.
pub(super) fn run(words: &[String], values: &[(&str, &str)], deadline: Instant) -> Result<()> {
    let replaced = |word: &String| values.iter().fold(word.clone(), |word, (name, value)| word.replace(name, value));
    let words: Vec<String> = words.iter().map(replaced).collect();
    let Some((program, arguments)) = words.split_first() else { return Err(DeviceError::new("no program is named")) };
    // A group of its own, so that what the program starts ends with it.
    let mut command = Command::new(program);
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).process_group(0);
    let mut child = command.spawn().map_err(|error| DeviceError(format!("{program} cannot be started: {error}")))?;
    let said = collect(&mut child);
    let ended = wait(&mut child, deadline);
    let said = said.recv_timeout(REST).unwrap_or_default();
    let said: String = said.trim().chars().take(SAID_CHARS_MAX).collect();
    match ended {
        Ok(Some(status)) if status.success() => Ok(()),
        Ok(Some(status)) => Err(DeviceError(format!("{program} ended with {status}: {said}"))),
        Ok(None) => Err(DeviceError(format!("{program} did not end in time and was stopped: {said}"))),
        Err(error) => Err(DeviceError(format!("{program}: {error}"))),
    }
}

/// Reads stderr in a thread of its own, so that a program that writes much does not wait for ever.
fn collect(child: &mut Child) -> mpsc::Receiver<String> {
    let (sender, receiver) = mpsc::channel();
    if let Some(mut stderr) = child.stderr.take() {
        thread::spawn(move || {
            let mut bytes = Vec::new();
            let _ = stderr.by_ref().take(STDERR_BYTES_MAX).read_to_end(&mut bytes);
            let _ = sender.send(String::from_utf8_lossy(&bytes).into_owned());
            let _ = std::io::copy(&mut stderr, &mut std::io::sink());
        });
    }
    receiver
}

/// Waits for the end; `None`: the program ran past its deadline and was killed with what it had started.
fn wait(child: &mut Child, deadline: Instant) -> std::io::Result<Option<ExitStatus>> {
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if Instant::now() >= deadline {
            // The program was not waited for yet, so no other has the number of its group.
            if let Some(pid) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) {
                let _ = kill_process_group(pid, Signal::KILL);
            }
            child.wait()?;
            return Ok(None);
        }
        thread::sleep(LOOK);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sh(script: &str, values: &[(&str, &str)], limit_ms: u64) -> Result<()> {
        let words = ["sh", "-c", script].map(str::to_owned);
        run(&words, values, Instant::now() + Duration::from_millis(limit_ms))
    }

    #[test]
    fn exit_codes_stderr_and_deadlines_become_errors() {
        assert_eq!(sh("test {photo} = /x", &[("{photo}", "/x")], 10_000), Ok(()));
        let error = sh("echo no camera at USB 3 >&2; exit 4", &[], 10_000).unwrap_err().0;
        assert_eq!(error, "sh ended with exit status: 4: no camera at USB 3");
        let begin = Instant::now();
        let error = sh("echo waiting >&2; sleep 60", &[], 100).unwrap_err().0;
        assert_eq!(error, "sh did not end in time and was stopped: waiting");
        assert!(begin.elapsed() < Duration::from_secs(20), "what the program started ended, too");
        let missing = run(&["/missing".to_owned()], &[], begin).unwrap_err().0;
        assert!(missing.contains("/missing cannot be started"), "{missing}");
    }
}
