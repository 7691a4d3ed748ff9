use crate::command_line::CommandLine;
use crate::material::target;
use std::path::Path;

/// Number of pairs. A fifth of them is the test set.
const PAIRS: u32 = 6;

/// Width and height of a picture \[px\].
fn size_of(path: &Path) -> (u32, u32) {
    image::image_dimensions(path).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn command_line_covers_display_holograms_learning_and_versions() {
    let cli = CommandLine::start().await;
    for number in 0..PAIRS {
        cli.write(&format!("t{number}.png"), &target(96, 64, number * 5));
    }
    holograms(&cli).await;
    learning(&cli).await;
    versions(&cli).await;
    cli.server.assert_tidy();
    cli.server.stop().await;
}

/// Declares a display and optimizes holograms, with output files.
async fn holograms(cli: &CommandLine) {
    let created =
        cli.text("display create toy --resolution 96x64 --pixel-pitch 8um --wavelength 515nm --simulated-seed 3").await;
    assert!(created.contains("96x64 px") && created.contains("8 µm") && created.contains("515 nm"), "{created}");
    assert!(cli.text("display list").await.contains("toy"));
    assert_eq!(cli.json("display show toy").await["name"], "displays/toy");
    let plan = cli.text("display plan toy --distance 50mm").await;
    for sign in ["band-response: at 50 mm", "warning", "BAND_LIMITED", "15.91 mm along y", "band-extended"] {
        assert!(plan.contains(sign), "{sign} is not in {plan}");
    }

    let one = cli
        .text("hologram optimize @/t0.png --display toy --distance 50mm --iterations 30 -o @/one.png --npy @/one.npy --reconstruction @/seen.png")
        .await;
    for sign in ["ideal", "point", "pixel", "supersampled", " dB", "ms per iteration", "one.png", "BAND_LIMITED"] {
        assert!(one.contains(sign), "{sign} is not in {one}");
    }
    assert_eq!((size_of(&cli.path("one.png")), size_of(&cli.path("seen.png"))), ((96, 64), (96, 64)));
    assert!(std::fs::read(cli.path("one.npy")).unwrap().starts_with(b"\x93NUMPY"));

    let targets: Vec<String> = (0..PAIRS).map(|number| format!("@/t{number}.png")).collect();
    let line = format!(
        "hologram optimize {} --display toy --distance 50mm --iterations 20 --phase-range 3 -o @/p/",
        targets.join(" ")
    );
    let many = cli.text(&line).await;
    for number in 0..PAIRS {
        assert!(many.contains(&format!("t{number}")), "{many}");
        assert_eq!(size_of(&cli.path(&format!("p/t{number}-pattern.png"))), (96, 64));
    }
    let jobs = cli.json("job list").await;
    assert_eq!(jobs["jobs"].as_array().unwrap().len() as u32, PAIRS + 1);
    let id = jobs["jobs"][0]["name"].as_str().unwrap().trim_start_matches("jobs/").to_owned();
    assert!(cli.text(&format!("job show {id}")).await.contains("succeeded"));
    assert!(cli.text(&format!("job watch {id}")).await.contains("succeeded"));
    assert!(cli.text(&format!("job logs {id}")).await.contains("succeeded"));
    cli.text(&format!("hologram save {id} -o @/again.png")).await;
    let verified = cli.text(&format!("hologram verify {id}")).await;
    assert_eq!(verified.matches("agrees").count(), 3, "{verified}");
    cli.run(&format!("job cancel {id}")).await.assert_refused(1, &["FAILED_PRECONDITION"]);
}

/// Photographs the holograms, collects them in a dataset and learns a kernel.
async fn learning(cli: &CommandLine) {
    cli.text("dataset create bench --display toy --distance 50mm").await;
    for number in 0..PAIRS {
        let (phase, photo) = (format!("@/p/t{number}-pattern.png"), format!("@/c{number}.png"));
        cli.text(&format!("simulate --display toy --distance 50mm --pattern {phase} -o {photo}")).await;
        cli.text(&format!("dataset add bench --pattern {phase} --photo {photo} --id p{number}")).await;
    }
    let finalized = cli.json("dataset finalize bench --seed 1").await;
    assert_eq!(finalized["state"], "STATE_FINALIZED");
    assert_eq!(finalized["pairs"].as_array().unwrap().len() as u32, PAIRS);
    assert!(cli.text("dataset show bench").await.contains("finalized"));
    assert!(cli.text("dataset list").await.contains("bench"));

    let job = cli.json("kernel learn --dataset bench --epochs 4 --refinement-evaluations 20 --wait").await;
    let learned = &job["result"]["learnKernel"]["kernels"][0];
    assert_eq!(learned["kernelVersion"], "displays/toy/kernels/515nm-50mm/versions/1");
    let metrics = &learned["metrics"];
    let (learned, ideal) = (metrics["testLoss"].as_f64().unwrap(), metrics["idealTestLoss"].as_f64().unwrap());
    assert!(learned < 0.5 * ideal, "held-out loss {learned} is not well below the ideal kernel's {ideal}");
    let evaluated = cli.text("kernel evaluate --dataset bench --kernel 1 --wait").await;
    assert!(evaluated.contains("PAIR") && evaluated.contains("p0"), "{evaluated}");
}

/// Promotes, uses, fetches, exports, imports and rolls back kernel versions.
async fn versions(cli: &CommandLine) {
    let kernel = "--display toy --distance 50mm";
    cli.run(&format!("kernel fetch {kernel} -o @/k.safetensors")).await.assert_refused(1, &["FAILED_PRECONDITION"]);
    let active = cli.json(&format!("kernel promote {kernel} --version 1 --reason first --expected-active 0")).await;
    assert_eq!(active["activeVersion"], 1);
    let used = cli.text(&format!("hologram optimize @/t1.png {kernel} --iterations 20 --wait")).await;
    assert!(used.contains("version 1") && used.contains("dB expected, by the kernel of the hologram"), "{used}");

    cli.text(&format!("kernel fetch {kernel} -o @/k.safetensors")).await;
    cli.text(&format!("kernel export {kernel} --version 1 -o @/e.safetensors")).await;
    let bytes = std::fs::read(cli.path("k.safetensors")).unwrap();
    assert_eq!(bytes, std::fs::read(cli.path("e.safetensors")).unwrap());
    let imported = cli.json(&format!("kernel import {kernel} @/k.safetensors")).await;
    assert_eq!(imported["version"], 2);

    cli.text(&format!("kernel promote {kernel} --version 2")).await;
    let stale = format!("kernel promote {kernel} --version 1 --expected-active 1");
    cli.run(&stale).await.assert_refused(1, &["ABORTED"]);
    cli.run(&format!("kernel promote {kernel} --version 9")).await.assert_refused(1, &["NOT_FOUND", "9"]);
    assert_eq!(cli.json(&format!("kernel rollback {kernel} --reason worse")).await["activeVersion"], 1);
    let history = cli.text(&format!("kernel history {kernel}")).await;
    assert!(history.contains("rollback") && history.contains("first") && history.contains("worse"), "{history}");
    let shown = cli.text("kernel show displays/toy/kernels/515nm-50mm").await;
    assert!(shown.contains("version 1") && shown.contains("(imported)"), "{shown}");
    assert!(cli.text(&format!("kernel show {kernel} --version 1")).await.contains("held-out loss"));
    assert!(cli.text("kernel list --distance 50mm").await.contains("515nm-50mm"));
    assert_eq!(
        cli.text("kernel list --distance 51mm").await.trim(),
        "no kernels; learn one: lightpath kernel learn --help"
    );
    assert_eq!(cli.json(&format!("kernel versions {kernel}")).await["versions"].as_array().unwrap().len(), 2);
    cli.run("display delete toy").await.assert_refused(1, &["FAILED_PRECONDITION"]);
}
