//! Documents that the agent refuses. Each time the message says why, and the last good kernel stays.

use crate::bench::{Bench, SIZE, check, in_use, problem};
use crate::material::{
    EXPIRED, REVOKED, ROOT, SIGNER, STRANGER, digest, in_hours, kernel, key, keyring, manifest, signed,
};
use lightpath_agent::{Agent, Settings};
use lightpath_manifest::{Keyring, ListedKey, Manifest};

#[test]
fn manifests_that_do_not_count_are_refused_and_the_kernel_in_use_stays() {
    let (bench, mut agent) = Bench::with_kernel();
    let new = kernel(2, SIZE);
    bench.server.offer(2, 8, &new);
    let good = manifest(2, 8, &new);
    let by = |number: u8| good.signed(&key(number));
    let with = |change: fn(&mut Manifest)| {
        let mut changed = good.clone();
        change(&mut changed);
        changed.signed(&key(SIGNER))
    };
    let old = manifest(1, 8, &kernel(1, SIZE)).signed(&key(SIGNER));
    let mixed = by(SIGNER).split("signature").next().unwrap().to_owned() + &old[old.find("signature").unwrap()..];
    for (document, reason) in [
        (by(SIGNER).replace("version 2", "version 3"), "the manifest's signature is wrong"),
        (mixed, "the manifest's signature is wrong"),
        (by(STRANGER), "which the keyring does not list"),
        (by(EXPIRED), "the manifest's key counts from"),
        (by(REVOKED), "which is revoked"),
        (with(|manifest| manifest.expires = in_hours(0)), "the manifest counts from"),
        (with(|manifest| manifest.issued = in_hours(1)), "is the clock of this device right?"),
        (with(|manifest| manifest.generation = 6), "generation 6, but generation 7 was accepted before"),
        (with(|manifest| manifest.display = "venus".to_owned()), "display venus, but pluto"),
        (
            with(|manifest| manifest.optics.wavelength_pm = 638_000),
            "is for wavelength_pm 638000, place distance_nm 150000000, but wavelength_pm 515000, place",
        ),
        (with(|manifest| manifest.optics.place = "focal_plane 1".to_owned()), "place focal_plane 1, but"),
        (with(|manifest| manifest.format = "f16".to_owned()), "format f16, but compact"),
        ("<html>\n".to_owned(), "line 1 must begin with"),
        ("x".repeat(1 << 20), "but may have at most 4096"),
        (String::new(), "lines of printable ASCII"),
    ] {
        bench.server.change(|script| script.manifest = document);
        let found = problem(&mut agent);
        assert!(found.starts_with("refused the manifest of the server") && found.contains(reason), "{reason}: {found}");
        bench.assert_uses(1);
    }
    assert!(bench.server.take_requests().iter().all(|request| !request.is_for_file()));
    bench.server.change(|script| script.manifest = by(SIGNER));
    assert_eq!(check(&mut agent).unwrap().version, 2);
    bench.assert_uses(2);
}

#[test]
fn lower_generation_is_refused_after_a_restart_and_an_equal_one_with_another_version_is_accepted() {
    let (bench, agent) = Bench::with_kernel();
    drop(agent);
    let mut agent = bench.agent();
    bench.server.offer(2, 6, &kernel(2, SIZE));
    assert!(problem(&mut agent).contains("generation 6, but generation 7"));
    // Two groups of devices have different versions at one generation while a version is rolled out in stages.
    bench.server.offer(2, 7, &kernel(2, SIZE));
    check(&mut agent).unwrap();
    bench.assert_uses(2);
    // A generation counts as soon as its manifest is accepted, though its file is missing.
    let missing = manifest(3, 9, &kernel(3, SIZE)).signed(&key(SIGNER));
    bench.server.change(|script| script.manifest = missing);
    assert!(problem(&mut agent).contains("the server refused the file (404"));
    drop(agent);
    bench.server.offer(1, 8, &kernel(1, SIZE));
    assert!(problem(&mut bench.agent()).contains("generation 8, but generation 9"));
    assert_eq!(in_use(&bench.directory()), Some(digest(&kernel(2, SIZE))));
}

#[test]
fn keyrings_are_renewed_when_needed_and_refused_if_they_do_not_count() {
    let (bench, mut agent) = Bench::with_kernel();
    let listed = ListedKey { key: key(STRANGER).public(), from: in_hours(-1), until: in_hours(100) };
    let next = Keyring { keys: vec![listed], ..keyring(2) };
    let by_stranger = manifest(2, 8, &kernel(2, SIZE)).signed(&key(STRANGER));
    bench.server.offer(2, 8, &kernel(2, SIZE));
    bench.server.change(|script| script.manifest = by_stranger);
    let expired = Keyring { expires: in_hours(0), ..next.clone() };
    for (document, reason) in [
        (next.signed(&[&key(STRANGER)]), "the keyring is not signed by a root key of this device"),
        (signed(&next).replace("version 2", "version 3"), "the keyring is not signed by a root key"),
        (signed(&expired), "the keyring counts from"),
        (signed(&Keyring { version: 1, ..next.clone() }), "version 1 like the known one, but other keys"),
        (signed(&Keyring { version: 0, ..next.clone() }), "the keyring has version 0, but version 1 is known"),
    ] {
        bench.server.change(|script| script.keyring = document);
        let found = problem(&mut agent);
        assert!(found.starts_with("refused the keyring of the server") && found.contains(reason), "{reason}: {found}");
        bench.assert_uses(1);
    }
    bench.server.change(|script| script.keyring = signed(&next));
    check(&mut agent).unwrap();
    bench.assert_uses(2);
    drop(agent);
    // A lost keyring does not bring an older one back: the state knows the version.
    std::fs::remove_file(bench.directory().join("keyring")).unwrap();
    bench.server.change(|script| script.keyring = signed(&keyring(1)));
    assert!(problem(&mut bench.agent()).contains("version 1, but version 2 was accepted before"));
    bench.assert_uses(2);
}

#[test]
fn keyring_near_its_end_is_renewed_and_a_new_root_key_is_followed() {
    let bench = Bench::new();
    let moved = Keyring { roots: vec![key(STRANGER).public()], ..keyring(2) };
    let ending = Keyring { expires: in_hours(2), ..keyring(1) };
    bench.server.change(|script| script.keyring = signed(&ending));
    let mut agent = bench.agent();
    check(&mut agent).unwrap();
    bench.server.change(|script| script.keyring = moved.signed(&[&key(ROOT)]));
    check(&mut agent).unwrap();
    drop(agent);
    // Only the new root key signs the third keyring. Devices that pinned the old one follow, also after a restart.
    let third = Keyring { version: 3, ..moved }.signed(&[&key(STRANGER)]);
    bench.server.change(|script| script.keyring = third);
    bench.server.offer(2, 8, &kernel(2, SIZE));
    check(&mut bench.agent()).unwrap();
    bench.assert_uses(2);
    check(&mut bench.agent()).unwrap();
    assert!(lightpath_agent::status(&bench.directory()).0.contains("keyring: version 3"));
}

#[test]
fn other_root_keys_on_the_command_line_begin_anew() {
    let (bench, agent) = Bench::with_kernel();
    drop(agent);
    let other = Keyring { roots: vec![key(STRANGER).public()], ..keyring(1) };
    bench.server.offer(2, 1, &kernel(2, SIZE));
    bench.server.change(|script| script.keyring = other.signed(&[&key(STRANGER)]));
    assert!(problem(&mut bench.agent()).contains("generation 1, but generation 7"));
    let mut settings = bench.settings();
    settings.roots = vec![key(STRANGER).public()];
    // The last good kernel stays until the one of the new server is complete.
    let mut agent = lightpath_agent::Agent::start(settings.clone()).unwrap();
    bench.assert_uses(1);
    check(&mut agent).unwrap();
    bench.assert_uses(2);
    drop(agent);
    bench.server.offer(3, 2, &kernel(3, SIZE));
    check(&mut lightpath_agent::Agent::start(settings).unwrap()).unwrap();
    bench.assert_uses(3);
}

#[test]
fn settings_that_were_wrong_once_do_not_forget_the_generation() {
    let (bench, agent) = Bench::with_kernel();
    drop(agent);
    let wrong_root = Settings { roots: vec![key(STRANGER).public()], ..bench.settings() };
    let id = Some("515nm-150mm".to_owned());
    let wrong_display = Settings { display: "venus".to_owned(), kernel: id, ..bench.settings() };
    for (wrong, reason) in [(wrong_root, "not signed by a root key of this device"), (wrong_display, "but venus")] {
        let mut agent = Agent::start(wrong).unwrap();
        let found = problem(&mut agent);
        assert!(found.contains(reason), "{found}");
        drop(agent);
        bench.server.offer(2, 6, &kernel(2, SIZE));
        assert!(problem(&mut bench.agent()).contains("generation 6, but generation 7 was accepted before"));
        bench.server.offer(1, 7, &kernel(1, SIZE));
        check(&mut bench.agent()).unwrap();
        bench.assert_uses(1);
    }
}
