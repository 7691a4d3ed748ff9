//! What the agent does at its start with what lies in its directory.

use crate::bench::{Bench, SIZE, check, in_use, leftovers, problem};
use crate::material::{SIGNER, in_hours, kernel, key, keyring, manifest};
use lightpath_agent::{Agent, Problem, Slot};
use lightpath_manifest::{Keyring, Manifest, Optics};
use std::fs;

/// Version 2 in use in slot b, version 1 in slot a.
fn with_two() -> Bench {
    let (bench, mut agent) = Bench::with_kernel();
    bench.server.offer(2, 8, &kernel(2, SIZE));
    check(&mut agent).unwrap();
    assert_eq!(agent.in_use(), Some((Slot::B, 2)));
    bench.server.take_requests();
    bench
}

#[test]
fn damaged_kernel_is_replaced_by_the_other_slot_and_fetched_again() {
    for (file, bytes) in
        [("kernel", &b"short"[..]), ("kernel", &[7; SIZE]), ("manifest", b"lightpath manifest 2\n"), ("keyring", b"")]
    {
        let bench = with_two();
        fs::write(bench.directory().join("b").join(file), bytes).unwrap();
        let mut agent = bench.agent();
        assert_eq!(agent.in_use(), Some((Slot::A, 1)), "{file}");
        bench.assert_uses(1);
        check(&mut agent).unwrap();
        bench.assert_uses(2);
    }
}

#[test]
fn without_any_whole_kernel_none_is_in_use_until_one_is_fetched() {
    let bench = with_two();
    for slot in ["a", "b"] {
        fs::write(bench.directory().join(slot).join("kernel"), "damaged").unwrap();
    }
    let mut agent = bench.agent();
    assert_eq!((agent.in_use(), in_use(&bench.directory())), (None, None));
    assert!(fs::symlink_metadata(bench.directory().join("current")).is_err());
    bench.server.change(|script| script.refusal = Some((503, "later")));
    problem(&mut agent);
    assert_eq!(in_use(&bench.directory()), None);
    bench.server.change(|script| script.refusal = None);
    check(&mut agent).unwrap();
    bench.assert_uses(2);
}

#[test]
fn link_that_leads_nowhere_is_put_right() {
    for target in ["c", "../a", "/etc"] {
        let bench = with_two();
        let link = bench.directory().join("current");
        fs::remove_file(&link).unwrap();
        std::os::unix::fs::symlink(target, &link).unwrap();
        bench.agent();
        bench.assert_uses(2);
    }
    let bench = with_two();
    fs::remove_file(bench.directory().join("current")).unwrap();
    bench.agent();
    bench.assert_uses(2);
}

#[test]
fn half_written_files_are_removed() {
    let bench = with_two();
    for name in ["state.tmp", "keyring.tmp", "a/manifest.tmp", "b/part-sha256-00"] {
        fs::write(bench.directory().join(name), "half").unwrap();
    }
    std::os::unix::fs::symlink("a", bench.directory().join("current.tmp")).unwrap();
    bench.agent();
    bench.assert_uses(2);
}

#[test]
fn time_of_an_installed_manifest_does_not_matter() {
    let bench = with_two();
    // As it is after a year without the server: manifest, its key and the keyring have expired.
    let bytes = kernel(2, SIZE);
    let mut old_keyring = keyring(1);
    old_keyring.keys[0].until = in_hours(-10);
    let old_keyring = Keyring { issued: in_hours(-9000), expires: in_hours(-20), ..old_keyring };
    let old = Manifest { issued: in_hours(-101), expires: in_hours(-100), ..manifest(2, 8, &bytes) };
    for (path, text) in [
        ("b/manifest", old.signed(&key(SIGNER))),
        ("b/keyring", crate::material::signed(&old_keyring)),
        ("keyring", crate::material::signed(&old_keyring)),
    ] {
        fs::write(bench.directory().join(path), text).unwrap();
    }
    bench.server.change(|script| script.refusal = Some((503, "later")));
    let mut agent = bench.agent();
    assert_eq!(agent.in_use(), Some((Slot::B, 2)));
    problem(&mut agent);
    bench.assert_uses(2);
}

#[test]
fn kernel_of_other_settings_is_not_used() {
    let bench = with_two();
    let mut settings = bench.settings();
    settings.optics = Optics::at_distance(515_000, 200_000_000);
    // The id is only a part of an address: what the manifest says decides.
    settings.kernel = Some("515nm-150mm".to_owned());
    let mut agent = Agent::start(settings).unwrap();
    assert_eq!((agent.in_use(), in_use(&bench.directory())), (None, None));
    assert!(
        problem(&mut agent).contains(
            "place distance_nm 150000000, but wavelength_pm 515000, place distance_nm 200000000 was asked for"
        )
    );
    drop(agent);
    // Another display has generations of its own.
    let mut settings = bench.settings();
    settings.display = "venus".to_owned();
    settings.kernel = Some("515nm-150mm".to_owned());
    let bytes = kernel(4, SIZE);
    bench.server.offer(4, 1, &bytes);
    let document = Manifest { display: "venus".to_owned(), ..manifest(4, 1, &bytes) }.signed(&key(SIGNER));
    bench.server.change(|script| script.manifest = document);
    check(&mut Agent::start(settings).unwrap()).unwrap();
    bench.assert_uses(4);
}

#[test]
fn damaged_state_and_keyring_do_not_bring_an_older_kernel_back() {
    let bench = with_two();
    for name in ["state", "keyring"] {
        fs::write(bench.directory().join(name), "damaged").unwrap();
    }
    bench.server.offer(1, 7, &kernel(1, SIZE));
    let mut agent = bench.agent();
    bench.assert_uses(2);
    assert!(problem(&mut agent).contains("generation 7, but generation 8"));
    bench.assert_uses(2);
}

#[test]
fn version_of_the_other_slot_is_used_without_a_download() {
    let bench = with_two();
    // A rollback raises the generation, too.
    bench.server.offer(1, 9, &kernel(1, SIZE));
    check(&mut bench.agent()).unwrap();
    bench.assert_uses(1);
    assert!(bench.server.take_requests().iter().all(|request| !request.is_for_file()));
}

#[test]
fn second_agent_is_kept_out() {
    let bench = with_two();
    let _first = bench.agent();
    let second = Agent::start(bench.settings()).unwrap_err();
    assert!(matches!(second, Problem::Locked { .. }) && second.to_string().contains("another agent works in"));
    let output = bench.program().output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    bench.assert_uses(2);
    assert_eq!(leftovers(&bench.directory()), Vec::<String>::new());
}
