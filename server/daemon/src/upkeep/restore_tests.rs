//! Tests of restores: what they refuse, and what nobody can do while one runs or after it died.

use super::tests::{TestData, file};
use super::*;
use crate::database::DATABASE;
use lightpath_domain::access::{Caller, Role, Secret};
use lightpath_store::Store;
use std::fs::{self, File};
use std::io::Write as _;
use std::path::Path;
use std::process::ExitCode;

/// A restore that waits at its only artifact until the test provides the bytes.
struct HaltedRestore {
    fifo: PathBuf,
    running: std::thread::JoinHandle<Result<Report, UpkeepError>>,
}

impl HaltedRestore {
    /// Starts a restore, and returns when it has begun to write.
    fn start(backup: &Path, data_dir: &Path, artifact: &str) -> (Self, File) {
        let fifo = file(backup, "artifacts", artifact);
        fs::remove_file(&fifo).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(&fifo).status().unwrap().success());
        let (backup, data_dir) = (backup.to_owned(), data_dir.to_owned());
        let running = std::thread::spawn(move || {
            tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap().block_on(restore(
                &backup,
                &data_dir,
                &RestoredTokens::Keep,
            ))
        });
        // Opening the pipe waits for the restore to open its other end.
        let bytes = File::options().write(true).open(&fifo).unwrap();
        (Self { fifo, running }, bytes)
    }

    fn end(self, mut pipe: File, bytes: &[u8]) -> Result<Report, UpkeepError> {
        pipe.write_all(bytes).unwrap();
        drop(pipe);
        let done = self.running.join().unwrap();
        fs::remove_file(self.fifo).unwrap();
        done
    }
}

#[tokio::test]
async fn nothing_else_uses_the_folder_during_a_restore() {
    let data = TestData::new().await;
    let destination = tempfile::tempdir().unwrap();
    let (copy, restored) = (destination.path().join("backup"), destination.path().join("data"));
    backup(data.path(), &copy).await.unwrap();
    let (halted, pipe) = HaltedRestore::start(&copy, &restored, &data.photo);
    // A server or a collection that starts now is refused, and so is a command that would create a database.
    let started = Artifacts::open(&restored).map(drop).unwrap_err();
    assert!(started.to_string().contains("is locked by another process, such as a server or a restore"), "{started}");
    assert_eq!(token_create(&restored), ExitCode::from(2));
    let second = restore(&copy, &restored, &RestoredTokens::Keep).await;
    assert!(matches!(second, Err(UpkeepError::Artifacts(ArtifactError::Locked { .. }))), "{second:?}");
    assert!(!restored.join(DATABASE).exists());
    assert_eq!(halted.end(pipe, b"photo").unwrap().problems, []);
    let artifacts = Artifacts::open(&restored).unwrap();
    assert_eq!(artifacts.read_all(&data.photo).await.unwrap(), b"photo");
}

/// Runs `lightpathd token create` on a folder in a thread, because the command has a runtime of its own.
fn token_create(data_dir: &Path) -> ExitCode {
    #[derive(clap::Parser)]
    struct Line {
        #[command(subcommand)]
        command: TokenCommand,
    }
    let data_dir = data_dir.to_str().unwrap();
    let line = ["lightpathd", "create", "ada", "--role", "admin", "--data-dir", data_dir];
    let command = <Line as clap::Parser>::parse_from(line).command;
    std::thread::spawn(move || command.run()).join().unwrap()
}

#[tokio::test]
async fn incomplete_backup_is_not_restored() {
    let data = TestData::new().await;
    let destination = tempfile::tempdir().unwrap();
    let (copy, restored) = (destination.path().join("backup"), destination.path().join("data"));
    backup(data.path(), &copy).await.unwrap();
    let manifest = copy.join("backup.json");
    let text = fs::read_to_string(&manifest).unwrap();
    fs::write(&manifest, text.replace("\"database\": \"sha256-", "\"database\": \"sha256-0")).unwrap();
    let refused = restore(&copy, &restored, &RestoredTokens::Keep).await.unwrap_err().to_string();
    assert!(refused.contains("lightpath.db hashes to"), "{refused}");
    fs::remove_file(&manifest).unwrap();
    let refused = restore(&copy, &restored, &RestoredTokens::Keep).await.unwrap_err().to_string();
    assert!(refused.contains("is not a complete backup: backup.json cannot be read"), "{refused}");
    assert!(!restored.join(DATABASE).exists(), "a server would not take the folder for a complete one");
}

/// A folder in the place of a file ends a restore early, like a death: nothing tidies up.
#[tokio::test]
async fn no_server_starts_on_a_restore_that_did_not_end_and_another_restore_replaces_it() {
    let data = TestData::new().await;
    let destination = tempfile::tempdir().unwrap();
    let (copy, restored) = (destination.path().join("backup"), destination.path().join("data"));
    backup(data.path(), &copy).await.unwrap();
    let state = file(&copy, "checkpoints", &data.checkpoint);
    let bytes = fs::read(&state).unwrap();
    fs::remove_file(&state).unwrap();
    fs::create_dir(&state).unwrap();
    restore(&copy, &restored, &RestoredTokens::Keep).await.unwrap_err();
    assert!(file(&restored, "artifacts", &data.photo).exists(), "the restore had begun");

    let refused = Artifacts::open(&restored).map(drop).unwrap_err().to_string();
    assert!(refused.contains("run `lightpathd restore` with the same folder again"), "{refused}");
    assert_eq!(token_create(&restored), ExitCode::from(2));
    assert!(!restored.join(DATABASE).exists(), "nothing has made an empty database");
    assert!(matches!(backup(data.path(), &restored).await, Err(UpkeepError::NotEmpty { .. })));

    fs::remove_dir(&state).unwrap();
    fs::write(&state, bytes).unwrap();
    let notes = restored.join("notes.txt");
    fs::write(&notes, "mine").unwrap();
    assert!(matches!(restore(&copy, &restored, &RestoredTokens::Keep).await, Err(UpkeepError::NotEmpty { .. })));
    assert_eq!(fs::read_to_string(&notes).unwrap(), "mine", "a restore removes only what a restore made");
    fs::remove_file(&notes).unwrap();
    fs::write(file(&restored, "artifacts", &data.photo), b"pho").unwrap();
    assert_eq!(restore(&copy, &restored, &RestoredTokens::Keep).await.unwrap().problems, []);
    let artifacts = Artifacts::open(&restored).unwrap();
    assert_eq!(artifacts.read_all(&data.photo).await.unwrap(), b"photo");
    assert!(
        matches!(restore(&copy, &restored, &RestoredTokens::Keep).await, Err(UpkeepError::NotEmpty { .. })),
        "it is a server's now"
    );
}

/// The database is compared with the manifest as it was copied, not as it was read another time.
#[tokio::test]
async fn a_backup_that_changes_while_it_is_copied_is_refused() {
    let data = TestData::new().await;
    let destination = tempfile::tempdir().unwrap();
    let (copy, restored) = (destination.path().join("backup"), destination.path().join("data"));
    backup(data.path(), &copy).await.unwrap();
    // Who reads the pipe first gets the database, and who reads it again gets another one.
    let database = copy.join(DATABASE);
    let (first, second) = (fs::read(&database).unwrap(), b"another database".to_vec());
    fs::remove_file(&database).unwrap();
    assert!(std::process::Command::new("mkfifo").arg(&database).status().unwrap().success());
    let feeder = std::thread::spawn(move || {
        fs::write(&database, first).unwrap();
        fs::remove_file(&database).unwrap();
        fs::write(&database, second).unwrap();
    });
    let report = restore(&copy, &restored, &RestoredTokens::Keep).await.unwrap();
    feeder.join().unwrap();
    assert_eq!(report.problems, [], "what was hashed was restored");
}

/// Runs `lightpathd restore` in a thread, because the command has a runtime of its own.
fn restore_command(backup: &Path, data_dir: &Path, flags: &[&str]) -> ExitCode {
    #[derive(clap::Parser)]
    struct Line {
        #[command(flatten)]
        command: RestoreArgs,
    }
    let paths = ["restore", backup.to_str().unwrap(), "--data-dir", data_dir.to_str().unwrap()];
    let command = <Line as clap::Parser>::try_parse_from(paths.iter().chain(flags)).unwrap().command;
    std::thread::spawn(move || command.run()).join().unwrap()
}

async fn accepted_tokens(data_dir: &Path) -> Vec<String> {
    let store = Store::open(&data_dir.join(DATABASE)).await.unwrap();
    let now_ms = store.now_ms();
    let accepted = store.tokens().await.unwrap().into_iter().filter(|token| token.is_valid(now_ms));
    let names = accepted.map(|token| token.caller.name).collect();
    store.close().await;
    names
}

#[tokio::test]
async fn no_token_that_was_revoked_after_the_backup_is_accepted_without_a_word() {
    let data = TestData::new().await;
    for (name, expire_time_ms) in [("ada", None), ("bob", None), ("eve", Some(1))] {
        let caller = Caller { name: name.into(), role: Role::Admin, displays: Vec::new() };
        let hash = Secret::generate().unwrap().hash();
        data.store.create_token(&caller, &hash, expire_time_ms, 0).await.unwrap();
    }
    let destination = tempfile::tempdir().unwrap();
    let (copy, restored) = (destination.path().join("backup"), destination.path().join("data"));
    backup(data.path(), &copy).await.unwrap();
    data.store.revoke_token("ada", 1).await.unwrap();

    let refused = restore(&copy, &restored, &RestoredTokens::Undecided).await.unwrap_err().to_string();
    assert!(refused.contains("accepts the tokens ada, bob, and does not know"), "{refused}");
    assert!(refused.contains("--keep-tokens"), "{refused}");
    assert!(Artifacts::open(&restored).is_err(), "no server starts");
    assert_eq!(restore_command(&copy, &restored, &[]), ExitCode::from(2));
    let misspelt = RestoredTokens::Revoke(vec!["bob".into(), "adda".into()]);
    let refused = restore(&copy, &restored, &misspelt).await.unwrap_err().to_string();
    assert!(refused.contains("no token adda; it accepts ada, bob"), "{refused}");
    assert!(!restored.join(DATABASE).exists());

    assert_eq!(restore_command(&copy, &restored, &["--revoke-token", "ada"]), ExitCode::SUCCESS);
    assert_eq!(accepted_tokens(&restored).await, ["bob"]);
    for (flag, accepted) in [("--revoke-tokens", vec![]), ("--keep-tokens", vec!["ada", "bob"])] {
        let restored = destination.path().join(flag);
        assert_eq!(restore_command(&copy, &restored, &[flag]), ExitCode::SUCCESS);
        assert_eq!(accepted_tokens(&restored).await, accepted);
    }
    // A backup that accepts no token needs no word.
    data.store.revoke_token("bob", 1).await.unwrap();
    let copy = destination.path().join("later");
    backup(data.path(), &copy).await.unwrap();
    let report = restore(&copy, &destination.path().join("none"), &RestoredTokens::Undecided).await.unwrap();
    assert_eq!(report.problems, []);
}
