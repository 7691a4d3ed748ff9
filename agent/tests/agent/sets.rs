//! Several kernels that change together: the application finds all of one set, or all of the other, whatever happens.

use crate::bench::settings;
use crate::material::{SIGNER, digest, kernel, key, manifest};
use crate::server::{Sending, Server};
use lightpath_agent::{Agent, KernelSet, Problem, SetChecked, Settings};
use lightpath_fail_points::{PASSED, POINT};
use lightpath_manifest::Optics;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Id, wavelength \[pm\] and folder of each kernel.
const COLOURS: [(&str, i64, &str); 3] =
    [("red", 638_000, "638nm"), ("green", 515_000, "515nm"), ("blue", 450_500, "450.5nm")];
/// Environment variables of the process that a test starts.
const DIRECTORY: &str = "LIGHTPATH_SET_DIRECTORY";
const SERVER: &str = "LIGHTPATH_SET_SERVER";
const SELF_TEST: &str = "LIGHTPATH_SET_SELF_TEST";
/// Name of the test that such a process runs.
const WORK: &str = "sets::death_at_every_point_leaves_a_whole_set_in_use";

/// Versions of red, green and blue.
type Versions = [u32; 3];

struct Bench {
    server: Server,
    folder: TempDir,
    self_test: PathBuf,
}

/// The kernel of a colour. Self-tests refuse version 66.
fn bytes(colour: usize, version: u32) -> Vec<u8> {
    kernel(100 * (colour as u32 + 1) + version, 3000)
}

fn all_settings(server: &str, directory: &Path, self_test: &Path) -> Vec<Settings> {
    let of = |(id, wavelength_pm, _): (&str, i64, &str)| Settings {
        optics: Optics::at_distance(wavelength_pm, 150_000_000),
        kernel: Some(id.to_owned()),
        self_test: Some(self_test.to_owned()),
        ..settings(server, directory)
    };
    COLOURS.map(of).to_vec()
}

impl Bench {
    fn new() -> Self {
        use std::os::unix::fs::PermissionsExt as _;
        let (server, folder) = (Server::start(), TempDir::new().unwrap());
        server.change(|script| script.kernels = COLOURS.map(|(id, _, _)| id).to_vec());
        let self_test = folder.path().join("self-test");
        fs::write(&self_test, "#!/bin/sh\n! grep -aq '^kernel .66$' \"$1\"\n").unwrap();
        fs::set_permissions(&self_test, fs::Permissions::from_mode(0o755)).unwrap();
        Self { server, folder, self_test }
    }

    fn directory(&self) -> PathBuf {
        self.folder.path().join("set")
    }

    fn settings(&self, directory: &Path) -> Vec<Settings> {
        all_settings(&self.server.url(), directory, &self.self_test)
    }

    fn set(&self, settle: Duration) -> KernelSet {
        KernelSet::start(self.settings(&self.directory()), settle).unwrap()
    }

    /// Offers these versions. All kernels of a display have the same generation.
    fn offer(&self, versions: Versions, generation: u64) {
        for (colour, (id, wavelength_pm, _)) in COLOURS.into_iter().enumerate() {
            let file = bytes(colour, versions[colour]);
            let mut manifest = manifest(versions[colour], generation, &file);
            manifest.optics = Optics::at_distance(wavelength_pm, 150_000_000);
            let document = manifest.signed(&key(SIGNER));
            self.server.change(|script| {
                script.files.insert(digest(&file), Arc::new(file));
                script.manifests.insert(id, document);
            });
        }
    }

    fn install(&self, versions: Versions, generation: u64) {
        self.offer(versions, generation);
        assert!(check(&mut self.set(Duration::ZERO)).unwrap().is_offered);
        assert_eq!(in_use(&self.directory()), Some(versions));
    }
}

fn check(set: &mut KernelSet) -> Result<SetChecked, Problem> {
    set.check(Duration::ZERO)
}

/// The versions that the application finds, which follows the link once; `None`: there is no set.
///
/// # Panics
///
/// If a kernel is missing, or is none that a server has offered.
fn in_use(directory: &Path) -> Option<Versions> {
    let slot = fs::read_link(directory.join("current")).ok()?;
    let version = |colour: usize| {
        let path = directory.join(&slot).join(COLOURS[colour].2).join("kernel");
        let found = fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let line = String::from_utf8_lossy(found.split(|byte| *byte == b'\n').next().unwrap()).into_owned();
        let version = line.strip_prefix("kernel ").unwrap().parse::<u32>().unwrap() - 100 * (colour as u32 + 1);
        assert!(found == bytes(colour, version), "the kernel is whole");
        version
    };
    Some([version(0), version(1), version(2)])
}

fn status_is_good(directory: &Path) -> bool {
    let (text, is_good) = lightpath_agent::status(directory);
    assert!(!is_good || text.contains("in use:\n  638nm: version"), "{text}");
    is_good
}

#[test]
fn kernels_change_in_one_moment() {
    let bench = Bench::new();
    bench.install([1, 1, 1], 7);
    let end = Arc::<AtomicBool>::default();
    let (thread_end, directory) = (Arc::clone(&end), bench.directory());
    let watcher = thread::spawn(move || {
        let mut seen = Vec::new();
        let mut is_last = false;
        while !is_last {
            is_last = thread_end.load(Ordering::SeqCst);
            // The slot of a set that was replaced stays until the set after it comes.
            let found = in_use(&directory).expect("there is always a set");
            if seen.last() != Some(&found) {
                seen.push(found);
            }
        }
        seen
    });
    // Each file takes its time.
    let slow = Sending::Slow { piece_bytes: 1000, pause: Duration::from_millis(5) };
    bench.server.change(|script| script.sending = slow);
    bench.install([2, 2, 2], 8);
    assert!(status_is_good(&bench.directory()));
    end.store(true, Ordering::SeqCst);
    assert_eq!(watcher.join().unwrap(), [[1, 1, 1], [2, 2, 2]]);
}

#[test]
fn no_kernel_changes_if_one_cannot_be_fetched_or_is_refused() {
    let bench = Bench::new();
    bench.install([1, 1, 1], 7);
    let mut set = bench.set(Duration::ZERO);
    bench.offer([2, 66, 2], 8);
    let refused = check(&mut set).unwrap_err();
    assert!(refused.to_string().contains("the self-test refused version 66"), "{refused}");
    assert!(!check(&mut set).unwrap().is_offered);
    assert_eq!(in_use(&bench.directory()), Some([1, 1, 1]));
    bench.server.take_requests();
    set.report();
    let reports = bench.server.wait_for(|requests| requests.iter().filter(|request| request.is_report()).count() == 3);
    for (report, tried) in reports.iter().filter(|request| request.is_report()).zip([false, true, false]) {
        let json: serde_json::Value = serde_json::from_str(&report.body).unwrap();
        assert_eq!(json["version"], 1, "what is fetched is not in use: {json}");
        assert_eq!(json["triedVersion"] == 66, tried, "{json}");
    }
    bench.offer([3, 3, 3], 9);
    // The last file, that of blue.
    bench.server.change(|script| script.next = [Sending::Whole, Sending::Whole, Sending::Status(500)].into());
    check(&mut set).unwrap_err();
    assert_eq!(in_use(&bench.directory()), Some([1, 1, 1]));
    assert!(check(&mut set).unwrap().is_offered);
    assert_eq!(in_use(&bench.directory()), Some([3, 3, 3]));
    assert!(set.has_whole_set());
    // Back to what the first slot had.
    bench.offer([1, 1, 1], 10);
    assert!(check(&mut set).unwrap().is_offered);
    assert_eq!(in_use(&bench.directory()), Some([1, 1, 1]));
}

#[test]
fn states_between_two_promotions_are_not_used() {
    let bench = Bench::new();
    bench.install([1, 1, 1], 7);
    let settle = Duration::from_millis(300);
    let mut set = bench.set(settle);
    for (versions, generation) in [([2, 1, 1], 8), ([2, 2, 1], 9), ([2, 2, 2], 10)] {
        bench.offer(versions, generation);
        let checked = check(&mut set).unwrap();
        assert!(!checked.is_offered && checked.poll_after <= settle);
        assert_eq!(in_use(&bench.directory()), Some([1, 1, 1]), "{versions:?}");
    }
    let begin = Instant::now();
    assert!(set.check_until_settled().unwrap().is_offered);
    assert!(begin.elapsed() >= settle - Duration::from_millis(100));
    assert_eq!(in_use(&bench.directory()), Some([2, 2, 2]));
    // A question for red before a promotion, and those for the others after it.
    bench.offer([3, 3, 3], 12);
    let late = manifest(3, 11, &bytes(0, 3));
    let late = lightpath_manifest::Manifest { optics: Optics::at_distance(638_000, 150_000_000), ..late };
    bench.server.change(|script| drop(script.manifests.insert("red", late.signed(&key(SIGNER)))));
    drop(set);
    let mut set = bench.set(Duration::ZERO);
    assert!(!check(&mut set).unwrap().is_offered);
    assert_eq!(in_use(&bench.directory()), Some([2, 2, 2]));
    bench.offer([3, 3, 3], 12);
    assert!(check(&mut set).unwrap().is_offered);
}

#[test]
fn damaged_and_incomplete_slots_are_not_used() {
    let bench = Bench::new();
    bench.install([1, 1, 1], 7);
    bench.install([2, 2, 2], 8);
    let directory = bench.directory();
    fs::write(directory.join("b/515nm/kernel"), "damaged").unwrap();
    assert!(!status_is_good(&directory));
    drop(bench.set(Duration::ZERO));
    assert_eq!(in_use(&directory), Some([1, 1, 1]), "the other slot has a whole set");
    // Each kernel of the slot is whole, but not the set.
    fs::copy(directory.join("kernels/638nm/b/kernel"), directory.join("a/638nm/kernel")).unwrap();
    fs::copy(directory.join("kernels/638nm/b/manifest"), directory.join("a/638nm/manifest")).unwrap();
    assert!(!status_is_good(&directory));
    drop(bench.set(Duration::ZERO));
    assert!(!directory.join("current").exists());
    let mut set = bench.set(Duration::ZERO);
    assert!(check(&mut set).unwrap().is_offered);
    assert_eq!(in_use(&directory), Some([2, 2, 2]));
    assert!(status_is_good(&directory));
    let second = KernelSet::start(bench.settings(&directory), Duration::ZERO).unwrap_err();
    assert!(matches!(second, Problem::Locked { .. }), "{second}");
}

#[test]
fn a_directory_changes_from_a_set_to_one_kernel_and_back() {
    let bench = Bench::new();
    bench.install([1, 1, 1], 7);
    let directory = bench.directory();
    let mut agent = Agent::start(bench.settings(&directory)[1].clone()).unwrap();
    assert_eq!(in_use(&directory), None, "the kernels of the set are not those of the agent");
    assert_eq!(agent.check(Duration::ZERO).unwrap().version, 1);
    drop(agent);
    assert!(lightpath_agent::status(&directory).0.contains("slot a, in use: version 1 of pluto"));
    bench.install([2, 2, 2], 8);
    assert!(status_is_good(&directory));
    assert!(!directory.join("current/kernel").exists(), "nobody takes the kernel of before for one of the set");
}

/// What the process of the next test does.
fn work_of_this_process() -> bool {
    let Some(directory) = std::env::var_os(DIRECTORY) else { return false };
    lightpath_fail_points::arm_by_environment().unwrap();
    let server = std::env::var(SERVER).unwrap();
    let self_test = PathBuf::from(std::env::var_os(SELF_TEST).unwrap());
    if let Ok(mut set) = KernelSet::start(all_settings(&server, Path::new(&directory), &self_test), Duration::ZERO) {
        let _ = check(&mut set);
    }
    true
}

fn run(bench: &Bench, folder: &Path, point: Option<&str>) -> ExitStatus {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", WORK]).env(DIRECTORY, folder.join("set")).env(SERVER, bench.server.url());
    command.env(SELF_TEST, &bench.self_test).stdout(Stdio::null()).stderr(Stdio::null());
    if let Some(point) = point {
        command.env(POINT, point);
    }
    command.env(PASSED, folder.join("passed")).status().unwrap()
}

fn copy_of(directory: &Path) -> TempDir {
    let folder = TempDir::new().unwrap();
    assert!(Command::new("cp").arg("-a").arg(directory).arg(folder.path()).status().unwrap().success());
    folder
}

#[test]
fn death_at_every_point_leaves_a_whole_set_in_use() {
    if work_of_this_process() {
        return;
    }
    let bench = Bench::new();
    bench.install([1, 1, 1], 7);
    bench.install([2, 2, 2], 8);
    bench.offer([3, 2, 3], 9);
    let folder = copy_of(&bench.directory());
    assert!(run(&bench, folder.path(), None).success());
    assert_eq!(in_use(&folder.path().join("set")), Some([3, 2, 3]));
    let mut passages = BTreeMap::<String, u32>::new();
    for name in fs::read_to_string(folder.path().join("passed")).unwrap().lines() {
        *passages.entry(name.to_owned()).or_default() += 1;
    }
    let of_point = |(name, count): (&String, &u32)| {
        let name = name.clone();
        (1..=*count).map(move |passage| (format!("{name}:{passage}"), name.clone())).collect::<Vec<_>>()
    };
    let points: Vec<(String, String)> = passages.iter().flat_map(of_point).collect();
    const AT_ONCE: usize = 4;
    thread::scope(|scope| {
        for first in 0..AT_ONCE {
            let (bench, points) = (&bench, &points);
            let work = move || {
                for (number, (point, name)) in points.iter().enumerate().skip(first).step_by(AT_ONCE) {
                    // Every third fails instead of dying.
                    let kind = if number % 3 == 2 { "fail" } else { "die" };
                    let folder = copy_of(&bench.directory());
                    let directory = folder.path().join("set");
                    let has_died = !run(bench, folder.path(), Some(&format!("{point}:{kind}"))).success();
                    // The network decides in how many pieces a file arrives.
                    assert!(kind == "fail" || has_died || name == "part.write", "{point}");
                    let found = in_use(&directory);
                    assert!([Some([2, 2, 2]), Some([3, 2, 3])].contains(&found), "{point}, {kind}: {found:?}");
                    let mut set = KernelSet::start(bench.settings(&directory), Duration::ZERO).unwrap();
                    assert!(in_use(&directory) == found, "{point}, {kind}: a start changes no whole set");
                    assert!(check(&mut set).unwrap().is_offered, "{point}, {kind}");
                    assert_eq!(in_use(&directory), Some([3, 2, 3]), "{point}, {kind}");
                    assert!(status_is_good(&directory), "{point}, {kind}");
                    let mut find = Command::new("find");
                    let left = find.arg(&directory).args(["-name", "part-*", "-o", "-name", "*.tmp"]);
                    assert_eq!(left.output().unwrap().stdout, b"", "{point}, {kind}: nothing is left behind");
                }
            };
            scope.spawn(work);
        }
    });
    eprintln!("{} deaths and failures left a whole set in use; passages of each point: {passages:?}", points.len());
    assert!(points.len() > 100, "{passages:?}");
}
