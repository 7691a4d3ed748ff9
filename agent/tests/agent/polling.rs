//! When the agent asks, with what, and what it says if the answer is no.

use crate::bench::{Bench, SIZE, check, problem};
use crate::material::kernel;
use crate::server::Request;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::Duration;

/// A program that ends with the test.
pub(crate) struct Running(pub(crate) Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The real program of a bench, which checks for ever.
pub(crate) fn running(bench: &Bench) -> Running {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lightpath-agent"));
    command.env_clear().args(&bench.arguments()[1..]).stderr(Stdio::null());
    Running(command.spawn().unwrap())
}

fn manifests(requests: &[Request]) -> Vec<&Request> {
    requests.iter().filter(|request| request.is_for_manifest()).collect()
}

#[test]
fn unchanged_manifest_is_not_sent_again_also_after_a_restart() {
    let (bench, mut agent) = Bench::with_kernel();
    let checked = agent.check(Duration::from_secs(50)).unwrap();
    assert_eq!((checked.version, checked.is_offered, checked.poll_after.as_secs()), (1, true, 60));
    drop(agent);
    check(&mut bench.agent()).unwrap();
    let requests = bench.server.take_requests();
    let asked = manifests(&requests);
    assert_eq!(
        asked[0].path,
        "/v1/displays/pluto/kernels/515nm-150mm/manifest?format=compact&device=bench-7&wait_s=50"
    );
    assert!(asked[0].headers.contains_key("if-none-match"));
    assert_eq!(asked[0].headers["if-none-match"], asked[1].headers["if-none-match"]);
    assert_eq!(requests.iter().filter(|request| request.is_for_file()).count(), 0);
}

#[test]
fn server_decides_when_the_next_poll_comes() {
    let bench = Bench::new();
    bench.server.change(|script| script.poll_after_s = 1);
    let _running = running(&bench);
    let requests = bench.server.wait_for(|requests| manifests(requests).len() >= 3);
    let times: Vec<_> = manifests(&requests).iter().map(|request| request.at).collect();
    for pair in times.windows(2) {
        let pause = pair[1] - pair[0];
        assert!(pause > Duration::from_millis(950) && pause < Duration::from_secs(10), "{pause:?}");
    }
    bench.assert_uses(1);
}

#[test]
fn pauses_after_errors_grow_and_the_agent_recovers() {
    let (bench, mut agent) = Bench::with_kernel();
    bench.server.offer(2, 8, &kernel(2, SIZE));
    bench.server.change(|script| script.refusal = Some((500, "out of order")));
    assert_eq!(problem(&mut agent), "the server refused the manifest (500: out of order)");
    bench.server.take_requests();
    thread::spawn(move || agent.run());
    let requests = bench.server.wait_for(|requests| manifests(requests).len() >= 5);
    let times: Vec<_> = manifests(&requests).iter().map(|request| request.at).collect();
    // 40 ms, 80 ms, 160 ms, 320 ms, each at least half.
    for (index, pair) in times.windows(2).enumerate() {
        assert!(pair[1] - pair[0] >= Duration::from_millis(20 << index.min(3)), "{times:?}");
    }
    bench.assert_uses(1);
    bench.server.change(|script| script.refusal = None);
    bench.server.wait_for(|requests| requests.iter().any(|request| request.body.contains("\"version\":2")));
    bench.assert_uses(2);
}

#[test]
fn refused_tokens_say_what_to_do() {
    let (bench, mut agent) = Bench::with_kernel();
    let file = bench.folder.path().join("token");
    bench.server.change(|script| script.refusal = Some((401, "the token has expired")));
    let text = problem(&mut agent);
    assert!(text.contains("401: the token has expired") && text.contains("--token-file"), "{text}");
    drop(agent);
    let mut settings = bench.settings();
    settings.token_file = Some(file.clone());
    let mut agent = lightpath_agent::Agent::start(settings).unwrap();
    assert!(problem(&mut agent).contains("cannot be read"));
    for (content, text) in [("", "must have one line"), ("a b", "must have one line"), ("old\n", "401")] {
        std::fs::write(&file, content).unwrap();
        assert!(problem(&mut agent).contains(text), "{content}");
    }
    bench.server.change(|script| script.refusal = Some((403, "the token is for other displays")));
    let text = problem(&mut agent);
    for part in [
        "403: the token is for other displays",
        "`lightpathd token create bench-7 --role firmware --display pluto`",
        &format!("put it into {}", file.display()),
    ] {
        assert!(text.contains(part), "{text}");
    }
    bench.assert_uses(1);
    // A new token counts at the next poll.
    bench.server.take_requests();
    std::fs::write(&file, "new\n").unwrap();
    bench.server.change(|script| script.refusal = None);
    check(&mut agent).unwrap();
    let requests = bench.server.take_requests();
    assert_eq!(manifests(&requests)[0].headers["authorization"], "Bearer new");
}

#[test]
fn server_that_is_away_or_silent_is_a_problem_that_passes() {
    let (bench, agent) = Bench::with_kernel();
    drop(agent);
    let mut settings = bench.settings();
    "http://127.0.0.1:1".clone_into(&mut settings.server);
    let text = problem(&mut lightpath_agent::Agent::start(settings).unwrap());
    assert!(text.starts_with("could not reach http://127.0.0.1:1"), "{text}");
    // A listener that never answers.
    let silent = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let mut settings = bench.settings();
    settings.server = format!("http://{}", silent.local_addr().unwrap());
    settings.pace.stall = Duration::from_millis(500);
    let text = problem(&mut lightpath_agent::Agent::start(settings).unwrap());
    assert!(text.contains("timeout"), "{text}");
    bench.assert_uses(1);
}

#[test]
fn one_check_has_an_exit_code_and_status_needs_no_server() {
    let bench = Bench::new();
    let status = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lightpath-agent"));
        command.env_clear().args(["status", "--directory"]).arg(bench.directory());
        let output = command.output().unwrap();
        (output.status.code(), String::from_utf8(output.stdout).unwrap())
    };
    let (code, text) = status();
    assert_eq!((code, text.contains("no kernel is in use")), (Some(1), true), "{text}");
    let output = bench.program().output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let log = String::from_utf8(output.stderr).unwrap();
    assert!(log.contains("Z the agent uses version 1 of pluto, 515 nm, 150 mm, generation 7\n"), "{log}");
    let (code, text) = status();
    assert_eq!(code, Some(0), "{text}");
    for part in [
        "slot a, in use: version 1 of pluto, 515 nm, 150 mm, generation 7, compact, 100000 bytes, sha256-",
        "slot b: empty",
        "keyring: version 1, until ",
        "highest generation: 7",
    ] {
        assert!(text.contains(part), "{text}");
    }
    bench.server.change(|script| script.refusal = Some((503, "later")));
    assert_eq!(bench.program().output().unwrap().status.code(), Some(1));
    bench.assert_uses(1);
    let by_environment = Command::new(env!("CARGO_BIN_EXE_lightpath-agent"))
        .env_clear()
        .envs([("LIGHTPATH_SERVER", "http://x"), ("LIGHTPATH_DIRECTORY", bench.directory().to_str().unwrap())])
        .arg("status")
        .output()
        .unwrap();
    assert_eq!(by_environment.status.code(), Some(0), "{by_environment:?}");
    let nothing = Command::new(env!("CARGO_BIN_EXE_lightpath-agent")).env_clear().output().unwrap();
    assert_eq!(nothing.status.code(), Some(2), "{nothing:?}");
}
