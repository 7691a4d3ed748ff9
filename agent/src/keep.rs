//! An agent of one kernel, or of a set, until its exit code.

use crate::{Agent, KernelSet, Problem, Settings, log};
use std::process::ExitCode;
use std::time::Duration;

/// Keeps one kernel or several, for ever or for one check, and returns the exit code.
pub(crate) fn keep(kernels: Result<Vec<Settings>, Problem>, settle: Duration, once: bool) -> ExitCode {
    let kept = kernels.and_then(|mut kernels| match kernels.len() {
        1 => keep_one(kernels.remove(0), once),
        _ => keep_set(kernels, settle, once),
    });
    match kept {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(problem) => {
            log::line(&problem);
            ExitCode::from(if matches!(problem, Problem::Setting(_)) { 2 } else { 1 })
        }
    }
}

/// Keeps a kernel. Returns, after one check, whether the version that the server offers is in use.
fn keep_one(settings: Settings, once: bool) -> Result<bool, Problem> {
    let mut agent = Agent::start(settings)?;
    if !once {
        agent.run();
    }
    let checked = agent.check(Duration::ZERO);
    agent.report();
    match checked {
        // Whatever was answered: only a kernel that the application can open is a success.
        _ if !agent.has_whole_kernel() => log::line(match checked {
            Ok(_) => "no kernel is in use: the version that the server offers was given up before".to_owned(),
            Err(problem) => format!("no kernel is in use: {problem}"),
        }),
        Ok(checked) if checked.is_offered => return Ok(true),
        Ok(checked) => log::line(format_args!(
            "version {} is in use: the version that the server offers was given up before",
            checked.version
        )),
        Err(problem) => log::line(problem),
    }
    Ok(false)
}

/// Keeps a set of kernels. Returns, after one check, whether what the server offers is in use.
fn keep_set(kernels: Vec<Settings>, settle: Duration, once: bool) -> Result<bool, Problem> {
    let mut set = KernelSet::start(kernels, settle)?;
    if !once {
        set.run();
    }
    let checked = set.check_until_settled();
    set.report();
    let in_use = if set.has_whole_set() { "the set in use stays" } else { "no set is in use" };
    match checked {
        Ok(checked) if checked.is_offered && set.has_whole_set() => return Ok(true),
        Ok(_) => log::line(format_args!("{in_use}: a version that the server offers was given up before")),
        Err(problem) => log::line(format_args!("{in_use}: {problem}")),
    }
    Ok(false)
}
