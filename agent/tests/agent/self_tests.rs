//! The device's own test.

use crate::bench::{Bench, SIZE, check, problem};
use crate::material::kernel;
use lightpath_agent::Agent;

/// A test that refuses version 2.
const REFUSES_2: &str =
    "head -n 1 \"$1\"; grep -aq '^kernel 2$' \"$1\" && { echo too blurred; exit 3; }; echo loss 0.0123";

fn with_test(bench: &Bench, script: &str) -> Agent {
    let mut settings = bench.settings();
    settings.self_test = Some(bench.script(script));
    Agent::start(settings).unwrap()
}

fn last_report(bench: &Bench, agent: &mut Agent) -> serde_json::Value {
    agent.report();
    let requests = bench.server.take_requests();
    let report = requests.iter().rev().find(|request| request.is_report()).unwrap();
    serde_json::from_str(&report.body).unwrap()
}

#[test]
fn version_that_fails_is_given_up_until_version_or_generation_change() {
    let bench = Bench::new();
    let mut agent = with_test(&bench, REFUSES_2);
    check(&mut agent).unwrap();
    bench.assert_uses(1);
    assert_eq!(last_report(&bench, &mut agent)["selfTestLoss"], 0.0123);
    bench.server.offer(2, 8, &kernel(2, SIZE));
    let text = problem(&mut agent);
    assert_eq!(text, "the self-test refused version 2: exit status: 3: too blurred");
    bench.assert_uses(1);
    // Not again: not at the next poll, and not after a restart.
    assert!(!check(&mut agent).unwrap().is_offered);
    drop(agent);
    let mut agent = with_test(&bench, REFUSES_2);
    for _ in 0..2 {
        let checked = check(&mut agent).unwrap();
        assert_eq!((checked.version, checked.is_offered), (1, false));
    }
    let said = last_report(&bench, &mut agent);
    assert_eq!(
        (&said["version"], &said["triedVersion"], &said["message"]),
        (&1.into(), &2.into(), &text.clone().into())
    );
    assert_eq!(said["selfTestLoss"], 0.0123, "it is that of the version in use");
    assert!(lightpath_agent::status(&bench.directory()).0.contains("given up: version 2, generation 8: the self-test"));
    // Somebody has moved `active` once more: a new chance.
    bench.server.offer(2, 9, &kernel(2, SIZE));
    bench.server.take_requests();
    assert_eq!(problem(&mut agent), text);
    assert!(bench.server.take_requests().iter().any(|request| request.is_for_file()));
    // At the same generation another group gets another version.
    bench.server.offer(3, 9, &kernel(3, SIZE));
    assert!(check(&mut agent).unwrap().is_offered);
    bench.assert_uses(3);
    let said = last_report(&bench, &mut agent);
    assert_eq!(
        (&said["version"], &said["triedVersion"], &said["message"]),
        (&3.into(), &serde_json::Value::Null, &"".into())
    );
}

#[test]
fn test_sees_the_whole_new_file_while_the_old_one_is_in_use() {
    let (bench, agent) = Bench::with_kernel();
    drop(agent);
    let seen = bench.folder.path().join("seen");
    let script = format!("cat \"$1\" {}/current/kernel > {}", bench.directory().display(), seen.display());
    bench.server.offer(2, 8, &kernel(2, SIZE));
    check(&mut with_test(&bench, &script)).unwrap();
    assert_eq!(std::fs::read(seen).unwrap(), [kernel(2, SIZE), kernel(1, SIZE)].concat());
    bench.assert_uses(2);
}

#[test]
fn first_kernel_that_fails_leaves_the_device_without_one() {
    let bench = Bench::new();
    bench.server.offer(2, 7, &kernel(2, SIZE));
    let mut agent = with_test(&bench, REFUSES_2);
    problem(&mut agent);
    assert!(!check(&mut agent).unwrap().is_offered);
    let said = last_report(&bench, &mut agent);
    assert_eq!((&said["version"], &said["triedVersion"]), (&serde_json::Value::Null, &2.into()));
    assert_eq!(crate::bench::in_use(&bench.directory()), None);
}

#[test]
fn a_test_that_cannot_start_is_a_wrong_setting_and_no_bad_version() {
    let bench = Bench::new();
    let mut settings = bench.settings();
    settings.self_test = Some(bench.script("echo loss 0.5"));
    let mut agent = Agent::start(settings.clone()).unwrap();
    check(&mut agent).unwrap();
    drop(agent);
    let program = settings.self_test.clone().unwrap();
    let moved = program.with_extension("away");
    std::fs::rename(&program, &moved).unwrap();
    let mut agent = Agent::start(settings).unwrap();
    bench.server.offer(2, 8, &kernel(2, SIZE));
    for _ in 0..2 {
        let text = problem(&mut agent);
        assert!(text.starts_with("could not start the self-test") && text.ends_with("correct --self-test"), "{text}");
        assert_eq!(agent.in_use().unwrap().1, 1);
    }
    let said = last_report(&bench, &mut agent);
    assert_eq!(
        (&said["version"], &said["triedVersion"]),
        (&1.into(), &serde_json::Value::Null),
        "a rollout does not count it"
    );
    assert!(said["message"].as_str().unwrap().starts_with("could not start the self-test"), "{said}");
    std::fs::rename(&moved, &program).unwrap();
    bench.server.take_requests();
    check(&mut agent).unwrap();
    bench.assert_uses(2);
    assert!(!bench.server.take_requests().iter().any(|request| request.is_for_file()), "it was fetched before");
}

#[test]
fn a_test_that_changes_the_kernel_installs_nothing() {
    for script in [
        "echo more >> \"$1\"",
        "printf x | dd of=\"$1\" conv=notrunc bs=1 seek=50 2>&1",
        "rm \"$1\"; cp /bin/sh \"$1\"",
        "mv \"$1\" \"$1.moved\"; ln -s \"$1.moved\" \"$1\"",
        "rm \"$1\"",
    ] {
        let (bench, agent) = Bench::with_kernel();
        drop(agent);
        bench.server.offer(2, 8, &kernel(2, SIZE));
        let mut agent = with_test(&bench, script);
        let text = problem(&mut agent);
        assert!(text.contains("has changed the file of version 2, which it may only read"), "{script}: {text}");
        assert_eq!(agent.in_use().unwrap().1, 1, "{script}");
        let said = last_report(&bench, &mut agent);
        assert_eq!(
            (&said["version"], &said["triedVersion"]),
            (&1.into(), &serde_json::Value::Null),
            "the version is not at fault"
        );
        drop(agent);
        check(&mut with_test(&bench, "echo loss 0.5")).unwrap();
        bench.assert_uses(2);
    }
}

#[test]
fn what_a_test_leaves_running_ends_with_it() {
    let (bench, agent) = Bench::with_kernel();
    drop(agent);
    bench.server.offer(2, 8, &kernel(2, SIZE));
    // It has the file open, so a later change would reach it under its next name, too.
    let script = "( exec 3<>\"$1\"; sleep 0.3; echo changed >&3 ) >/dev/null 2>&1 & exit 0";
    check(&mut with_test(&bench, script)).unwrap();
    std::thread::sleep(std::time::Duration::from_millis(600));
    bench.assert_uses(2);
}

#[test]
fn one_check_fails_and_says_why_whenever_another_version_or_none_is_in_use() {
    let bench = Bench::new();
    let test = bench.script(REFUSES_2);
    let check_once = || {
        let output = bench.program().arg("--self-test").arg(&test).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    bench.server.offer(2, 7, &kernel(2, SIZE));
    for why in ["the self-test refused version 2", "the version that the server offers was given up before"] {
        let (code, log) = check_once();
        assert_eq!(code, Some(1), "{log}");
        assert!(log.contains(&format!("no kernel is in use: {why}")), "{log}");
    }
    bench.server.offer(1, 8, &kernel(1, SIZE));
    assert_eq!(check_once().0, Some(0));
    bench.server.offer(2, 9, &kernel(2, SIZE));
    for why in
        ["the self-test refused version 2", "version 1 is in use: the version that the server offers was given up"]
    {
        let (code, log) = check_once();
        assert_eq!((code, log.contains(why)), (Some(1), true), "{log}");
    }
    // A test that removes what it tests.
    bench.server.offer(3, 10, &kernel(3, SIZE));
    let removes = bench.script("rm \"$1\"");
    let output = bench.program().arg("--self-test").arg(&removes).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    bench.assert_uses(1);
}
