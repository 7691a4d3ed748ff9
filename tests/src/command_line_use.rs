use crate::command_line::CommandLine;
use crate::material::target;
use crate::process::{lightpath_command, lightpath_on_terminal};
use serde_json::Value;
use std::process::Stdio;
use tokio::io::{AsyncBufReadExt as _, BufReader};

const OPTICS: &str = "--display toy --distance 50mm";

/// A server with a simulated display, and a folder `targets` with three pictures and a text.
async fn start() -> CommandLine {
    let cli = CommandLine::start().await;
    cli.text("display create toy --resolution 96x64 --pixel-pitch 8um --wavelength 515nm --simulated-seed 3").await;
    std::fs::create_dir(cli.path("targets")).unwrap();
    for (name, number) in [("eye", 0), ("sea", 5), ("sky", 10)] {
        cli.write(&format!("targets/{name}.png"), &target(96, 64, number));
    }
    cli.write("targets/notes.txt", b"no picture");
    cli
}

fn ids(jobs: &Value) -> Vec<String> {
    let jobs = jobs["jobs"].as_array().unwrap();
    jobs.iter().map(|job| job["name"].as_str().unwrap().trim_start_matches("jobs/").to_owned()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn folders_and_several_files_make_jobs_in_one_document() {
    let cli = start().await;
    let optimize = format!("hologram optimize @/targets {OPTICS} --iterations 3 --owner ada");
    let ran = cli.run(&format!("--output json {optimize} -o @/{{name}}.png")).await;
    assert!(ran.stderr.contains("targets: 3 pictures"), "{ran:?}");
    let jobs = ran.json();
    let labels: Vec<&str> = jobs["jobs"].as_array().unwrap().iter().map(|job| job["label"].as_str().unwrap()).collect();
    assert_eq!(labels, ["eye.png", "sea.png", "sky.png"]);
    let lines = cli.text(&format!("--output jsonl {optimize} --wait")).await;
    let each: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(each.len() == 3 && each.iter().all(|job| job["state"] == "STATE_SUCCEEDED"), "{lines}");

    let list = cli.text("job list").await;
    assert_eq!(list.matches(" dB").count(), 6, "{list}");
    assert!(list.contains("eye.png") && list.contains("ada"), "{list}");
    assert_eq!(cli.text("--output jsonl job list --text sea.png").await.lines().count(), 2);

    std::fs::create_dir(cli.path("p")).unwrap();
    for name in ["eye", "sea"] {
        std::fs::rename(cli.path(&format!("{name}.png")), cli.path(&format!("p/{name}.png"))).unwrap();
    }
    let photographed = cli.text(&format!("simulate {OPTICS} --pattern @/p @/sky.png -o @/photos/")).await;
    let names = ["eye", "sea", "sky"].map(|name| cli.path(&format!("photos/{name}.png")));
    assert!(names.iter().all(|path| photographed.contains(path.to_str().unwrap()) && path.is_file()), "{photographed}");
    let bytes = names.map(|path| std::fs::read(path).unwrap());
    assert!(bytes[0] != bytes[1] && bytes[1] != bytes[2]);

    let saved = ids(&jobs);
    cli.text(&format!("hologram save {} {} -o @/again/", saved[0], saved[1])).await;
    assert_eq!(
        std::fs::read(cli.path(&format!("again/{}-pattern.png", saved[0]))).unwrap(),
        std::fs::read(cli.path("p/eye.png")).unwrap()
    );
    let watched = cli.json(&format!("job watch {} {}", saved[0], saved[1])).await;
    assert_eq!(ids(&watched), saved[..2]);
    cli.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn beginnings_of_ids_stand_for_the_only_job_and_several_are_listed() {
    let cli = start().await;
    let jobs = cli.json(&format!("hologram optimize @/targets {OPTICS} --iterations 1 --wait")).await;
    let ids = ids(&jobs);
    let unique = (1..=36)
        .map(|length| &ids[1][..length])
        .find(|&begin| ids.iter().filter(|id| id.starts_with(begin)).count() == 1);
    let unique = unique.unwrap();
    for command in ["job show", "job logs", "job watch", "hologram verify"] {
        assert!(!cli.text(&format!("{command} {unique}")).await.is_empty(), "{command}");
    }
    assert!(cli.text(&format!("job show jobs/{unique}")).await.contains(&ids[1]));
    cli.text(&format!("hologram save {} -o @/p.png", unique.to_uppercase())).await;
    let after = format!("hologram optimize @/targets/eye.png {OPTICS} --after {unique}");
    assert_eq!(cli.json(&after).await["after"][0], format!("jobs/{}", ids[1]));
    let ambiguous = &ids[1][..4];
    let signs = ["the ids of several jobs begin with", &ids[0], &ids[1], &ids[2], "eye.png, succeeded"];
    cli.run(&format!("job cancel {ambiguous}")).await.assert_refused(2, &signs);
    cli.run("job show 9f").await.assert_refused(1, &["NOT_FOUND", "jobs/9f"]);
    cli.run("job show yes").await.assert_refused(1, &["NOT_FOUND", "jobs/yes"]);
    cli.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_single_file_goes_to_standard_output_and_text_to_standard_error() {
    let cli = start().await;
    let eye = cli.path("targets/eye.png");
    let arguments = ["hologram", "optimize", eye.to_str().unwrap(), "--display", "toy", "--distance", "50mm"];
    let arguments = [&arguments[..], &["--iterations", "3", "-o", "-"]].concat();
    let output = lightpath_command(cli.server.url(), &arguments).output().await.unwrap();
    assert!(output.status.success() && output.stdout.starts_with(b"\x89PNG"), "{output:?}");
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert!(stderr.contains("standard output") && stderr.contains("PSNR"), "{stderr}");
    let terminal = lightpath_on_terminal(cli.server.url(), 80, &arguments[..].join(" "));
    assert!(terminal.contains("-o - would write a binary file to the terminal"), "{terminal}");
    let json = [&["--output", "json"], &arguments[..]].concat();
    let refused = lightpath_command(cli.server.url(), &json).output().await.unwrap();
    assert_eq!((refused.status.code(), refused.stdout.len()), (Some(2), 0));
    let two = [&arguments[..], &["--npy", "-"]].concat();
    let refused = lightpath_command(cli.server.url(), &two).output().await.unwrap();
    assert!(String::from_utf8(refused.stderr).unwrap().contains("two files cannot both go to standard output"));
    assert_eq!(cli.json("job list").await["jobs"].as_array().unwrap().len(), 1, "no job is submitted in vain");
    cli.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn interrupted_waits_name_the_commands_that_go_on() {
    let cli = start().await;
    cli.text("queue pause").await;
    let eye = cli.path("targets/eye.png");
    let place = cli.path("p.png");
    let arguments = ["hologram", "optimize", eye.to_str().unwrap(), "--display", "toy", "--distance", "50mm", "-o"];
    let arguments = [&arguments[..], &[place.to_str().unwrap()]].concat();
    let mut command = lightpath_command(cli.server.url(), &arguments);
    let mut child = command.stderr(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    assert!(lines.next_line().await.unwrap().unwrap().contains("queued"));
    let id = child.id().unwrap().to_string();
    assert!(std::process::Command::new("kill").args(["-s", "INT", &id]).status().unwrap().success());
    let mut text = String::new();
    while let Some(line) = lines.next_line().await.unwrap() {
        text += &line;
    }
    assert_eq!(child.wait().await.unwrap().code(), Some(130));
    let job = ids(&cli.json("job list").await).remove(0);
    for command in
        [format!("lightpath job watch {job}"), format!("hologram save {job} -o"), format!("job cancel {job}")]
    {
        assert!(text.contains(&command), "{command} is not in {text}");
    }
    cli.text("queue resume").await;
    cli.text(&format!("hologram save {job} -o @/p.png")).await;
    assert!(place.is_file());
    cli.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn tables_fit_the_terminal_and_are_whole_in_a_pipe() {
    let cli = start().await;
    let jobs = cli.json(&format!("hologram optimize @/targets {OPTICS} --iterations 1 --wait --owner ada")).await;
    for columns in [60, 80, 100] {
        for line in ["job list", "display list", "queue show", "job logs", "job show"] {
            let id =
                if line.starts_with("job l") && line != "job list" || line == "job show" { &ids(&jobs)[0] } else { "" };
            let shown = lightpath_on_terminal(cli.server.url(), columns, &format!("{line} {id}"));
            // Only a digest is longer than a line of 60 characters.
            let long: Vec<&str> = shown.lines().filter(|line| line.chars().count() > columns).collect();
            assert!(long.iter().all(|line| line.contains("sha256-")), "{columns} {line}: {long:#?}");
            assert!(!shown.trim().is_empty(), "{line}");
        }
        let list = lightpath_on_terminal(cli.server.url(), columns, "job list");
        assert!(ids(&jobs).iter().all(|id| list.contains(id)), "{list}");
    }
    let piped = cli.text("job list").await;
    let titles =
        ["JOB", "TARGET", "STATE", "PSNR", "OWNER", "KIND", "ON", "PROGRESS", "ATTEMPT", "CREATED", "AGE", "NEEDS"];
    assert_eq!(piped.lines().next().unwrap().split_whitespace().collect::<Vec<_>>(), titles);
    cli.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_no_process_can_run_is_accepted_with_a_warning() {
    const REASON: &str = "no living process that runs jobs has the labels bench-2, gpu";
    let cli = start().await;
    let optimize = format!("hologram optimize @/targets/eye.png {OPTICS} --iterations 1 --need gpu --need bench-2");
    let ran = cli.run(&format!("--output json {optimize}")).await;
    assert!(ran.stderr.contains(&format!("waits: {REASON}")), "{ran:?}");
    let id = ids(&cli.json("job list").await).remove(0);
    let shown = cli.text(&format!("job show {id}")).await;
    assert!(shown.contains(&format!("queued; {REASON}")) && shown.contains("bench-2, gpu\n"), "{shown}");
    let list = cli.text("job list").await;
    assert!(list.contains("bench-2, gpu") && list.contains(&format!("job {id} waits: {REASON}\n")), "{list}");
    let ran = cli.run(&format!("hologram optimize @/targets/eye.png {OPTICS} --iterations 1 --wait")).await;
    assert!(!ran.stderr.contains("waits: no living process"), "{ran:?}");
    let queue = cli.text("queue show").await;
    assert!(queue.contains("serves and works") && queue.contains(env!("CARGO_PKG_VERSION")), "{queue}");
    cli.run(&format!("hologram optimize @/targets/eye.png {OPTICS} --need GPU"))
        .await
        .assert_refused(1, &["needs has \"GPU\", which is no label"]);
    cli.server.stop().await;
}
