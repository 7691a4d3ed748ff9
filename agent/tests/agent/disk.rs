//! Full and read-only disks. Death and failure at every point are in `kills`.

use crate::bench::{Bench, SIZE, check};
use crate::material::kernel;
use std::fs;
use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _, chown};
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::Command;

/// Number of a user without rights of its own. The super user could write to a read-only directory.
const NOBODY: u32 = 65_534;

/// Everything in a directory: paths, and the bytes of files.
fn content(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut all = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() && !path.is_symlink() {
            all.extend(content(&path));
        } else {
            all.push((path.display().to_string(), fs::read(path.join("kernel")).or_else(|_| fs::read(&path)).unwrap()));
        }
    }
    all.sort();
    all
}

#[test]
fn limit_on_files_keeps_the_kernel_in_use_and_says_so() {
    let (bench, agent) = Bench::with_kernel();
    drop(agent);
    bench.server.offer(2, 8, &kernel(2, SIZE));
    // Two times 512 bytes are enough for the small files, and not for the kernel. The signal would end the program.
    let mut limited = Command::new("sh");
    limited.env_clear().args(["-c", "trap '' XFSZ; ulimit -f 2; exec \"$0\" \"$@\""]);
    let output = limited.arg(env!("CARGO_BIN_EXE_lightpath-agent")).args(bench.arguments()).output().unwrap();
    let log = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{log}");
    assert!(log.contains("could not write") && log.contains("File too large"), "{log}");
    assert!(log.contains("free some space, the agent tries again later"), "{log}");
    let requests = bench.server.take_requests();
    let report = requests.iter().find(|request| request.is_report()).unwrap();
    assert!(!report.body.contains("triedVersion") && report.body.contains("File too large"), "{report:?}");
    // The space of the part is given back.
    bench.assert_uses(1);
    check(&mut bench.agent()).unwrap();
    bench.assert_uses(2);
}

#[test]
fn kernel_that_the_disk_cannot_hold_is_not_fetched() {
    let (bench, mut agent) = Bench::with_kernel();
    let bytes = kernel(2, SIZE);
    let huge = lightpath_manifest::Manifest { size_bytes: 1 << 60, ..crate::material::manifest(2, 8, &bytes) };
    bench.server.offer(2, 8, &bytes);
    bench.server.change(|script| script.manifest = huge.signed(&crate::material::key(crate::material::SIGNER)));
    let text = crate::bench::problem(&mut agent);
    assert!(text.contains("is full: the kernel needs 1152921504606912512 bytes more"), "{text}");
    assert!(bench.server.take_requests().iter().all(|request| !request.is_for_file()));
    bench.assert_uses(1);
}

#[test]
fn read_only_directory_keeps_the_kernel_in_use_and_says_so() {
    let (bench, agent) = Bench::with_kernel();
    drop(agent);
    bench.server.offer(2, 8, &kernel(2, SIZE));
    let directory = bench.directory();
    let folders = [directory.clone(), directory.join("a"), directory.join("b")];
    fs::create_dir_all(&folders[2]).unwrap();
    let allow = |mode| {
        for folder in &folders {
            fs::set_permissions(folder, fs::Permissions::from_mode(mode)).unwrap();
        }
    };
    let mut command = bench.program();
    if fs::metadata(&directory).unwrap().uid() == 0 {
        command.uid(NOBODY).gid(NOBODY);
        fs::set_permissions(bench.folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
        for folder in &folders {
            chown(folder, Some(NOBODY), Some(NOBODY)).unwrap();
        }
    }
    allow(0o555);
    let before = content(&directory);
    let output = command.output().unwrap();
    let log = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{log}");
    assert!(log.contains("could not write") && log.contains("give the agent's user the right to write"), "{log}");
    let requests = bench.server.take_requests();
    let report = requests.iter().find(|request| request.is_report()).unwrap();
    assert!(report.body.contains("\"version\":1") && report.body.contains("could not write"), "{report:?}");
    assert_eq!(content(&directory), before);
    allow(0o755);
    check(&mut bench.agent()).unwrap();
    bench.assert_uses(2);
}
