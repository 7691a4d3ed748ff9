//! Files: refused if they are not what the manifest says, and continued after a cut.

use crate::bench::{Bench, SIZE, check, leftovers, problem};
use crate::material::{SIGNER, kernel, key, manifest};
use crate::server::Sending;
use lightpath_agent::Agent;
use lightpath_manifest::Manifest;
use std::time::Duration;

/// Offers version 2, which the server sends like this.
fn sent_like(bench: &Bench, sending: Sending) {
    bench.server.offer(2, 8, &kernel(2, SIZE));
    bench.server.change(|script| script.sending = sending);
}

#[test]
fn longer_shorter_and_corrupt_bodies_are_refused_and_the_kernel_in_use_stays() {
    let (bench, mut agent) = Bench::with_kernel();
    let good = kernel(2, SIZE);
    let longer = [&good[..], b"x"].concat();
    let corrupt = [&good[..SIZE / 2], b"x", &good[SIZE / 2 + 1..]].concat();
    for (bytes, reason) in [
        (&longer[..], "it is longer than the 100000 bytes of the manifest"),
        (&good[..SIZE - 1], "it has 99999 bytes, but the manifest says 100000"),
        (&corrupt[..], "it has the digest sha256-"),
        (&kernel(1, SIZE)[..], "it has the digest sha256-"),
    ] {
        sent_like(&bench, Sending::Instead(bytes.to_vec()));
        let found = problem(&mut agent);
        assert!(found.starts_with("refused the file of version 2") && found.contains(reason), "{found}");
        let requests = bench.server.take_requests();
        assert_eq!(requests.iter().filter(|request| request.is_for_file()).count(), 2, "once more, and then later");
        bench.assert_uses(1);
    }
    for bytes in [&longer, &corrupt] {
        sent_like(&bench, Sending::InsteadInChunks(bytes.clone()));
        assert!(problem(&mut agent).starts_with("refused the file of version 2"));
        bench.assert_uses(1);
    }
    bench.server.take_requests();
    // Without a length, a short body looks like a cut. It never becomes a kernel.
    sent_like(&bench, Sending::InsteadInChunks(good[..SIZE - 1].to_vec()));
    assert!(problem(&mut agent).contains("was cut after 99999 of 100000 bytes"));
    assert_eq!(bench.server.take_requests().iter().filter(|request| request.is_for_file()).count(), 2);
    bench.server.change(|script| script.sending = Sending::Whole);
    check(&mut agent).unwrap();
    bench.assert_uses(2);
}

#[test]
fn manifest_with_the_digest_or_size_of_another_version_installs_nothing() {
    let (bench, mut agent) = Bench::with_kernel();
    let (short, long) = (kernel(2, SIZE), kernel(3, SIZE + 1));
    bench.server.offer(3, 8, &long);
    bench.server.offer(2, 8, &short);
    let (two, three) = (manifest(2, 8, &short), manifest(3, 8, &long));
    for (mixed, reason) in [
        (Manifest { digest: three.digest.clone(), ..two.clone() }, "it is longer than the 100000 bytes"),
        (Manifest { size_bytes: three.size_bytes, ..two.clone() }, "it has 100000 bytes, but the manifest says 100001"),
    ] {
        bench.server.change(|script| script.manifest = mixed.signed(&key(SIGNER)));
        let found = problem(&mut agent);
        assert!(found.contains(reason), "{found}");
        bench.assert_uses(1);
    }
}

#[test]
fn cut_download_continues_where_it_ended() {
    let (bench, mut agent) = Bench::with_kernel();
    sent_like(&bench, Sending::Whole);
    bench.server.change(|script| script.next = [Sending::CutAfter(40_000), Sending::CutAfter(30_000)].into());
    check(&mut agent).unwrap();
    bench.assert_uses(2);
    let requests = bench.server.take_requests();
    let ranges: Vec<_> = requests
        .iter()
        .filter(|request| request.is_for_file())
        .map(|request| request.headers.get("range").map(String::as_str))
        .collect();
    assert_eq!(ranges, [None, Some("bytes=40000-"), Some("bytes=70000-")]);
}

#[test]
fn download_continues_after_a_restart() {
    let (bench, mut agent) = Bench::with_kernel();
    sent_like(&bench, Sending::CutAfter(0));
    bench.server.change(|script| script.next = [Sending::CutAfter(40_000)].into());
    let found = problem(&mut agent);
    assert!(found.contains("the download of version 2 was cut after 40000 of 100000 bytes"), "{found}");
    drop(agent);
    bench.server.take_requests();
    bench.server.change(|script| script.sending = Sending::Whole);
    check(&mut bench.agent()).unwrap();
    let requests = bench.server.take_requests();
    let file = requests.iter().find(|request| request.is_for_file()).unwrap();
    assert_eq!(file.headers["range"], "bytes=40000-");
    bench.assert_uses(2);
}

#[test]
fn corrupt_part_is_fetched_again_from_the_start() {
    let (bench, mut agent) = Bench::with_kernel();
    sent_like(&bench, Sending::CutAfter(0));
    bench.server.change(|script| script.next = [Sending::CutAfter(40_000)].into());
    problem(&mut agent);
    let part = leftovers(&bench.directory()).pop().unwrap();
    let path = bench.directory().join("b").join(part);
    for (bytes, requests) in [(vec![7; 40_000], 2), (vec![7; SIZE], 1), (vec![7; SIZE + 5], 1)] {
        std::fs::write(&path, bytes).unwrap();
        bench.server.take_requests();
        bench.server.change(|script| script.sending = Sending::Whole);
        check(&mut agent).unwrap();
        let files = bench.server.take_requests();
        assert_eq!(files.iter().filter(|request| request.is_for_file()).count(), requests);
        bench.assert_uses(2);
        // Again from version 1, with version 2 in slot b gone.
        drop(agent);
        std::fs::remove_file(bench.directory().join("current")).unwrap();
        std::fs::remove_dir_all(bench.directory().join("b")).unwrap();
        std::fs::create_dir(bench.directory().join("b")).unwrap();
        agent = bench.agent();
    }
}

#[test]
fn servers_that_ignore_or_confuse_ranges_do_no_harm() {
    for (second, reason) in [(Sending::IgnoringRange, ""), (Sending::WrongPart, ""), (Sending::Status(503), "503")] {
        let (bench, mut agent) = Bench::with_kernel();
        sent_like(&bench, Sending::Whole);
        bench.server.change(|script| script.next = [Sending::CutAfter(40_000), second].into());
        match reason {
            "" => {
                check(&mut agent).unwrap();
                bench.assert_uses(2);
            }
            _ => assert!(problem(&mut agent).contains(reason)),
        }
        assert_eq!(check(&mut agent).unwrap().version, 2);
    }
}

#[test]
fn stalled_body_counts_as_a_cut() {
    let (bench, agent) = Bench::with_kernel();
    drop(agent);
    sent_like(&bench, Sending::Whole);
    bench.server.change(|script| script.next = [Sending::StallAfter(10_000)].into());
    let mut settings = bench.settings();
    settings.pace.stall = Duration::from_millis(500);
    check(&mut Agent::start(settings).unwrap()).unwrap();
    bench.assert_uses(2);
}

#[test]
fn part_of_another_version_is_removed() {
    let (bench, mut agent) = Bench::with_kernel();
    sent_like(&bench, Sending::CutAfter(0));
    bench.server.change(|script| script.next = [Sending::CutAfter(40_000)].into());
    problem(&mut agent);
    assert_eq!(leftovers(&bench.directory()).len(), 1);
    bench.server.offer(3, 9, &kernel(3, SIZE));
    bench.server.change(|script| script.sending = Sending::Whole);
    check(&mut agent).unwrap();
    bench.assert_uses(3);
}
