//! Death and failure at every point, and death at any time. Afterwards the kernel in use is whole, and the next run ends
//! with the version that the server offers.

use crate::bench::{Bench, SIZE, Watcher, assert_uses, check, in_use, leftovers, settings};
use crate::material::{digest, kernel, keyring, next_random, signed};
use crate::server::Sending;
use lightpath_agent::{Agent, Settings};
use lightpath_fail_points::{PASSED, POINT};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Environment variables of the process that a test starts: directory, server and self-test.
const DIRECTORY: &str = "LIGHTPATH_AGENT_DIRECTORY";
const SERVER: &str = "LIGHTPATH_AGENT_SERVER";
const SELF_TEST: &str = "LIGHTPATH_AGENT_SELF_TEST";
/// Name of the test that such a process runs.
const WORK: &str = "kills::death_at_every_point_leaves_a_whole_kernel_in_use";
/// Names of all points. A new point must be added here.
const POINTS: [&str; 11] = [
    "file.flush",
    "file.remove",
    "file.rename",
    "file.write",
    "folder.flush",
    "kernel.used",
    "link.create",
    "link.rename",
    "part.flush",
    "part.truncate",
    "part.write",
];
/// Kills at random times.
const KILLS: u32 = 200;
/// Limit on the time until a kill, for busy machines.
const KILL_AFTER_MAX: Duration = Duration::from_millis(150);

/// A directory as an agent finds it, and a server.
struct Scene {
    name: &'static str,
    bench: Bench,
    self_test: PathBuf,
    /// Version in use at the end.
    ends_with: u32,
    /// Version of the whole kernel that is in use at the start; 0: none, or a damaged one.
    begins_with: u32,
}

impl Scene {
    fn new(name: &'static str, begins_with: u32, ends_with: u32, prepare: impl FnOnce(&Bench)) -> Self {
        let bench = Bench::new();
        let self_test = bench.script("grep -aq '^kernel 4$' \"$1\" && exit 1; echo loss 0.5");
        prepare(&bench);
        Self { name, bench, self_test, ends_with, begins_with }
    }

    /// A copy of the directory.
    fn copy(&self) -> TempDir {
        let folder = TempDir::new().unwrap();
        let from = self.bench.directory();
        if from.exists() {
            assert!(Command::new("cp").arg("-a").arg(from).arg(folder.path()).status().unwrap().success());
        }
        folder
    }

    fn settings(&self, directory: &Path) -> Settings {
        Settings { self_test: Some(self.self_test.clone()), ..settings(&self.bench.server.url(), directory) }
    }

    /// Runs an agent in a process of its own, which may die at a point.
    fn run(&self, folder: &Path, point: Option<&str>) -> ExitStatus {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", WORK]).env(DIRECTORY, folder.join("agent")).env(SERVER, self.bench.server.url());
        command.env(SELF_TEST, &self.self_test).stdout(Stdio::null()).stderr(Stdio::null());
        if let Some(point) = point {
            command.env(POINT, point);
        }
        command.env(PASSED, folder.join("passed")).status().unwrap()
    }

    /// Number of times that a run passes each point.
    fn passages(&self) -> BTreeMap<String, u32> {
        let folder = self.copy();
        assert!(self.run(folder.path(), None).success(), "{}", self.name);
        assert_uses(&folder.path().join("agent"), self.ends_with);
        passages_in(folder.path())
    }

    /// Runs an agent with a failure at a point, checks what is left, and lets another agent finish.
    fn fail_at(&self, point: &str) {
        let folder = self.copy();
        let directory = folder.path().join("agent");
        let (name, rest) = point.split_once(':').unwrap();
        let (passage, kind) = rest.split_once(':').unwrap();
        let has_died = !self.run(folder.path(), Some(point)).success();
        let passes = passages_in(folder.path()).get(name).copied().unwrap_or(0);
        let is_reached = passes >= passage.parse().unwrap();
        // The network decides in how many pieces a file arrives, so this run may write fewer than the first one.
        assert!(is_reached || name == "part.write", "{}, {point}", self.name);
        assert_eq!(has_died, is_reached && kind == "die", "{}, {point}", self.name);
        let found = in_use(&directory);
        let allowed = [self.begins_with, self.ends_with].map(|version| Some(digest(&kernel(version, SIZE))));
        if self.begins_with > 0 {
            assert!(allowed.contains(&found), "{}, {point}", self.name);
        } else if self.name != "damage" {
            assert!(found.is_none() || found == allowed[1], "{}, {point}", self.name);
        }
        let mut agent = Agent::start(self.settings(&directory)).unwrap();
        let checked = check(&mut agent);
        assert!(checked.is_ok() || self.name == "refused", "{}, {point}: {checked:?}", self.name);
        drop(agent);
        assert_uses(&directory, self.ends_with);
        assert_eq!(leftovers(&directory), Vec::<String>::new(), "{}, {point}", self.name);
    }
}

/// Number of times that the last run in a folder passed each point.
fn passages_in(folder: &Path) -> BTreeMap<String, u32> {
    let mut passages = BTreeMap::new();
    for name in fs::read_to_string(folder.join("passed")).unwrap().lines() {
        *passages.entry(name.to_owned()).or_default() += 1;
    }
    passages
}

/// What a process does that [`Scene::run`] started.
fn work_of_this_process() -> bool {
    let Some(directory) = std::env::var_os(DIRECTORY) else { return false };
    lightpath_fail_points::arm_by_environment().unwrap();
    let server = std::env::var(SERVER).unwrap();
    let self_test = std::env::var_os(SELF_TEST).map(PathBuf::from);
    if let Ok(mut agent) = Agent::start(Settings { self_test, ..settings(&server, Path::new(&directory)) }) {
        // A failure that a test requested is one of the results.
        let _ = check(&mut agent);
        agent.report();
    }
    true
}

fn scenes() -> Vec<Scene> {
    let install = |bench: &Bench, version: u32, generation: u64| {
        bench.server.offer(version, generation, &kernel(version, SIZE));
        check(&mut bench.agent()).unwrap();
    };
    vec![
        Scene::new("first", 0, 1, |_| {}),
        Scene::new("update", 2, 3, |bench| {
            install(bench, 1, 7);
            install(bench, 2, 8);
            bench.server.offer(3, 9, &kernel(3, SIZE));
            bench.server.change(|script| script.keyring = signed(&keyring(2)));
        }),
        Scene::new("damage", 0, 3, |bench| {
            install(bench, 1, 7);
            install(bench, 2, 8);
            fs::write(bench.directory().join("b/kernel"), "damaged").unwrap();
            fs::write(bench.directory().join("state.tmp"), "half").unwrap();
            bench.server.offer(3, 9, &kernel(3, SIZE));
        }),
        Scene::new("refused", 1, 1, |bench| {
            install(bench, 1, 7);
            bench.server.offer(4, 8, &kernel(4, SIZE));
        }),
        Scene::new("rollback", 2, 1, |bench| {
            install(bench, 1, 7);
            install(bench, 2, 8);
            bench.server.offer(1, 9, &kernel(1, SIZE));
        }),
        Scene::new("continued", 1, 2, |bench| {
            install(bench, 1, 7);
            let bytes = kernel(2, SIZE);
            fs::create_dir_all(bench.directory().join("b")).unwrap();
            fs::write(bench.directory().join("b/part-".to_owned() + &digest(&bytes)), &bytes[..SIZE / 2]).unwrap();
            bench.server.offer(2, 8, &bytes);
            bench.server.change(|script| script.sending = Sending::IgnoringRange);
        }),
    ]
}

fn fail_at_all_points(kind: &str) {
    let scenes = scenes();
    let mut all = BTreeMap::<String, u32>::new();
    let mut runs = Vec::new();
    for scene in &scenes {
        for (name, count) in scene.passages() {
            *all.entry(name.clone()).or_default() += count;
            runs.extend((1..=count).map(|passage| (scene, format!("{name}:{passage}:{kind}"))));
        }
    }
    assert_eq!(all.keys().collect::<Vec<_>>(), POINTS.iter().collect::<Vec<_>>(), "the scenes pass every point");
    // The runs mostly wait for the disk.
    const AT_ONCE: usize = 4;
    thread::scope(|scope| {
        for first in 0..AT_ONCE {
            let runs = &runs;
            scope.spawn(move || {
                runs.iter().skip(first).step_by(AT_ONCE).for_each(|(scene, point)| scene.fail_at(point))
            });
        }
    });
    eprintln!("{kind}: {} failures left a whole kernel in use; passages of each point: {all:?}", runs.len());
}

#[test]
fn death_at_every_point_leaves_a_whole_kernel_in_use() {
    if !work_of_this_process() {
        fail_at_all_points("die");
    }
}

#[test]
fn failure_at_every_point_leaves_a_whole_kernel_in_use() {
    fail_at_all_points("fail");
}

#[test]
fn death_at_any_time_leaves_a_whole_kernel_in_use() {
    let bench = Bench::new();
    let slow = Sending::Slow { piece_bytes: SIZE / 10, pause: Duration::from_millis(2) };
    bench.server.change(|script| script.sending = slow);
    let begin = Instant::now();
    assert!(bench.program().output().unwrap().status.success());
    fs::remove_dir_all(bench.directory()).unwrap();
    // Half of the checks would end, if none were continued.
    let longest = (2 * begin.elapsed()).min(KILL_AFTER_MAX);
    let watcher = Watcher::start(bench.directory());
    let (mut version, mut random, mut continued) = (1, 1, 0);
    watcher.allow(&kernel(version, SIZE));
    for _ in 0..KILLS {
        let mut child = bench.program().stderr(Stdio::null()).spawn().unwrap();
        random = next_random(random);
        let end = Instant::now() + longest.mul_f64(random as f64 / u64::MAX as f64);
        while Instant::now() < end && child.try_wait().unwrap().is_none() {
            thread::sleep(Duration::from_micros(500));
        }
        // `kill` sends SIGKILL.
        child.kill().unwrap();
        child.wait().unwrap();
        if in_use(&bench.directory()) == Some(digest(&kernel(version, SIZE))) {
            version += 1;
            watcher.allow(&kernel(version, SIZE));
            bench.server.offer(version, 6 + u64::from(version), &kernel(version, SIZE));
        }
        continued +=
            bench.server.take_requests().iter().filter(|request| request.headers.contains_key("range")).count();
    }
    let output = bench.program().output().unwrap();
    assert!(output.status.success(), "{output:?}");
    bench.assert_uses(version);
    let looks = watcher.end();
    eprintln!(
        "{KILLS} kills: {version} versions installed, {continued} downloads continued, {looks} looks at the kernel"
    );
    assert!(version > 5 && continued > 5, "the kills hit all steps: {version}, {continued}");
}
