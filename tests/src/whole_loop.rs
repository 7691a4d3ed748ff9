use crate::material::target;
use crate::process::lightpath;
use crate::server::TestServer;
use serde_json::Value;
use std::path::Path;

/// Pairs photographed, of which a fifth is held out.
const PAIRS: u32 = 6;

/// Commands against one server, in one folder.
struct Bench {
    server: TestServer,
    folder: tempfile::TempDir,
}

impl Bench {
    /// A line of arguments, with `@` for the folder.
    async fn run(&self, line: &str) -> crate::process::Ran {
        let folder = self.folder.path().to_str().unwrap();
        let arguments: Vec<String> = line.split_whitespace().map(|part| part.replace('@', folder)).collect();
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        lightpath(self.server.url(), &arguments).await
    }

    async fn text(&self, line: &str) -> String {
        self.run(line).await.ok()
    }

    async fn json(&self, line: &str) -> Value {
        self.run(&format!("--output json {line}")).await.json()
    }

    fn path(&self, name: &str) -> std::path::PathBuf {
        self.folder.path().join(name)
    }
}

fn size_of(path: &Path) -> (u32, u32) {
    image::image_dimensions(path).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn from_a_display_to_better_holograms() {
    let bench = Bench { server: TestServer::start().await, folder: tempfile::tempdir().unwrap() };
    for number in 0..PAIRS {
        std::fs::write(bench.path(&format!("t{number}.png")), target(96, 64, number * 5)).unwrap();
    }
    holograms(&bench).await;
    learning(&bench).await;
    versions(&bench).await;
    bench.server.assert_tidy();
    bench.server.stop().await;
}

/// Display, targets, holograms with their files.
async fn holograms(bench: &Bench) {
    let made = bench
        .text("display create toy --resolution 96x64 --pixel-pitch 8um --wavelength 515nm --simulated-seed 3")
        .await;
    assert!(made.contains("96x64 px") && made.contains("8 µm") && made.contains("515 nm"), "{made}");
    assert!(bench.text("display list").await.contains("toy"));
    assert_eq!(bench.json("display show toy").await["name"], "displays/toy");
    let plan = bench.text("display plan toy --distance 50mm").await;
    for sign in ["rayleigh-sommerfeld: 50 mm is beyond", "warning", "BAND_LIMITED", "15.91 mm along y", "band-extended"]
    {
        assert!(plan.contains(sign), "{sign} is not in {plan}");
    }

    let one = bench
        .text("hologram optimize @/t0.png --display toy --distance 50mm --iterations 30 -o @/one.png --npy @/one.npy --reconstruction @/seen.png")
        .await;
    for sign in ["ideal", "point", "pixel", "supersampled", " dB", "ms an iteration", "one.png", "BAND_LIMITED"] {
        assert!(one.contains(sign), "{sign} is not in {one}");
    }
    assert_eq!((size_of(&bench.path("one.png")), size_of(&bench.path("seen.png"))), ((96, 64), (96, 64)));
    assert!(std::fs::read(bench.path("one.npy")).unwrap().starts_with(b"\x93NUMPY"));

    let targets: Vec<String> = (0..PAIRS).map(|number| format!("@/t{number}.png")).collect();
    let line = format!(
        "hologram optimize {} --display toy --distance 50mm --iterations 20 --phase-range 3 -o @/p/",
        targets.join(" ")
    );
    let many = bench.text(&line).await;
    for number in 0..PAIRS {
        assert!(many.contains(&format!("t{number}")), "{many}");
        assert_eq!(size_of(&bench.path(&format!("p/t{number}-phase.png"))), (96, 64));
    }
    let jobs = bench.json("job list").await;
    assert_eq!(jobs["jobs"].as_array().unwrap().len() as u32, PAIRS + 1);
    let id = jobs["jobs"][0]["name"].as_str().unwrap().trim_start_matches("jobs/").to_owned();
    assert!(bench.text(&format!("job show {id}")).await.contains("succeeded"));
    assert!(bench.text(&format!("job watch {id}")).await.contains("succeeded"));
    assert!(bench.text(&format!("job logs {id}")).await.contains("succeeded"));
    bench.text(&format!("hologram save {id} -o @/again.png")).await;
    bench.run(&format!("job cancel {id}")).await.refused(1, &["FAILED_PRECONDITION"]);
}

/// Photographs, a dataset, a kernel.
async fn learning(bench: &Bench) {
    bench.text("dataset create bench --display toy --distance 50mm").await;
    for number in 0..PAIRS {
        let (phase, photo) = (format!("@/p/t{number}-phase.png"), format!("@/c{number}.png"));
        bench.text(&format!("simulate --display toy --distance 50mm --phase {phase} -o {photo}")).await;
        bench.text(&format!("dataset add bench --phase {phase} --photo {photo} --id p{number}")).await;
    }
    let finalized = bench.json("dataset finalize bench --seed 1").await;
    assert_eq!(finalized["state"], "STATE_FINALIZED");
    assert_eq!(finalized["pairs"].as_array().unwrap().len() as u32, PAIRS);
    assert!(bench.text("dataset show bench").await.contains("finalized"));
    assert!(bench.text("dataset list").await.contains("bench"));

    let job = bench.json("kernel learn --dataset bench --epochs 4 --refinement-evaluations 20 --wait").await;
    let learned = &job["result"]["learn"]["kernels"][0];
    assert_eq!(learned["kernelVersion"], "displays/toy/kernels/515nm-50mm/versions/1");
    let metrics = &learned["metrics"];
    let (learned, ideal) = (metrics["testLoss"].as_f64().unwrap(), metrics["idealTestLoss"].as_f64().unwrap());
    assert!(learned < 0.5 * ideal, "held-out loss {learned} is not well below the ideal kernel's {ideal}");
    let evaluated = bench.text("kernel evaluate --dataset bench --kernel 1 --wait").await;
    assert!(evaluated.contains("PAIR") && evaluated.contains("p0"), "{evaluated}");
}

/// Promote, use, fetch, import, roll back.
async fn versions(bench: &Bench) {
    let kernel = "--display toy --distance 50mm";
    bench.run(&format!("kernel fetch {kernel} -o @/k.safetensors")).await.refused(1, &["FAILED_PRECONDITION"]);
    let active = bench.json(&format!("kernel promote {kernel} --version 1 --reason first --expected-active 0")).await;
    assert_eq!(active["activeVersion"], 1);
    let used = bench.text(&format!("hologram optimize @/t1.png {kernel} --iterations 20 --wait")).await;
    assert!(used.contains("version 1"), "{used}");

    bench.text(&format!("kernel fetch {kernel} -o @/k.safetensors")).await;
    bench.text(&format!("kernel export {kernel} --version 1 -o @/e.safetensors")).await;
    let bytes = std::fs::read(bench.path("k.safetensors")).unwrap();
    assert_eq!(bytes, std::fs::read(bench.path("e.safetensors")).unwrap());
    let imported = bench.json(&format!("kernel import {kernel} @/k.safetensors")).await;
    assert_eq!(imported["version"], 2);

    bench.text(&format!("kernel promote {kernel} --version 2")).await;
    let stale = format!("kernel promote {kernel} --version 1 --expected-active 1");
    bench.run(&stale).await.refused(1, &["ABORTED"]);
    bench.run(&format!("kernel promote {kernel} --version 9")).await.refused(1, &["NOT_FOUND", "9"]);
    assert_eq!(bench.json(&format!("kernel rollback {kernel} --reason worse")).await["activeVersion"], 1);
    let history = bench.text(&format!("kernel history {kernel}")).await;
    assert!(history.contains("rollback") && history.contains("first") && history.contains("worse"), "{history}");
    let shown = bench.text("kernel show displays/toy/kernels/515nm-50mm").await;
    assert!(shown.contains("version 1") && shown.contains("(imported)"), "{shown}");
    assert!(bench.text(&format!("kernel show {kernel} --version 1")).await.contains("held-out loss"));
    assert!(bench.text("kernel list --distance 50mm").await.contains("515nm-50mm"));
    assert_eq!(
        bench.text("kernel list --distance 51mm").await.trim(),
        "no kernels; learn one: lightpath kernel learn --help"
    );
    assert_eq!(bench.json(&format!("kernel versions {kernel}")).await["versions"].as_array().unwrap().len(), 2);
    bench.run("display delete toy").await.refused(1, &["FAILED_PRECONDITION"]);
}
