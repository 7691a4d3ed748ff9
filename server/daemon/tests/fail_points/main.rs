//! Every point, with a process that dies there and with a call that fails there: afterwards the data folder is whole, what
//! was acknowledged is there, and the work goes on.
//!
//! `LIGHTPATH_FAIL_POINTS=all cargo test --release -p lightpath-server --test fail_points -- --nocapture` breaks at every
//! passage of every point; otherwise at a few passages of each.
#![allow(clippy::unwrap_used)]

mod workload;

use lightpath_domain::job::{JobResult, JobState};
use lightpath_fail_points::{PASSED, POINT};
use lightpath_server::upkeep::{check, restore};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use tempfile::TempDir;
use workload::{Lab, Place, kernel, result_of, work};

/// Where the workload works; only in the process that it has to itself.
const PLACE: &str = "LIGHTPATH_FAIL_PLACE";
/// Names of all points; a new one belongs here.
const POINTS: [&str; 12] = [
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
    "restore.flush",
    "restore.rename",
];

/// The workload in a process of its own, which may die anywhere.
fn run(place: &Path, point: Option<&str>) -> ExitStatus {
    let mut command = Command::new(std::env::current_exe().unwrap());
    let itself = "wherever_the_process_dies_nothing_acknowledged_is_lost";
    command.args(["--exact", itself]).env(PLACE, place).stdout(Stdio::null());
    match point {
        Some(point) => command.env(POINT, point),
        None => command.env(PASSED, place.join("passed")),
    };
    command.stderr(Stdio::null()).status().unwrap()
}

fn place() -> (TempDir, Place) {
    let folder = TempDir::new().unwrap();
    let place = Place(folder.path().to_owned());
    fs::create_dir(place.data()).unwrap();
    (folder, place)
}

/// How often the whole workload passes each point.
fn passages() -> BTreeMap<String, u32> {
    let (folder, place) = place();
    assert!(run(folder.path(), None).success());
    assert!(place.promises().iter().any(|(what, _)| what == "restored"), "the workload ends: {:?}", place.promises());
    let mut passages = BTreeMap::new();
    for name in fs::read_to_string(folder.path().join("passed")).unwrap().lines() {
        *passages.entry(name.to_owned()).or_default() += 1;
    }
    passages
}

/// Which of so many passages are broken at.
fn chosen(count: u32) -> Vec<u32> {
    if std::env::var("LIGHTPATH_FAIL_POINTS").is_ok_and(|points| points == "all") {
        return (1..=count).collect();
    }
    let mut chosen = vec![1, count.div_ceil(2), count];
    chosen.dedup();
    chosen
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn wherever_the_process_dies_nothing_acknowledged_is_lost() {
    break_everywhere("die").await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn whatever_fails_nothing_acknowledged_is_lost() {
    break_everywhere("fail").await;
}

async fn break_everywhere(how: &str) {
    if let Some(place) = std::env::var_os(PLACE) {
        // This is the process that [`run`] started.
        lightpath_fail_points::arm_by_environment().unwrap();
        if let Err(error) = work(&Place(place.into())).await {
            eprintln!("{error}");
        }
        return;
    }
    let passages = passages();
    assert_eq!(passages.keys().collect::<Vec<_>>(), POINTS.iter().collect::<Vec<_>>(), "every point is passed");
    let mut broken = BTreeMap::<&str, u32>::new();
    for (name, count) in &passages {
        for passage in chosen(*count) {
            let (_folder, place) = place();
            let point = format!("{name}:{passage}:{how}");
            let ended = run(&place.0, Some(&point));
            assert!(ended.success() || how == "die", "{point}: {ended}");
            assert_kept(&place, &point).await;
            // Heartbeats and reports make a few passages more in one run than in another.
            *broken.entry(name).or_default() += u32::from(how == "fail" || !ended.success());
        }
    }
    assert!(POINTS.iter().all(|name| broken[name] > 0), "{broken:?}");
    eprintln!("{how}: nothing acknowledged was lost at {broken:?}");
}

/// The folder is whole, what was acknowledged is there, and what waits can go on.
async fn assert_kept(place: &Place, point: &str) {
    if !place.data().join(lightpath_server::upkeep::DATABASE).exists() {
        assert_eq!(place.promises(), [], "{point}");
        return;
    }
    let lab = Lab::open(&place.data()).await.unwrap();
    assert_eq!(check(&place.data()).await.unwrap().problems, [], "{point}");
    lab.run_jobs().await.unwrap_or_else(|error| panic!("{point}: {error}"));
    let mut active = 0;
    for (what, which) in place.promises() {
        match what.as_str() {
            "display" => drop(lab.store.display(&which).await.unwrap()),
            "artifact" => drop(lab.artifacts.read_all(&which).await.unwrap()),
            "job" => {
                let job = lab.store.job(&which).await.unwrap();
                match job.result {
                    Some(JobResult::Capture(result)) => {
                        assert_eq!(lab.artifacts.read_all(&result.photo).await.unwrap(), result_of(&job.request_id));
                    }
                    _ => assert!(job.request_id == "later", "{point}: {job:?}"),
                }
            }
            "succeeded" => assert_eq!(lab.store.job(&which).await.unwrap().state, JobState::Succeeded, "{point}"),
            "cancelled" => assert_eq!(lab.store.job(&which).await.unwrap().state, JobState::Cancelled, "{point}"),
            "version" => drop(lab.store.kernel_version(&kernel(), which.parse().unwrap()).await.unwrap()),
            "active" => active = which.parse().unwrap(),
            "backup" => {
                let report = restore(&place.backup(), &place.0.join("restored again")).await.unwrap();
                assert_eq!(report.problems, [], "{point}");
            }
            "restored" => assert_eq!(check(&place.0.join("restored")).await.unwrap().problems, [], "{point}"),
            other => panic!("{other}"),
        }
    }
    if active > 0 {
        assert!(lab.store.kernel(&kernel()).await.unwrap().active_version >= Some(active), "{point}");
    }
    lab.store.close().await;
    assert_eq!(check(&place.data()).await.unwrap().problems, [], "{point}, and the work after it");
}
