//! What the server is told.

use crate::bench::{Bench, SIZE, check, problem};
use crate::material::{digest, kernel};
use crate::polling::running;
use crate::server::Sending;
use lightpath_agent::Agent;
use std::thread;
use std::time::Duration;

/// The reports since the last call.
fn reports(bench: &Bench) -> Vec<serde_json::Value> {
    let requests = bench.server.take_requests();
    let reports = requests.iter().filter(|request| request.is_report());
    reports.map(|request| serde_json::from_str(&request.body).unwrap()).collect()
}

fn report(bench: &Bench, agent: &mut Agent) -> serde_json::Value {
    agent.report();
    let mut all = reports(bench);
    assert_eq!(all.len(), 1, "{all:?}");
    all.pop().unwrap()
}

#[test]
fn a_form_that_the_version_lacks_is_reported() {
    let (bench, mut agent) = Bench::with_kernel();
    bench.server.change(|script| script.refusal = Some((400, "version 2 is not available as compact")));
    let text = problem(&mut agent);
    bench.server.change(|script| script.refusal = None);
    reports(&bench);
    let said = report(&bench, &mut agent);
    assert_eq!((&said["version"], &said["triedVersion"]), (&1.into(), &serde_json::Value::Null));
    assert_eq!(said["message"].as_str(), Some(text.as_str()));
    assert_eq!(text, "the server refused the manifest (400: version 2 is not available as compact)");
}

#[test]
fn reports_say_what_is_in_use_and_what_was_given_up() {
    let (bench, mut agent) = Bench::with_kernel();
    let all = {
        agent.report();
        bench.server.take_requests()
    };
    assert_eq!(all[0].path, "/v1/displays/pluto/devices/bench-7:report");
    assert_eq!(all[0].headers["content-type"], "application/json");
    let said: serde_json::Value = serde_json::from_str(&all[0].body).unwrap();
    let expected = serde_json::json!({
        "kernel": "515nm-150mm",
        "version": 1,
        "format": "compact",
        "digest": digest(&kernel(1, SIZE)),
        "generation": "7",
        "message": "",
        "agent": concat!("lightpath-agent ", env!("CARGO_PKG_VERSION")),
    });
    assert_eq!(said, expected);
    // Nothing has changed.
    check(&mut agent).unwrap();
    agent.report();
    assert_eq!(reports(&bench).len(), 0);
    bench.server.offer(2, 8, &kernel(2, SIZE));
    bench.server.change(|script| script.sending = Sending::Instead(b"x".to_vec()));
    let text = problem(&mut agent);
    let said = report(&bench, &mut agent);
    // The network, a mirror or the server has changed the bytes, so they say nothing about the version.
    assert_eq!(
        (&said["version"], &said["triedVersion"], &said["generation"]),
        (&1.into(), &serde_json::Value::Null, &"8".into())
    );
    assert_eq!(said["message"], text);
    // A problem of the network says nothing about the version.
    bench.server.change(|script| script.refusal = Some((503, "later")));
    problem(&mut agent);
    agent.report();
    assert_eq!(reports(&bench).len(), 0);
    bench.server.change(|script| (script.refusal, script.sending) = (None, Sending::Whole));
    check(&mut agent).unwrap();
    let said = report(&bench, &mut agent);
    assert_eq!(
        (&said["version"], &said["triedVersion"], &said["message"]),
        (&2.into(), &serde_json::Value::Null, &"".into())
    );
}

#[test]
fn device_without_a_kernel_reports_no_version_once_it_knows_the_kernels_id() {
    let bench = Bench::new();
    bench.agent().report();
    assert_eq!(reports(&bench).len(), 0);
    let said = report(&bench, &mut bench.agent_of("515nm-150mm"));
    assert_eq!(
        (&said["version"], &said["digest"], &said["generation"]),
        (&serde_json::Value::Null, &"".into(), &"0".into())
    );
}

#[test]
fn report_is_sent_again_after_an_error_and_from_time_to_time() {
    let (bench, agent) = Bench::with_kernel();
    drop(agent);
    let mut settings = bench.settings();
    settings.pace.report_interval = Duration::from_millis(300);
    let mut agent = Agent::start(settings).unwrap();
    bench.server.change(|script| script.report_status = 500);
    thread::spawn(move || agent.run());
    let count = |count: usize| {
        move |requests: &[crate::server::Request]| {
            requests.iter().filter(|request| request.is_report()).count() >= count
        }
    };
    bench.server.wait_for(count(3));
    bench.server.change(|script| script.report_status = 200);
    bench.server.take_requests();
    let requests = bench.server.wait_for(count(4));
    let times: Vec<_> = requests.iter().filter(|request| request.is_report()).map(|request| request.at).collect();
    assert!(times[3] - times[2] >= Duration::from_millis(295), "{times:?}");
}

#[test]
fn server_without_reports_is_no_obstacle() {
    let bench = Bench::new();
    bench.server.change(|script| (script.report_status, script.poll_after_s) = (404, 1));
    let _running = running(&bench);
    let requests =
        bench.server.wait_for(|requests| requests.iter().filter(|request| request.is_for_manifest()).count() >= 3);
    // After the installation, and not at each poll. At the start the id of the kernel was not known.
    assert_eq!(requests.iter().filter(|request| request.is_report()).count(), 1, "{requests:?}");
    bench.assert_uses(1);
}
