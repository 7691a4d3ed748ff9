use crate::command_line::CommandLine;
use crate::process::{Daemon, lightpath, lightpathd};
use serde_json::Value;
use tempfile::TempDir;

/// State of a check in what `--output json` printed.
fn state<'a>(findings: &'a Value, check: &str) -> &'a str {
    let checks = findings["checks"].as_array().unwrap();
    let found = checks.iter().find(|finding| finding["check"] == check);
    found.unwrap_or_else(|| panic!("{check} is not in {findings:#}"))["state"].as_str().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn doctor_checks_connection_server_and_transfer() {
    let cli = CommandLine::start().await;
    let text = cli.text("doctor --upload-mib 1").await;
    for sign in
        ["ok       TLS", "version", "requires none", "clock", "free on the server", "ms for a call", "/s, measured"]
    {
        assert!(text.contains(sign), "{sign} is not in {text}");
    }
    assert!(text.contains("warning  displays") && text.contains("lightpath display create --help"), "{text}");
    cli.text("display create toy --resolution 96x64 --pixel-pitch 8um --wavelength 515nm").await;
    let findings = cli.json("doctor --upload-mib 0").await;
    for check in ["TLS", "server", "version", "token", "clock", "disk", "displays", "latency", "terminal"] {
        assert_eq!(state(&findings, check), "ok", "{check}: {findings:#}");
    }
    assert!(findings["checks"].as_array().unwrap().iter().all(|finding| finding["check"] != "upload"));
    cli.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn doctor_names_missing_servers_tokens_and_rights() {
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let absent = lightpath(&format!("http://127.0.0.1:{port}"), &["doctor"]).await;
    assert_eq!(absent.code, Some(3), "{absent:?}");
    assert!(absent.stdout.contains("PROBLEM  server") && absent.stdout.contains("lightpathd serve"), "{absent:?}");

    let folder = TempDir::new().unwrap();
    let data = folder.path().join("data");
    let data_dir = data.to_str().unwrap();
    let daemon = Daemon::start(&data, &[]).await;
    let display =
        ["display", "create", "toy", "--resolution", "96x64", "--pixel-pitch", "8um", "--wavelength", "515nm"];
    lightpath(&daemon.url, &display).await.ok();
    daemon.stop().await;
    for (name, role) in [("tv", "viewer"), ("bench-7", "firmware")] {
        let display = if role == "firmware" { &["--display", "toy"][..] } else { &[] };
        let create = ["token", "create", name, "--role", role, "--data-dir", data_dir];
        let created = lightpathd(&[&create[..], display].concat()).await;
        assert!(created.stderr.contains("without --require-tokens"), "{created:?}");
        std::fs::write(folder.path().join(name), created.ok().trim()).unwrap();
    }
    let daemon = Daemon::start(&data, &["--require-tokens"]).await;
    let none = lightpath(&daemon.url, &["--output", "json", "doctor"]).await;
    assert_eq!(none.code, Some(1), "{none:?}");
    assert_eq!(state(&serde_json::from_str(&none.stdout).unwrap(), "token"), "problem");
    for name in ["tv", "bench-7"] {
        let token = folder.path().join(name);
        let arguments = ["--token-file", token.to_str().unwrap(), "--output", "json", "doctor"];
        let findings = lightpath(&daemon.url, &arguments).await.json();
        assert_eq!(state(&findings, "token"), "warning", "{findings:#}");
        assert_eq!(state(&findings, "latency"), "ok", "{findings:#}");
    }
    daemon.stop().await;
}
