//! A server, a directory and an agent for a test.

use crate::material::{digest, kernel, root};
use crate::server::Server;
use lightpath_agent::{Agent, Checked, Clock, Pace, Problem, Settings};
use lightpath_manifest::Optics;
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use tempfile::TempDir;

/// Size of most kernels in the tests \[bytes\]: some pieces.
pub(crate) const SIZE: usize = 100_000;

#[derive(Debug)]
pub(crate) struct Bench {
    pub(crate) server: Server,
    pub(crate) folder: TempDir,
}

impl Bench {
    /// A server that offers version 1 with generation 7, and an empty directory.
    pub(crate) fn new() -> Self {
        let bench = Self { server: Server::start(), folder: TempDir::new().unwrap() };
        bench.server.offer(1, 7, &kernel(1, SIZE));
        bench
    }

    /// A bench whose directory has version 1 in use, and an agent that is at work.
    pub(crate) fn with_kernel() -> (Self, Agent) {
        let bench = Self::new();
        let mut agent = bench.agent();
        assert_eq!(check(&mut agent).unwrap().version, 1);
        bench.assert_uses(1);
        bench.server.take_requests();
        (bench, agent)
    }

    pub(crate) fn directory(&self) -> PathBuf {
        self.folder.path().join("agent")
    }

    pub(crate) fn settings(&self) -> Settings {
        settings(&self.server.url(), &self.directory())
    }

    pub(crate) fn agent(&self) -> Agent {
        Agent::start(self.settings()).unwrap()
    }

    /// An agent that is told the kernel's id.
    pub(crate) fn agent_of(&self, kernel: &str) -> Agent {
        Agent::start(Settings { kernel: Some(kernel.to_owned()), ..self.settings() }).unwrap()
    }

    /// The real program with the arguments of a device, which checks once.
    pub(crate) fn program(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lightpath-agent"));
        command.env_clear().args(self.arguments());
        command
    }

    pub(crate) fn arguments(&self) -> Vec<String> {
        let (url, root, directory) = (self.server.url(), root(), self.directory());
        let text = format!(
            "--once --server {url} --display pluto --device bench-7 --wavelength 515nm --distance 150mm --root {root} --directory {}",
            directory.display()
        );
        text.split(' ').map(str::to_owned).collect()
    }

    /// A program for self-tests.
    pub(crate) fn script(&self, text: &str) -> PathBuf {
        use std::os::unix::fs::PermissionsExt as _;
        let path = self.folder.path().join("self-test");
        fs::write(&path, format!("#!/bin/sh\n{text}\n")).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
        path
    }

    pub(crate) fn assert_uses(&self, version: u32) {
        assert_uses(&self.directory(), version);
    }
}

/// Settings of a device that does not wait long.
pub(crate) fn settings(server: &str, directory: &Path) -> Settings {
    Settings {
        server: server.to_owned(),
        display: "pluto".to_owned(),
        device: "bench-7".to_owned(),
        optics: Optics::at_distance(515_000, 150_000_000),
        kernel: None,
        format: "compact".to_owned(),
        roots: vec![root()],
        token_file: None,
        ca_file: None,
        client: None,
        directory: directory.to_owned(),
        self_test: None,
        self_test_limit: Duration::from_secs(20),
        pace: Pace {
            wait: Duration::ZERO,
            error_pause_min: Duration::from_millis(40),
            error_pause_max: Duration::from_millis(320),
            cut_pause: Duration::from_millis(5),
            ..Pace::default()
        },
        clock: Clock::system(),
    }
}

pub(crate) fn check(agent: &mut Agent) -> Result<Checked, Problem> {
    agent.check(Duration::ZERO)
}

/// The text of a problem.
pub(crate) fn problem(agent: &mut Agent) -> String {
    check(agent).unwrap_err().to_string()
}

/// Asserts that a directory has a version in use, with all its bytes, and that nothing is left beside the slots.
pub(crate) fn assert_uses(directory: &Path, version: u32) {
    assert_eq!(in_use(directory), Some(digest(&kernel(version, SIZE))), "version {version}");
    let (text, is_good) = lightpath_agent::status(directory);
    assert!(is_good && text.contains(&format!("in use: version {version} ")), "{text}");
    assert_eq!(leftovers(directory), Vec::<String>::new());
}

/// Digest of the kernel in use.
pub(crate) fn in_use(directory: &Path) -> Option<String> {
    fs::read(directory.join("current/kernel")).ok().map(|bytes| digest(&bytes))
}

/// Files that do not belong to a directory at rest.
pub(crate) fn leftovers(directory: &Path) -> Vec<String> {
    let names = |folder: PathBuf| fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().file_name());
    let all = names(directory.to_owned()).chain(names(directory.join("a"))).chain(names(directory.join("b")));
    let known = ["a", "b", "current", "keyring", "state", "kernel", "manifest"];
    all.map(|name| name.into_string().unwrap()).filter(|name| !known.contains(&name.as_str())).collect()
}

/// Looks at `DIR/current/kernel` all the time, as an application may do at any moment.
pub(crate) struct Watcher {
    end: Arc<AtomicBool>,
    looks: Arc<AtomicU64>,
    good: Arc<Mutex<HashSet<String>>>,
    thread: Option<JoinHandle<()>>,
}

impl Watcher {
    pub(crate) fn start(directory: PathBuf) -> Self {
        let (end, looks) = (Arc::<AtomicBool>::default(), Arc::<AtomicU64>::default());
        let good = Arc::<Mutex<HashSet<String>>>::default();
        let (thread_end, thread_looks, thread_good) = (Arc::clone(&end), Arc::clone(&looks), Arc::clone(&good));
        let thread = thread::spawn(move || {
            let mut was_there = false;
            while !thread_end.load(Ordering::SeqCst) {
                match in_use(&directory) {
                    Some(found) => {
                        assert!(thread_good.lock().unwrap().contains(&found), "a wrong kernel was in use");
                        was_there = true;
                    }
                    None => assert!(!was_there, "no kernel was in use, though there was one before"),
                }
                thread_looks.fetch_add(1, Ordering::SeqCst);
                thread::sleep(Duration::from_micros(200));
            }
        });
        Self { end, looks, good, thread: Some(thread) }
    }

    /// Allows a kernel. Must be called before a server offers it.
    pub(crate) fn allow(&self, kernel: &[u8]) {
        self.good.lock().unwrap().insert(digest(kernel));
    }

    /// Ends, and returns how often it looked.
    pub(crate) fn end(mut self) -> u64 {
        self.end.store(true, Ordering::SeqCst);
        self.thread.take().unwrap().join().unwrap();
        self.looks.load(Ordering::SeqCst)
    }
}
