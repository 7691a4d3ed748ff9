//! Commands on a data folder that their user cannot write, as on read-only media.

use lightpath_artifacts::Artifacts;
use lightpath_fixtures::display;
use lightpath_server::database::DATABASE;
use lightpath_store::Store;
use std::fs::{self, Permissions};
use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _};
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;

/// User and group that own no files of the tests: `nobody`.
const NOBODY: u32 = 65_534;

/// Sets the modes of a folder and of everything in it.
fn set_modes(path: &Path, folders: u32, files: u32) {
    for entry in fs::read_dir(path).unwrap() {
        let entry = entry.unwrap();
        match entry.file_type().unwrap().is_dir() {
            true => set_modes(&entry.path(), folders, files),
            false => fs::set_permissions(entry.path(), Permissions::from_mode(files)).unwrap(),
        }
    }
    fs::set_permissions(path, Permissions::from_mode(folders)).unwrap();
}

/// Runs `lightpathd` as a user who is not root, because root can write to every folder.
fn lightpathd(arguments: &[&str], data_dir: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lightpathd"));
    command.args(arguments).arg("--data-dir").arg(data_dir).current_dir("/");
    if fs::metadata(data_dir).unwrap().uid() == 0 {
        command.uid(NOBODY).gid(NOBODY);
    }
    command.output().unwrap()
}

fn assert_ended(output: &Output, code: i32, sign: &str) {
    let text = [output.stdout.as_slice(), &output.stderr].concat();
    let text = String::from_utf8_lossy(&text);
    assert_eq!(output.status.code(), Some(code), "{text}");
    assert!(text.contains(sign), "{text}");
}

#[tokio::test]
async fn read_only_folder_is_checked_and_backed_up() {
    let folder = TempDir::new().unwrap();
    fs::set_permissions(folder.path(), Permissions::from_mode(0o755)).unwrap();
    let (data, closed) = (folder.path().join("data"), folder.path().join("closed"));
    let artifacts = Artifacts::open(&data).unwrap();
    let store = Store::open(&data.join(DATABASE)).await.unwrap();
    store.create_display(&display("lab"), 1).await.unwrap();
    let digest = artifacts.put_bytes(b"photo".to_vec()).await.unwrap();
    store.record_artifact(&digest, 5, "", None, 1).await.unwrap().unwrap();
    drop(artifacts);

    // A part of the database is still in its log, as after a power failure.
    fs::create_dir(&closed).unwrap();
    for name in [DATABASE, "lightpath.db-wal"] {
        fs::copy(data.join(name), closed.join(name)).unwrap();
    }
    set_modes(&closed, 0o555, 0o444);
    assert_ended(&lightpathd(&["check"], &closed), 2, "copy the folder to a disk that can be written");
    // The server of another user is running.
    set_modes(&data, 0o555, 0o444);
    assert_ended(&lightpathd(&["check"], &data), 0, "artifacts             1 (");
    set_modes(&data, 0o755, 0o644);
    store.close().await;

    set_modes(&data, 0o555, 0o444);
    assert_ended(&lightpathd(&["check"], &data), 0, "artifacts             1 (");
    let copies = folder.path().join("copies");
    fs::create_dir(&copies).unwrap();
    fs::set_permissions(&copies, Permissions::from_mode(0o777)).unwrap();
    let copy = copies.join("copy");
    assert_ended(&lightpathd(&["backup", copy.to_str().unwrap()], &data), 0, "0 jobs, 1 artifacts");
    assert_ended(&lightpathd(&["check"], &copy), 0, "artifacts             1 (");
    // Only then the owner can remove the folders.
    set_modes(&data, 0o755, 0o644);
    set_modes(&closed, 0o755, 0o644);
}
