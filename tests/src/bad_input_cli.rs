use crate::material::{declare, png, png_header, target};
use crate::process::lightpath;
use crate::server::TestServer;
use std::path::{Path, PathBuf};

struct Bench {
    server: TestServer,
    folder: tempfile::TempDir,
}

impl Bench {
    async fn start() -> Self {
        let server = TestServer::start().await;
        declare(&server.client, "lab", 64, 48).await;
        Self { server, folder: tempfile::tempdir().unwrap() }
    }

    fn file(&self, name: &str, bytes: &[u8]) -> String {
        let path = self.path(name);
        std::fs::write(&path, bytes).unwrap();
        path.to_str().unwrap().to_owned()
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The command ends with this code and says all of this; the server goes on, and no file appeared.
    async fn refuses(&self, arguments: &[&str], code: i32, signs: &[&str]) {
        let before = names_in(self.folder.path());
        lightpath(self.server.url(), arguments).await.refused(code, signs);
        assert_eq!(names_in(self.folder.path()), before, "{arguments:?} left files");
        self.server.assert_answers().await;
        self.server.assert_tidy();
    }
}

fn names_in(folder: &Path) -> Vec<std::ffi::OsString> {
    let mut names: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    names
}

#[tokio::test(flavor = "multi_thread")]
async fn targets_that_are_no_pictures() {
    let bench = Bench::start().await;
    let whole = target(64, 48, 0);
    let phase = bench.path("phase.png");
    for (name, bytes, signs) in [
        ("cut.png", &whole[..whole.len() / 2], ["PNG", "cut off"]),
        ("zero.png", &[], ["empty", "PNG, JPEG or TIFF"]),
        ("letter.png", b"This is a letter, not a picture.", ["no picture", "PNG, JPEG or TIFF"]),
        ("huge.png", &png_header(60_000, 60_000), ["60000×60000", "at most"]),
        ("dot.png", &png(1, 1, |_, _| 255), ["1×1", "at least"]),
    ] {
        let file = bench.file(name, bytes);
        let arguments = ["hologram", "optimize", &file, "--display", "lab", "--distance", "50mm", "-o"];
        let arguments = [&arguments[..], &[phase.to_str().unwrap()]].concat();
        let signs = [&["INVALID_ARGUMENT", "target", name], &signs[..]].concat();
        bench.refuses(&arguments, 1, &signs).await;
    }
    let absent = ["hologram", "optimize", "/nowhere/a.png", "--display", "lab", "--distance", "50mm"];
    bench.refuses(&absent, 2, &["could not read /nowhere/a.png"]).await;
    bench.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_bad_target_among_good_ones() {
    let bench = Bench::start().await;
    let (eye, zero) = (bench.file("eye.png", &target(64, 48, 0)), bench.file("zero.png", &[]));
    let optimize = |last: &'static str| ["hologram", "optimize", &eye, last, "--display", "lab", "--distance", "50mm"];
    bench.refuses(&optimize("/nowhere/a.png"), 2, &["could not read /nowhere/a.png"]).await;
    let jobs = async || bench.server.client.list_jobs(Default::default()).await.unwrap().jobs;
    assert_eq!(jobs().await, [], "nothing is submitted where a file is missing");

    let arguments = ["hologram", "optimize", &eye, &zero, "--display", "lab", "--distance", "50mm"];
    let refused = lightpath(bench.server.url(), &arguments).await;
    let [job] = &jobs().await[..] else { panic!("the first target has no job") };
    let watch = format!("lightpath job watch {}", job.name.strip_prefix("jobs/").unwrap());
    refused.refused(1, &["zero.png: INVALID_ARGUMENT", "submitted before that", &watch]);
    bench.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn numbers_and_names_that_make_no_sense() {
    let bench = Bench::start().await;
    let file = bench.file("eye.png", &target(64, 48, 0));
    let optimize = |display: &'static str, rest: &[&'static str]| -> Vec<String> {
        let start = ["hologram", "optimize", &file, "--display", display].map(str::to_owned);
        start.into_iter().chain(rest.iter().map(|part| (*part).to_owned())).collect()
    };
    for (display, rest, code, signs) in [
        ("lab", &["--distance", "NaN"][..], 2, ["distance is NaN", "150mm"]),
        ("lab", &["--distance", "150"], 2, ["would be 150 m", "write 150mm"]),
        ("lab", &["--distance", "0mm"], 1, ["INVALID_ARGUMENT", "distance_m is 0"]),
        ("lab", &["--distance", "11m"], 1, ["INVALID_ARGUMENT", "distance_m is 11"]),
        ("lab", &["--distance", "50mm", "--wavelength", "633nm"], 1, ["wavelengths_m[0]", "515nm"]),
        ("lab", &["--distance", "50mm", "--iterations", "20000"], 1, ["iterations is 20000", "10000"]),
        ("lab", &["--distance", "50mm", "--kernel", "7"], 1, ["NOT_FOUND", "kernel"]),
        ("lab", &["--distance", "50mm", "--roi", "60,0,10,10"], 1, ["INVALID_ARGUMENT", "region_of_interest"]),
        ("nowhere", &["--distance", "50mm"], 1, ["NOT_FOUND", "displays/nowhere"]),
    ] {
        let arguments = optimize(display, rest);
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        bench.refuses(&arguments, code, &signs).await;
    }
    for (pitch, sign) in [("0um", "is 0,"), ("-8um", "is -0.000008,")] {
        let create = ["display", "create", "new", "--resolution", "64x48", "--wavelength", "515nm", "--pixel-pitch"];
        let arguments = [&create[..], &[pitch]].concat();
        bench.refuses(&arguments, 1, &["INVALID_ARGUMENT", "display.pixel_pitch_m", sign]).await;
    }
    let fetch = ["kernel", "fetch", "--display", "lab", "--distance", "50mm", "--version", "3", "-o"];
    let out = bench.path("kernel.safetensors");
    let arguments = [&fetch[..], &[out.to_str().unwrap()]].concat();
    bench.refuses(&arguments, 1, &["NOT_FOUND", "515nm-50mm"]).await;
    bench.refuses(&["job", "show", "none"], 1, &["NOT_FOUND", "jobs/none"]).await;
    bench.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn datasets_that_cannot_be_learned_from() {
    let bench = Bench::start().await;
    let phase = bench.file("p.png", &png(64, 48, |x, y| (x * y) as u8));
    let photo = bench.file("c.png", &png(64, 48, |x, y| (x + y) as u8));
    let small = bench.file("small.png", &png(32, 32, |x, y| (x + y) as u8));
    let create = ["dataset", "create", "bench", "--display", "lab", "--distance", "50mm"];
    lightpath(bench.server.url(), &create).await.ok();
    let add = ["dataset", "add", "bench"];
    let with = |pair: &[&str]| -> Vec<String> { add.iter().chain(pair).map(|part| (*part).to_owned()).collect() };
    for (pair, code, signs) in [
        (["--phase", &phase, "--photo", &small].as_slice(), 1, ["INVALID_ARGUMENT", "pair.photo", "32×32"]),
        (&["--phase", &small, "--photo", &photo], 1, ["INVALID_ARGUMENT", "pair.phase", "32×32"]),
        (&["--phase", "/nowhere/p.png", "--photo", &photo], 2, ["could not read", "/nowhere/p.png", ""]),
        (&["--photo", &photo], 2, ["--phase", "", ""]),
    ] {
        let arguments = with(pair);
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        bench.refuses(&arguments, code, &signs).await;
    }
    bench.refuses(&["dataset", "finalize", "bench"], 1, &["FAILED_PRECONDITION", "datasets/bench"]).await;
    let learn = ["kernel", "learn", "--dataset", "bench"];
    bench.refuses(&learn, 1, &["FAILED_PRECONDITION", "datasets/bench"]).await;
    bench.refuses(&["kernel", "learn", "--dataset", "no"], 1, &["NOT_FOUND", "datasets/no"]).await;
    bench.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn outputs_that_cannot_be_written_are_refused_before_any_work() {
    let bench = Bench::start().await;
    let (eye, sky) = (bench.file("eye.png", &target(64, 48, 0)), bench.file("sky.png", &target(64, 48, 1)));
    let rest = ["--display", "lab", "--distance", "50mm", "-o"];
    let optimize = ["hologram", "optimize"];
    let run = |targets: &[&str], out: &str| -> Vec<String> {
        optimize.iter().chain(targets).chain(&rest).chain(&[out]).map(|part| (*part).to_owned()).collect()
    };
    for (targets, out, signs) in [
        (&[eye.as_str(), &sky][..], bench.path("one.png").to_str().unwrap(), ["2 targets", "{name}"]),
        (&[&eye], "/nowhere/at/all.png", ["there is no folder /nowhere/at", ""]),
        (&[&eye], &eye, ["is an input", ""]),
        (&[&eye, &eye], bench.folder.path().to_str().unwrap(), ["written twice", ""]),
    ] {
        let arguments = run(targets, out);
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        bench.refuses(&arguments, 2, &signs).await;
    }
    let jobs = bench.server.client.list_jobs(Default::default()).await.unwrap().jobs;
    assert_eq!(jobs, []);
    bench.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_is_not_there() {
    // A port that was free a moment ago.
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let url = format!("http://127.0.0.1:{port}");
    for arguments in [&["job", "list"][..], &["job", "watch", "x"], &["display", "show", "lab"]] {
        lightpath(&url, arguments).await.refused(3, &["could not be reached", &url, "lightpathd serve"]);
    }
    lightpath("127.0.0.1:7070", &["job", "list"]).await.refused(2, &["write http://127.0.0.1:7070"]);
}
