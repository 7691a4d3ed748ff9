use crate::command_line::CommandLine;
use crate::material::kernel_file;
use crate::process::agent;
use std::os::unix::fs::PermissionsExt as _;
use std::time::{Duration, Instant};
use tokio::process::Child;
use tokio::time::sleep;

const DEVICES: usize = 20;
const KERNEL: &str = "--display lab --distance 50mm";
/// Time for all devices to do what they are told: a minute more than they need on a busy machine.
const PATIENCE: Duration = Duration::from_secs(90);

/// A server whose devices ask every second, with three versions of a kernel and one that has no compact form.
async fn server() -> CommandLine {
    let cli = CommandLine::start_with(|config| config.poll_interval_s = 1.0).await;
    cli.text("display create lab --resolution 96x64 --pixel-pitch 8um --wavelength 515nm").await;
    for version in 1..=3 {
        cli.write("k.safetensors", &kernel_file(96, 64, 0.1 * f64::from(version)));
        let imported = cli.json(&format!("kernel import {KERNEL} @/k.safetensors")).await;
        assert_eq!(imported["version"], version);
    }
    cli.text(&format!("kernel export {KERNEL} --version 1 --format complex64 -o @/k.npy")).await;
    assert_eq!(cli.json(&format!("kernel import {KERNEL} @/k.npy")).await["version"], 4);
    cli
}

/// Starts the agents of all devices. Their self-tests fail for the file `bad.lpk`.
async fn start_devices(cli: &CommandLine) -> Vec<Child> {
    let test = "#!/bin/sh\nif cmp -s \"$1\" \"$(dirname \"$0\")/bad.lpk\"; then echo 'too noisy'; exit 1; fi\necho loss 0.01\n";
    let test = cli.write("self-test", test.as_bytes());
    std::fs::set_permissions(&test, std::fs::Permissions::from_mode(0o755)).unwrap();
    let shown = cli.text("keyring show").await;
    let root = shown.lines().find_map(|line| line.strip_prefix("root ")).unwrap_or_else(|| panic!("{shown}"));
    let start = |n: usize| {
        let directory = cli.path(&format!("device-{n}"));
        std::fs::create_dir(&directory).unwrap();
        let device = format!("bench-{n}");
        let options = [
            ("--server", cli.server.url()),
            ("--display", "lab"),
            ("--device", &device),
            ("--wavelength", "515nm"),
            ("--distance", "50mm"),
            ("--root", root),
            ("--directory", directory.to_str().unwrap()),
            ("--self-test", &test),
        ];
        agent(&options.map(|(name, value)| [name, value]).concat())
    };
    (1..=DEVICES).map(start).collect()
}

/// The version that each device reported last, in the order of their names.
async fn reported(cli: &CommandLine) -> Vec<u64> {
    let list = cli.json("device list lab").await;
    let devices = list["devices"].as_array().cloned().unwrap_or_default();
    devices.iter().map(|device| device["kernels"][0]["version"].as_u64().unwrap_or(0)).collect()
}

/// Waits until the reported versions are as expected.
async fn until(cli: &CommandLine, what: &str, is_right: impl Fn(&[u64]) -> bool) -> Vec<u64> {
    let begin = Instant::now();
    loop {
        let versions = reported(cli).await;
        if is_right(&versions) {
            return versions;
        }
        assert!(begin.elapsed() < PATIENCE, "{what}: {versions:?}");
        sleep(Duration::from_millis(200)).await;
    }
}

async fn until_all_have(cli: &CommandLine, version: u64) {
    let all = |versions: &[u64]| versions.len() == DEVICES && versions.iter().all(|&found| found == version);
    until(cli, &format!("all should have version {version}"), all).await;
    for n in 1..=DEVICES {
        let link = std::fs::read_link(cli.path(&format!("device-{n}/current"))).unwrap();
        assert!(link.to_str() == Some("a") || link.to_str() == Some("b"), "{}", link.display());
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn twenty_devices_follow_promotions_rollouts_and_rollbacks() {
    let cli = server().await;
    cli.text("kernel gate lab --format compact --reason firmware").await;
    let checked = cli.run(&format!("kernel check {KERNEL} --version 4")).await;
    assert!(
        checked.code == Some(1) && checked.stdout.contains("FAILED        it is not available as compact"),
        "{checked:?}"
    );
    let refused = cli.run(&format!("kernel promote {KERNEL} --version 4")).await;
    refused.assert_refused(1, &["FAILED_PRECONDITION", "promotion gate", "compact"]);
    cli.text(&format!("kernel promote {KERNEL} --version 1 --reason first")).await;
    let devices = start_devices(&cli).await;
    until_all_have(&cli, 1).await;

    // Two promotions at once: one wins.
    let promote = |version: u32| format!("kernel promote {KERNEL} --version {version} --expected-active 1");
    let (two, three) = (promote(2), promote(3));
    let (two, three) = tokio::join!(cli.run(&two), cli.run(&three));
    let (won, lost) = if two.code == Some(0) { (two, three) } else { (three, two) };
    won.ok();
    lost.assert_refused(1, &["ABORTED", "is active now"]);
    assert_eq!(cli.json(&format!("kernel rollback {KERNEL} --reason undone")).await["activeVersion"], 1);
    until_all_have(&cli, 1).await;

    a_rollout_reaches_all(&cli).await;
    a_bad_version_halts_its_rollout(&cli).await;
    cli.text(&format!("kernel rollback {KERNEL} --reason back")).await;
    until_all_have(&cli, 1).await;
    let history = cli.text(&format!("kernel history {KERNEL}")).await;
    assert!(history.contains("rollback") && history.contains("staged"), "{history}");
    for mut device in devices {
        device.kill().await.unwrap();
    }
    cli.server.stop().await;
}

/// Brings version 2 to a third of the devices, and then to all.
async fn a_rollout_reaches_all(cli: &CommandLine) {
    cli.text(&format!("rollout start {KERNEL} --version 2 --share 35% --reason staged")).await;
    let some = |versions: &[u64]| versions.contains(&1) && versions.contains(&2);
    until(cli, "some should have version 2", some).await;
    // Nobody else changes.
    sleep(Duration::from_secs(3)).await;
    let first = reported(cli).await.iter().filter(|&&version| version == 2).count();
    assert!((2..=13).contains(&first), "{first} of {DEVICES} devices for a share of 35 %");
    let shown = cli.json(&format!("rollout show {KERNEL}")).await;
    assert_eq!(shown["devicesPassed"].as_u64().unwrap() as usize, first, "{shown}");
    cli.text(&format!("rollout widen {KERNEL} --share 100%")).await;
    until_all_have(cli, 2).await;
    let completed = cli.text(&format!("rollout complete {KERNEL}")).await;
    assert!(completed.contains("completed") && completed.contains("20 passed, 0 failed"), "{completed}");
    assert_eq!(cli.json(&format!("kernel show {KERNEL}")).await["activeVersion"], 2);
}

/// Brings version 3 to half of the devices, whose self-tests fail.
async fn a_bad_version_halts_its_rollout(cli: &CommandLine) {
    cli.text(&format!("kernel export {KERNEL} --version 3 --format compact -o @/bad.lpk")).await;
    cli.text(&format!("rollout start {KERNEL} --version 3 --share 50% --reason worse")).await;
    let begin = Instant::now();
    let halted = loop {
        let shown = cli.text(&format!("rollout show {KERNEL}")).await;
        if shown.contains("halted") {
            break shown;
        }
        assert!(begin.elapsed() < PATIENCE, "{shown}");
        sleep(Duration::from_millis(200)).await;
    };
    assert!(halted.contains("devices failed, the last one bench-"), "{halted}");
    until_all_have(cli, 2).await;
    let list = cli.text("device list lab").await;
    assert!(list.contains("gave up version 3") && list.contains("too noisy"), "{list}");
    assert_eq!(cli.json(&format!("kernel show {KERNEL}")).await["activeVersion"], 2);
}
