//! What others put into the directory: the agent uses the slot that is free, and writes nothing elsewhere.

use crate::bench::{Bench, SIZE, check, in_use, problem};
use crate::material::{digest, kernel};
use lightpath_agent::{Agent, Slot};
use std::fs;
use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _, chown, symlink};
use std::os::unix::process::CommandExt as _;
use std::path::Path;

/// Number of a user without rights of its own. The super user could write to any folder.
const NOBODY: u32 = 65_534;

type Hindrance = (&'static str, fn(&Path));

/// What stands at `a` or in it, so that it cannot have a kernel.
const HINDRANCES: [Hindrance; 6] = [
    ("a file", |a| fs::write(a, "of another").unwrap()),
    ("a link that leads nowhere", |a| symlink("/nowhere", a).unwrap()),
    ("a folder in the place of the kernel", |a| fs::create_dir_all(a.join("kernel/x")).unwrap()),
    ("a folder in the place of the manifest", |a| fs::create_dir_all(a.join("manifest/x")).unwrap()),
    ("a folder in the place of the keyring", |a| fs::create_dir_all(a.join("keyring")).unwrap()),
    ("a folder in the place of the part", |a| {
        fs::create_dir_all(a.join(format!("part-{}", digest(&kernel(1, SIZE))))).unwrap();
    }),
];

#[test]
fn slot_that_cannot_be_used_is_no_obstacle_while_the_other_one_is_free() {
    for (name, hinder) in HINDRANCES {
        let bench = Bench::new();
        fs::create_dir_all(bench.directory()).unwrap();
        hinder(&bench.directory().join("a"));
        let mut agent = bench.agent();
        check(&mut agent).unwrap_or_else(|problem| panic!("{name}: {problem}"));
        assert_eq!(agent.in_use(), Some((Slot::B, 1)), "{name}");
        assert_eq!(in_use(&bench.directory()), Some(digest(&kernel(1, SIZE))), "{name}");
        // It is whole at the next start, and a 304 is enough.
        drop(agent);
        let mut agent = bench.agent();
        assert!(check(&mut agent).unwrap().is_offered, "{name}");
        assert!(lightpath_agent::status(&bench.directory()).1, "{name}");
        // Now the other one is in use: the next version says what is in the way.
        bench.server.offer(2, 8, &kernel(2, SIZE));
        if name != "a folder in the place of the part" {
            let text = problem(&mut agent);
            assert!(text.contains("/a") && text.contains("cannot be used"), "{name}: {text}");
            assert_eq!(agent.in_use(), Some((Slot::B, 1)), "{name}");
            let a = bench.directory().join("a");
            fs::remove_file(&a).or_else(|_| fs::remove_dir_all(&a)).unwrap();
        }
        check(&mut agent).unwrap_or_else(|problem| panic!("{name}: {problem}"));
        assert_eq!(agent.in_use(), Some((Slot::A, 2)), "{name}");
    }
}

#[test]
fn slot_without_rights_is_no_obstacle() {
    let bench = Bench::new();
    let directory = bench.directory();
    fs::create_dir_all(directory.join("a")).unwrap();
    let mut command = bench.program();
    if fs::metadata(&directory).unwrap().uid() == 0 {
        command.uid(NOBODY).gid(NOBODY);
        fs::set_permissions(bench.folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
        for folder in [&directory, &directory.join("a")] {
            chown(folder, Some(NOBODY), Some(NOBODY)).unwrap();
        }
    }
    for mode in [0o000, 0o555, 0o300] {
        fs::set_permissions(directory.join("a"), fs::Permissions::from_mode(mode)).unwrap();
        let output = command.output().unwrap();
        let log = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(0), "{mode:o}: {log}");
        assert_eq!(fs::read_link(directory.join("current")).unwrap(), Path::new("b"));
        fs::remove_file(directory.join("current")).unwrap();
        fs::remove_dir_all(directory.join("b")).unwrap();
    }
    fs::set_permissions(directory.join("a"), fs::Permissions::from_mode(0o755)).unwrap();
}

#[test]
fn links_in_the_directory_lead_no_byte_elsewhere() {
    let bench = Bench::new();
    let (directory, elsewhere) = (bench.directory(), bench.folder.path().join("elsewhere"));
    fs::create_dir_all(directory.join("b")).unwrap();
    fs::create_dir(&elsewhere).unwrap();
    let others: Vec<_> = ["1", "2", "3", "kernel", "x.tmp", "part-x"].map(|name| elsewhere.join(name)).to_vec();
    for other in &others {
        fs::write(other, "of another").unwrap();
    }
    let part = format!("part-{}", digest(&kernel(1, SIZE)));
    symlink(&elsewhere, directory.join("a")).unwrap();
    symlink(&others[0], directory.join("state.tmp")).unwrap();
    symlink(&others[1], directory.join("b/manifest.tmp")).unwrap();
    fs::hard_link(&others[2], directory.join("b").join(&part)).unwrap();
    let mut agent = bench.agent();
    // Again, as somebody may put them there while the agent runs.
    symlink(&others[0], directory.join("state.tmp")).unwrap();
    symlink(&others[1], directory.join("b/manifest.tmp")).unwrap();
    check(&mut agent).unwrap();
    assert_eq!(agent.in_use(), Some((Slot::B, 1)));
    assert_eq!(in_use(&directory), Some(digest(&kernel(1, SIZE))));
    for other in &others {
        assert_eq!(fs::read_to_string(other).unwrap(), "of another", "{}", other.display());
    }
    drop(agent);
    Agent::start(bench.settings()).unwrap();
    assert_eq!(fs::read_dir(&elsewhere).unwrap().count(), others.len());
}

#[test]
fn same_bytes_of_another_version_are_not_fetched_again() {
    let (bench, agent) = Bench::with_kernel();
    drop(agent);
    let mut settings = bench.settings();
    settings.self_test = Some(bench.script("echo loss 0.5"));
    let mut agent = Agent::start(settings).unwrap();
    let requests = |bench: &Bench| bench.server.take_requests().into_iter().filter(|one| one.is_for_file()).count();
    // In the slot in use.
    bench.server.offer(2, 8, &kernel(1, SIZE));
    check(&mut agent).unwrap();
    assert_eq!((agent.in_use(), requests(&bench)), (Some((Slot::B, 2)), 0));
    assert!(lightpath_agent::status(&bench.directory()).0.contains("loss of the self-test: 0.5"), "it was tested anew");
    // In the other slot.
    bench.server.offer(3, 9, &kernel(3, SIZE));
    check(&mut agent).unwrap();
    assert_eq!((agent.in_use(), requests(&bench)), (Some((Slot::A, 3)), 1));
    bench.server.offer(4, 10, &kernel(1, SIZE));
    check(&mut agent).unwrap();
    assert_eq!((agent.in_use(), requests(&bench)), (Some((Slot::B, 4)), 0));
    // Two files, so that damage of one does not reach the other.
    bench.server.offer(5, 11, &kernel(1, SIZE));
    check(&mut agent).unwrap();
    assert_eq!((agent.in_use(), requests(&bench)), (Some((Slot::A, 5)), 0));
    fs::write(bench.directory().join("b/kernel"), "damaged").unwrap();
    assert_eq!(in_use(&bench.directory()), Some(digest(&kernel(1, SIZE))));
    // Damaged bytes are not taken.
    fs::write(bench.directory().join("a/kernel"), vec![7; SIZE]).unwrap();
    bench.server.offer(6, 12, &kernel(1, SIZE));
    check(&mut agent).unwrap();
    assert_eq!((agent.in_use(), requests(&bench)), (Some((Slot::B, 6)), 1));
    assert_eq!(in_use(&bench.directory()), Some(digest(&kernel(1, SIZE))));
}
