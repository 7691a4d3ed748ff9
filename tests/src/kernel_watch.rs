use crate::material::kernel_file;
use crate::process::{Daemon, lightpath, lightpath_command};
use std::process::Stdio;
use tempfile::TempDir;
use tokio::io::{AsyncBufReadExt as _, AsyncRead, BufReader, Lines};

const KERNEL: [&str; 4] = ["--display", "lab", "--distance", "50mm"];

/// Reads lines until one contains `sign`.
async fn until(lines: &mut Lines<BufReader<impl AsyncRead + Unpin>>, sign: &str) {
    loop {
        let line = lines.next_line().await.unwrap().unwrap_or_else(|| panic!("no line with {sign}"));
        if line.contains(sign) {
            return;
        }
    }
}

/// Runs a command about the kernel, which must succeed.
async fn run(daemon: &Daemon, name: &str, rest: &[&str]) -> String {
    lightpath(&daemon.url, &[&["kernel", name][..], &KERNEL, rest].concat()).await.ok()
}

#[tokio::test(flavor = "multi_thread")]
async fn changes_of_the_active_version_are_printed_across_a_restart() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let daemon = Daemon::start(&folder.path().join("data"), &[]).await;
    let display =
        ["display", "create", "lab", "--resolution", "96x64", "--pixel-pitch", "8um", "--wavelength", "515nm"];
    lightpath(&daemon.url, &display).await.ok();
    for tilt in [0.1, 0.2] {
        std::fs::write(at("k.safetensors"), kernel_file(96, 64, tilt)).unwrap();
        run(&daemon, "import", &[&at("k.safetensors")]).await;
    }
    let log = at("log");
    let exec = format!("echo $LIGHTPATH_KERNEL $LIGHTPATH_ACTIVE_VERSION >> {log}");
    let mut command = lightpath_command(&daemon.url, &[&["kernel", "watch"][..], &KERNEL, &["--exec", &exec]].concat());
    let mut watch = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(watch.stdout.take().unwrap()).lines();
    let mut notes = BufReader::new(watch.stderr.take().unwrap()).lines();
    until(&mut lines, "displays/lab/kernels/515nm-50mm: no version is active").await;
    run(&daemon, "promote", &["--version", "1", "--force", "--reason", "test"]).await;
    until(&mut lines, "version 1 is active (before: no version)").await;

    let address = daemon.url.trim_start_matches("http://").to_owned();
    daemon.stop().await;
    until(&mut notes, "connection lost").await;
    let daemon = Daemon::start_at(&folder.path().join("data"), &address, &[]).await;
    until(&mut notes, "reconnected").await;
    run(&daemon, "promote", &["--version", "2", "--force", "--reason", "test"]).await;
    until(&mut lines, "version 2 is active (before: version 1)").await;
    let kernel = "displays/lab/kernels/515nm-50mm";
    let ran = std::fs::read_to_string(&log).unwrap();
    assert!(ran.starts_with(&format!("{kernel} 0\n{kernel} 1\n")), "{ran}");

    let id = watch.id().unwrap().to_string();
    assert!(std::process::Command::new("kill").args(["-s", "INT", &id]).status().unwrap().success());
    assert_eq!(watch.wait().await.unwrap().code(), Some(0));
    daemon.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn dry_run_says_what_would_be_written_and_writes_nothing() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let daemon = Daemon::start(&folder.path().join("data"), &[]).await;
    let display =
        ["display", "create", "lab", "--resolution", "96x64", "--pixel-pitch", "8um", "--wavelength", "515nm"];
    lightpath(&daemon.url, &display).await.ok();
    std::fs::write(at("k.safetensors"), kernel_file(96, 64, 0.1)).unwrap();
    run(&daemon, "import", &[&at("k.safetensors")]).await;
    run(&daemon, "promote", &["--version", "1", "--force", "--reason", "test"]).await;
    for (name, format) in [("out.safetensors", "safetensors"), ("out.lpk", "compact"), ("out.npz", "npz")] {
        let said = run(&daemon, "fetch", &["--dry-run", "-o", &at(name)]).await;
        assert!(!folder.path().join(name).exists(), "{name}");
        run(&daemon, "fetch", &["-o", &at(name)]).await;
        let bytes = std::fs::read(at(name)).unwrap();
        let digest = lightpath::digest_of(&bytes);
        for sign in [&digest, format, "kernels/515nm-50mm/versions/1", &at(name), "not written"] {
            assert!(said.contains(sign), "{sign} is not in {said}");
        }
    }
    let mut piped = lightpath_command(&daemon.url, &[&["kernel", "fetch"][..], &KERNEL, &["-o", "-"]].concat());
    let piped = piped.output().await.unwrap();
    assert_eq!(piped.stdout, std::fs::read(at("out.safetensors")).unwrap());
    let refused = lightpath(&daemon.url, &[&["kernel", "fetch"][..], &KERNEL, &["-o", &at("k.onnx")]].concat()).await;
    refused.assert_refused(2, &["the extension must say the format", ".lpk"]);
    daemon.stop().await;
}
