use crate::fault_proxy::{Fault, FaultProxy, Upstream};
use crate::material::declare;
use crate::process::{Daemon, lightpathd};
use crate::processes::socket_and_name;
use lightpath::v1;
use lightpath_fixtures::postgres_database;
use std::time::Duration;
use tempfile::TempDir;
use tokio::process::Command;
use tokio::time::{sleep, timeout};

/// The commands for operators use the database on the server, too.
#[tokio::test(flavor = "multi_thread")]
async fn operators_work_on_the_database_of_the_server() {
    let (data, url) = (TempDir::new().unwrap(), postgres_database().await);
    let folder = data.path().to_str().unwrap();
    let place = ["--data-dir", folder, "--database-url", &url];
    let run = async |command: &[&str]| lightpathd(&[command, &place].concat()).await;
    for command in [["check"].as_slice(), &["collect"], &["restored"], &["token", "list"], &["key", "list"], &["check"]]
    {
        run(command).await.assert_refused(2, &["the database is empty", "database_url"]);
    }
    let token = run(&["token", "create", "ada", "--role", "admin"]).await.ok();
    assert!(!token.trim().is_empty());

    let daemon = Daemon::start(data.path(), &["--database-url", &url]).await;
    declare(&daemon.client, "lab", 64, 48).await;
    assert!(run(&["token", "list"]).await.ok().contains("ada"));
    assert!(run(&["key", "list"]).await.ok().contains("root"));
    run(&["check"]).await.ok();
    run(&["collect", "--dry-run"]).await.ok();
    for command in ["collect", "restored"] {
        run(&[command]).await.assert_refused(2, &["lock"]);
    }
    daemon.stop().await;
    let keyring = async || run(&["key", "list", "--output", "json"]).await.json()["keyring"].as_u64().unwrap();
    let before = keyring().await;
    run(&["restored"]).await.assert_refused(2, &["accepts the tokens ada", "--keep-tokens"]);
    run(&["restored", "--revoke-token", "ada"]).await.ok();
    assert!(run(&["token", "list"]).await.ok().contains("revoked"));
    assert!(before < 1000 && keyring().await > 1_700_000_000, "devices take the keyring for newer than all before");
    run(&["collect"]).await.ok();
    assert!(!data.path().join("lightpath.db").exists(), "no second database is made");

    let copy = TempDir::new().unwrap();
    let copy = copy.path().to_str().unwrap();
    run(&["backup", copy]).await.assert_refused(2, &["PostgreSQL", "pg_dump"]);
    run(&["restore", copy]).await.assert_refused(2, &["PostgreSQL", "pg_dump"]);
}

/// A server with another data folder would find none of the files to which the database refers.
#[tokio::test(flavor = "multi_thread")]
async fn database_of_another_data_folder_is_refused() {
    let (data, other, url) = (TempDir::new().unwrap(), TempDir::new().unwrap(), postgres_database().await);
    let settings = ["--database-url", url.as_str()];
    let daemon = Daemon::start(data.path(), &settings).await;
    declare(&daemon.client, "lab", 64, 48).await;
    daemon.kill().await;

    let folder = other.path().to_str().unwrap();
    let serve = ["serve", "--listen", "127.0.0.1:0", "--data-dir", folder, "--database-url", &url];
    lightpathd(&serve).await.assert_refused(1, &["another", "data_dir", "database_url"]);

    // The files may move with their folder.
    let moved = other.path().join("moved");
    std::fs::rename(data.path(), &moved).unwrap();
    let daemon = Daemon::start(&moved, &settings).await;
    let request = v1::ListDisplaysRequest::default();
    assert_eq!(daemon.client.list_displays(request).await.unwrap().displays.len(), 1);
    daemon.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn unusable_database_is_refused_without_its_password() {
    let data = TempDir::new().unwrap();
    let serve = ["serve", "--listen", "127.0.0.1:0", "--data-dir", data.path().to_str().unwrap(), "--database-url"];
    for (url, signs) in [
        ("mysql://lab@localhost/lightpath", ["database_url", "postgres://"]),
        ("postgres://lab:geheim@127.0.0.1:1/lightpath", ["database", "refused"]),
        (
            "postgres://lab:geheim@db.invalid/lightpath",
            ["whether the connection to db.invalid is encrypted", "sslmode"],
        ),
    ] {
        let refused = lightpathd(&[serve.as_slice(), &[url]].concat()).await;
        assert!(!refused.stderr.contains("geheim"), "{refused:?}");
        refused.assert_refused(1, &signs);
    }
}

/// Waits until the server's health has this text in its answer.
async fn until_health_says(daemon: &Daemon, sign: &str) {
    let asked = async {
        loop {
            let address = format!("{}/healthz", daemon.url);
            let answer = Command::new("curl").args(["--silent", "--include", &address]).output().await.unwrap();
            if String::from_utf8_lossy(&answer.stdout).contains(sign) {
                return;
            }
            sleep(Duration::from_millis(100)).await;
        }
    };
    timeout(Duration::from_secs(25), asked).await.expect(sign);
}

/// Nothing ends the connections to a frozen machine, so only a limit on time tells that it is frozen.
#[tokio::test(flavor = "multi_thread")]
async fn frozen_database_is_noticed_before_calls_fail() {
    let (data, url) = (TempDir::new().unwrap(), postgres_database().await);
    let (socket, name) = socket_and_name(&url);
    let proxy = FaultProxy::start(Upstream::Socket(socket)).await;
    let url = format!("postgres://lightpath@127.0.0.1:{}/{name}?sslmode=disable", proxy.port);
    let daemon = Daemon::start(data.path(), &["--database-url", &url]).await;
    until_health_says(&daemon, " 200 ").await;
    proxy.set(Fault::Silence);
    until_health_says(&daemon, "database does not answer").await;
    proxy.set(Fault::None);
    until_health_says(&daemon, " 200 ").await;
    daemon.stop().await;
}
