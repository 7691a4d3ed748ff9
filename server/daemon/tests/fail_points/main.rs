//! Tests of failures at every fail point: a process dies there, or a call fails there. Afterwards the data folder is
//! sound, everything that was acknowledged is stored, and the work continues.
//!
//! `LIGHTPATH_FAIL_POINTS=all cargo test --release -p lightpath-server --test fail_points -- --nocapture` fails at
//! every passage of every point. Without the variable, the tests fail at up to three passages of each point.
#![allow(clippy::unwrap_used)]

mod workload;

use lightpath_domain::job::{JobResult, JobState};
use lightpath_fail_points::{PASSED, POINT};
use lightpath_server::upkeep::{RestoredTokens, check, restore};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::sync::Arc;
use tempfile::TempDir;
use tokio::sync::Semaphore;
use tokio::task::JoinSet;
use workload::{Server, WorkFolder, kernel, result_of, work};

/// Environment variable with the folder of the workload. Only the process that runs the workload has it.
const WORK_FOLDER: &str = "LIGHTPATH_FAIL_PLACE";
/// Number of workloads that run at a time.
const RUNS_AT_ONCE: usize = 12;
/// Names of all points. A new point must be added here.
const POINTS: [&str; 14] = [
    "audit.flush",
    "audit.rename",
    "backup.flush",
    "backup.manifest",
    "commit",
    "committed",
    "file.flush",
    "file.remove",
    "file.rename",
    "folder.flush",
    "restore.begin",
    "restore.end",
    "restore.flush",
    "restore.rename",
];

/// Runs the workload in a process of its own, which may die at any point.
fn run(folder: &Path, point: Option<&str>) -> ExitStatus {
    let mut command = Command::new(std::env::current_exe().unwrap());
    let this_test = "death_at_any_point_loses_nothing_acknowledged";
    command.args(["--exact", this_test]).env(WORK_FOLDER, folder).stdout(Stdio::null());
    match point {
        Some(point) => command.env(POINT, point),
        None => command.env(PASSED, folder.join("passed")),
    };
    command.stderr(Stdio::null()).status().unwrap()
}

/// A new folder for a workload, which is removed when the first value is dropped.
fn work_folder() -> (TempDir, WorkFolder) {
    let folder = TempDir::new().unwrap();
    let work_folder = WorkFolder(folder.path().to_owned());
    fs::create_dir(work_folder.data()).unwrap();
    (folder, work_folder)
}

/// Number of times that the whole workload passes each point.
fn passages() -> BTreeMap<String, u32> {
    let (folder, work_folder) = work_folder();
    assert!(run(folder.path(), None).success());
    let acknowledgements = work_folder.acknowledgements();
    assert!(
        acknowledgements.iter().any(|(kind, _)| kind == "restored"),
        "the workload did not end: {acknowledgements:?}"
    );
    let mut passages = BTreeMap::new();
    for name in fs::read_to_string(folder.path().join("passed")).unwrap().lines() {
        *passages.entry(name.to_owned()).or_default() += 1;
    }
    passages
}

/// Chooses the passages at which to fail, out of `count` passages: all of them, or the first, middle and last.
fn chosen_passages(count: u32) -> Vec<u32> {
    if std::env::var("LIGHTPATH_FAIL_POINTS").is_ok_and(|points| points == "all") {
        return (1..=count).collect();
    }
    let mut chosen = vec![1, count.div_ceil(2), count];
    chosen.dedup();
    chosen
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn death_at_any_point_loses_nothing_acknowledged() {
    fail_at_all_points("die").await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn failure_at_any_point_loses_nothing_acknowledged() {
    fail_at_all_points("fail").await;
}

/// Runs the workload once for each chosen passage, with a failure of kind `kind` (`die` or `fail`) there.
async fn fail_at_all_points(kind: &'static str) {
    if let Some(folder) = std::env::var_os(WORK_FOLDER) {
        // This is the process that [`run`] started.
        lightpath_fail_points::arm_by_environment().unwrap();
        if let Err(error) = work(&WorkFolder(folder.into())).await {
            eprintln!("{error}");
        }
        return;
    }
    let passages = passages();
    assert_eq!(
        passages.keys().collect::<Vec<_>>(),
        POINTS.iter().collect::<Vec<_>>(),
        "the workload passes every point"
    );
    // The runs mostly wait for the disk.
    let (turns, mut runs) = (Arc::new(Semaphore::new(RUNS_AT_ONCE)), JoinSet::new());
    for (name, count) in passages {
        for passage in chosen_passages(count) {
            let (name, turns) = (name.clone(), Arc::clone(&turns));
            runs.spawn(async move {
                let _turn = turns.acquire_owned().await.unwrap();
                let has_failed = fail_at(&format!("{name}:{passage}:{kind}"), kind).await;
                (name, has_failed)
            });
        }
    }
    let mut failures = BTreeMap::<String, u32>::new();
    while let Some(ended) = runs.join_next().await {
        let (name, has_failed) = ended.unwrap();
        *failures.entry(name).or_default() += u32::from(has_failed);
    }
    assert!(POINTS.iter().all(|name| failures[*name] > 0), "{failures:?}");
    eprintln!("{kind}: nothing acknowledged was lost; failures at each point: {failures:?}");
}

/// Runs the workload with a failure at a point, and checks what is left. Returns whether the point was reached: the
/// number of passages differs a little between runs, because of heartbeats and progress reports, so the last may not be
/// reached.
async fn fail_at(point: &str, kind: &str) -> bool {
    let (_folder, work_folder) = work_folder();
    let (folder, armed) = (work_folder.0.clone(), point.to_owned());
    let status = tokio::task::spawn_blocking(move || run(&folder, Some(&armed))).await.unwrap();
    assert!(status.success() || kind == "die", "{point}: {status}");
    assert_nothing_lost(&work_folder, point).await;
    kind == "fail" || !status.success()
}

/// Asserts that the folder is sound, that everything acknowledged is stored, and that waiting jobs can continue.
async fn assert_nothing_lost(work_folder: &WorkFolder, point: &str) {
    if !work_folder.data().join(lightpath_server::database::DATABASE).exists() {
        assert_eq!(work_folder.acknowledgements(), [], "{point}");
        return;
    }
    let server = Server::open(&work_folder.data()).await.unwrap();
    assert_eq!(check(&work_folder.data()).await.unwrap().problems, [], "{point}");
    server.run_jobs().await.unwrap_or_else(|error| panic!("{point}: {error}"));
    let mut active = 0;
    for (kind, id) in work_folder.acknowledgements() {
        match kind.as_str() {
            "display" => drop(server.store.display(&id).await.unwrap()),
            "artifact" => drop(server.artifacts.read_all(&id).await.unwrap()),
            "job" => {
                let job = server.store.job(&id).await.unwrap();
                match job.result {
                    Some(JobResult::SimulateCapture(result)) => {
                        assert_eq!(server.artifacts.read_all(&result.photo).await.unwrap(), result_of(&job.request_id));
                    }
                    _ => assert!(job.request_id == "later", "{point}: {job:?}"),
                }
            }
            "succeeded" => assert_eq!(server.store.job(&id).await.unwrap().state, JobState::Succeeded, "{point}"),
            "cancelled" => assert_eq!(server.store.job(&id).await.unwrap().state, JobState::Cancelled, "{point}"),
            "version" => drop(server.store.kernel_version(&kernel(), id.parse().unwrap()).await.unwrap()),
            "active" => active = id.parse().unwrap(),
            "backup" => {
                let report =
                    restore(&work_folder.backup(), &work_folder.0.join("restored again"), &RestoredTokens::Keep)
                        .await
                        .unwrap();
                assert_eq!(report.problems, [], "{point}");
            }
            "restored" => assert_eq!(check(&work_folder.0.join("restored")).await.unwrap().problems, [], "{point}"),
            other => panic!("{other}"),
        }
    }
    if active > 0 {
        assert!(server.store.kernel(&kernel()).await.unwrap().active_version >= Some(active), "{point}");
    }
    server.store.close().await;
    assert_eq!(check(&work_folder.data()).await.unwrap().problems, [], "{point}, after further work");
}
