//! Servers that hold an agent where it is: by answers without signatures, or by bytes that come one by one.

use crate::bench::{Bench, SIZE, check, leftovers, problem};
use crate::material::{SIGNER, STRANGER, in_hours, kernel, key, keyring, manifest, signed};
use crate::server::Sending;
use lightpath_agent::{Agent, Clock, Problem, Settings};
use lightpath_manifest::{Keyring, ListedKey, Manifest, Time};
use std::io::Write as _;
use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// Hours until the manifests of [`manifest`] expire, and one more.
const AFTER_EXPIRY: i64 = 161;

/// Settings with a clock that a test moves, in hours from now.
fn with_clock(bench: &Bench) -> (Settings, Arc<AtomicI64>) {
    let (hours, start) = (Arc::<AtomicI64>::default(), in_hours(0).unix_s());
    let moved = Arc::clone(&hours);
    let now = move || Time::from_unix_s(start + 3600 * moved.load(Ordering::SeqCst)).unwrap();
    (Settings { clock: Clock::of(now), ..bench.settings() }, hours)
}

fn message(bench: &Bench, agent: &mut Agent) -> String {
    bench.server.take_requests();
    agent.report();
    let requests = bench.server.take_requests();
    let report = requests.iter().rev().find(|request| request.is_report()).unwrap();
    let report: serde_json::Value = serde_json::from_str(&report.body).unwrap();
    assert_eq!((&report["version"], &report["triedVersion"]), (&1.into(), &serde_json::Value::Null), "{report}");
    report["message"].as_str().unwrap().to_owned()
}

#[test]
fn server_without_keys_is_noticed_when_the_last_manifest_expires() {
    let bench = Bench::new();
    let (settings, hours) = with_clock(&bench);
    let mut agent = Agent::start(settings.clone()).unwrap();
    check(&mut agent).unwrap();
    bench.server.change(|script| script.says_unchanged = true);
    hours.store(AFTER_EXPIRY - 2, Ordering::SeqCst);
    assert!(check(&mut agent).unwrap().is_offered, "it may say so while the manifest counts");
    hours.store(AFTER_EXPIRY, Ordering::SeqCst);
    for is_restarted in [false, true] {
        if is_restarted {
            drop(agent);
            agent = Agent::start(settings.clone()).unwrap();
        }
        bench.server.take_requests();
        let refused = check(&mut agent).unwrap_err();
        assert!(matches!(refused, Problem::Unconfirmed { .. }), "{refused:?}");
        let (text, issued, expires) = (refused.to_string(), in_hours(-1), in_hours(160));
        let day = |time: Time| time.to_string()[..13].to_owned();
        for part in ["the server has confirmed nothing since", &day(issued), "expired at", &day(expires), "(304)"] {
            assert!(text.contains(part), "{part}: {text}");
        }
        let requests = bench.server.take_requests();
        let asked = requests.iter().find(|request| request.is_for_manifest()).unwrap();
        assert!(!asked.headers.contains_key("if-none-match"), "{asked:?}");
        assert_eq!(message(&bench, &mut agent), text);
        bench.assert_uses(1);
    }
    // Other answers confirm nothing either.
    bench.server.change(|script| (script.says_unchanged, script.refusal) = (false, Some((503, "later"))));
    let text = problem(&mut agent);
    assert!(text.starts_with("the server has confirmed nothing since") && text.contains("503: later"), "{text}");
    bench.server.change(|script| script.refusal = None);
    let text = problem(&mut agent);
    assert!(text.contains("confirmed nothing since") && text.contains("the manifest counts from"), "{text}");
    bench.assert_uses(1);
    // A manifest that counts is enough, also the same version.
    let bytes = kernel(1, SIZE);
    let renewed = Manifest { issued: in_hours(150), expires: in_hours(310), ..manifest(1, 7, &bytes) };
    bench.server.change(|script| script.manifest = renewed.signed(&key(SIGNER)));
    assert!(check(&mut agent).unwrap().is_offered);
    assert_eq!(message(&bench, &mut agent), "");
    check(&mut agent).unwrap();
    let requests = bench.server.take_requests();
    assert!(requests.iter().any(|request| request.headers.contains_key("if-none-match")));
    assert!(requests.iter().all(|request| !request.is_for_file()), "the kernel is the same");
}

#[test]
fn server_that_names_a_long_pause_is_asked_when_the_manifest_expires() {
    let bench = Bench::new();
    let soon = Time::from_unix_s(in_hours(0).unix_s() + 3).unwrap();
    let short = Manifest { expires: soon, ..manifest(1, 7, &kernel(1, SIZE)) };
    bench.server.change(|script| (script.manifest, script.poll_after_s) = (short.signed(&key(SIGNER)), 86_400));
    let mut agent = bench.agent();
    thread::spawn(move || agent.run());
    let requests = bench.server.wait_for(|requests| requests.iter().filter(|one| one.is_for_manifest()).count() >= 2);
    let last = requests.iter().rev().find(|request| request.is_for_manifest()).unwrap();
    assert!(!last.headers.contains_key("if-none-match"), "{last:?}");
    bench.assert_uses(1);
}

#[test]
fn device_without_a_clock_takes_the_time_of_documents_for_it() {
    let bench = Bench::new();
    let long_ago = Clock::of(|| in_hours(-9000));
    // Without any document, a clock that is far behind is believed.
    let text = problem(&mut Agent::start(Settings { clock: long_ago.clone(), ..bench.settings() }).unwrap());
    assert!(text.contains("is the clock of this device right?"), "{text}");
    for clock in [Clock::none(), long_ago] {
        let settings = Settings { clock, ..bench.settings() };
        let mut agent = Agent::start(settings.clone()).unwrap();
        check(&mut agent).unwrap();
        bench.assert_uses(1);
        // Signed once, and ended before the manifest of version 1 was issued.
        let old = Manifest { issued: in_hours(-20), expires: in_hours(-2), ..manifest(2, 7, &kernel(2, SIZE)) };
        for is_restarted in [false, true] {
            if is_restarted {
                drop(agent);
                agent = Agent::start(settings.clone()).unwrap();
            }
            bench.server.change(|script| script.manifest = old.signed(&key(SIGNER)));
            let text = problem(&mut agent);
            assert!(text.contains("the manifest counts from") && text.contains(" or later"), "{text}");
            bench.assert_uses(1);
        }
        bench.server.offer(1, 7, &kernel(1, SIZE));
        check(&mut agent).unwrap();
        // The time that passes while the agent runs counts, too.
        let now = in_hours(0);
        let short = Manifest {
            issued: now,
            expires: Time::from_unix_s(now.unix_s() + 1).unwrap(),
            ..manifest(1, 7, &kernel(1, SIZE))
        };
        bench.server.change(|script| (script.manifest, script.says_unchanged) = (short.signed(&key(SIGNER)), false));
        check(&mut agent).unwrap();
        thread::sleep(Duration::from_millis(1100));
        bench.server.change(|script| script.says_unchanged = true);
        assert!(matches!(check(&mut agent).unwrap_err(), Problem::Unconfirmed { .. }));
        bench.server.change(|script| script.says_unchanged = false);
        bench.server.offer(1, 7, &kernel(1, SIZE));
    }
}

#[test]
fn stolen_key_cannot_end_time_for_a_device_without_a_clock() {
    let bench = Bench::new();
    let mut agent = Agent::start(Settings { clock: Clock::none(), ..bench.settings() }).unwrap();
    check(&mut agent).unwrap();
    let bytes = kernel(2, SIZE);
    bench.server.offer(2, 7, &bytes);
    // The keyring ends in 2000 hours.
    for (hours, is_refused) in [(500_000, true), (2000, true), (1999, false)] {
        let far = Manifest { issued: in_hours(hours), expires: in_hours(600_000), ..manifest(2, 7, &bytes) };
        bench.server.change(|script| script.manifest = far.signed(&key(SIGNER)));
        match check(&mut agent) {
            Ok(_) => assert!(!is_refused, "{hours}"),
            Err(problem) => assert!(problem.to_string().contains("the keyring counts from"), "{hours}: {problem}"),
        }
    }
    bench.assert_uses(2);
    // The next keyring revokes the key, and lists another.
    let listed = ListedKey { key: key(STRANGER).public(), from: in_hours(-1), until: in_hours(9000) };
    let next =
        Keyring { expires: in_hours(3000), keys: vec![listed], revoked: vec![key(SIGNER).public()], ..keyring(2) };
    bench.server.offer(3, 8, &kernel(3, SIZE));
    let manifest = Manifest { expires: in_hours(2900), ..manifest(3, 8, &kernel(3, SIZE)) };
    bench.server.change(|script| (script.keyring, script.manifest) = (signed(&next), manifest.signed(&key(STRANGER))));
    check(&mut agent).unwrap();
    bench.assert_uses(3);
}

#[test]
fn nothing_can_be_unchanged_for_a_device_without_a_kernel() {
    let bench = Bench::new();
    bench.server.change(|script| script.says_unchanged = true);
    let text = problem(&mut bench.agent());
    assert!(text.contains("(304)"), "{text}");
    let output = bench.program().output().unwrap();
    let log = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{log}");
    assert!(log.contains("no kernel is in use: the server said that its manifest has not changed"), "{log}");
}

/// Settings of a device that waits two seconds for an answer, and half a second for a byte.
fn impatient(bench: &Bench) -> Settings {
    let mut settings = bench.settings();
    (settings.pace.stall, settings.pace.answer) = (Duration::from_millis(500), Duration::from_secs(2));
    settings
}

/// Checks, which must fail within a time.
fn fails_within(agent: &mut Agent, limit: Duration) -> String {
    let begin = Instant::now();
    let text = problem(agent);
    assert!(begin.elapsed() < limit, "{:?}: {text}", begin.elapsed());
    text
}

#[test]
fn documents_and_messages_that_drip_are_given_up() {
    let (bench, agent) = Bench::with_kernel();
    drop(agent);
    let mut agent = Agent::start(impatient(&bench)).unwrap();
    // At this pace a keyring needs minutes.
    bench.server.change(|script| script.drip = Some(Duration::from_millis(200)));
    bench.server.offer(2, 8, &kernel(2, SIZE));
    let text = fails_within(&mut agent, Duration::from_secs(10));
    assert!(text.contains("timeout"), "{text}");
    bench.server.change(|script| script.refusal = Some((503, "a message that is long enough to take a while")));
    let text = fails_within(&mut agent, Duration::from_secs(10));
    assert!(text.contains("timeout") || text.contains("503"), "{text}");
    bench.assert_uses(1);
    bench.server.change(|script| (script.drip, script.refusal) = (None, None));
    check(&mut agent).unwrap();
    bench.assert_uses(2);
}

#[test]
fn head_that_drips_is_given_up() {
    let (bench, agent) = Bench::with_kernel();
    drop(agent);
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let mut settings = impatient(&bench);
    settings.server = format!("http://{}", listener.local_addr().unwrap());
    // It ends when the agent closes its connections.
    thread::spawn(move || {
        for stream in listener.incoming() {
            thread::spawn(move || {
                let mut stream = stream.unwrap();
                let mut sent = stream.write_all(b"HTTP/1.1 200 OK\r\nx: ");
                while sent.is_ok() {
                    thread::sleep(Duration::from_millis(100));
                    sent = stream.write_all(b"x");
                }
            });
        }
    });
    let text = fails_within(&mut Agent::start(settings).unwrap(), Duration::from_secs(10));
    assert!(text.contains("timeout"), "{text}");
    bench.assert_uses(1);
}

#[test]
fn file_that_drips_is_cut_and_continued() {
    let (bench, agent) = Bench::with_kernel();
    drop(agent);
    let mut settings = impatient(&bench);
    settings.pace.file = Duration::from_secs(1);
    let mut agent = Agent::start(settings).unwrap();
    bench.server.offer(2, 8, &kernel(2, SIZE));
    let drip = Sending::Slow { piece_bytes: 1, pause: Duration::from_millis(200) };
    bench.server.change(|script| script.next = [Sending::CutAfter(40_000), drip].into());
    let text = fails_within(&mut agent, Duration::from_secs(10));
    assert!(text.starts_with("the download of version 2 was cut after 4000") && text.contains("timeout"), "{text}");
    assert_eq!(leftovers(&bench.directory()).len(), 1);
    bench.server.take_requests();
    check(&mut agent).unwrap();
    let requests = bench.server.take_requests();
    let file = requests.iter().find(|request| request.is_for_file()).unwrap();
    assert!(file.headers["range"].starts_with("bytes=4000"), "{file:?}");
    bench.assert_uses(2);
}
