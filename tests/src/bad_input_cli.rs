use crate::command_line::CommandLine;
use crate::material::{declare, png, png_header, target};
use crate::process::lightpath;

/// A server with the display `lab`.
async fn start() -> CommandLine {
    let cli = CommandLine::start().await;
    declare(&cli.server.client, "lab", 64, 48).await;
    cli
}

/// Runs a command that must end with this code and print all of `signs`, leave no file, and leave the server in order.
async fn assert_refused(cli: &CommandLine, arguments: &[&str], code: i32, signs: &[&str]) {
    let before = cli.file_names();
    lightpath(cli.server.url(), arguments).await.assert_refused(code, signs);
    assert_eq!(cli.file_names(), before, "{arguments:?} left files");
    cli.server.assert_answers().await;
    cli.server.assert_tidy();
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_targets_are_refused() {
    let cli = start().await;
    let whole = target(64, 48, 0);
    let phase = cli.path("pattern.png");
    for (name, bytes, signs) in [
        ("cut.png", &whole[..whole.len() / 2], ["PNG", "cut off"]),
        ("zero.png", &[], ["empty", "PNG, JPEG, TIFF, BMP or .npy"]),
        ("letter.png", b"This is a letter, not a picture.", ["not a readable picture", "PNG, JPEG, TIFF, BMP or .npy"]),
        ("huge.png", &png_header(60_000, 60_000), ["60000×60000", "at most"]),
        ("dot.png", &png(1, 1, |_, _| 255), ["1×1", "at least"]),
    ] {
        let file = cli.write(name, bytes);
        let arguments = ["hologram", "optimize", &file, "--display", "lab", "--distance", "50mm", "-o"];
        let arguments = [&arguments[..], &[phase.to_str().unwrap()]].concat();
        let signs = [&["INVALID_ARGUMENT", "target", name], &signs[..]].concat();
        assert_refused(&cli, &arguments, 1, &signs).await;
    }
    let absent = ["hologram", "optimize", "/nowhere/a.png", "--display", "lab", "--distance", "50mm"];
    assert_refused(&cli, &absent, 2, &["could not read /nowhere/a.png"]).await;
    cli.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn error_for_one_target_names_jobs_of_earlier_targets() {
    let cli = start().await;
    let (eye, zero) = (cli.write("eye.png", &target(64, 48, 0)), cli.write("zero.png", &[]));
    let optimize = |last: &'static str| ["hologram", "optimize", &eye, last, "--display", "lab", "--distance", "50mm"];
    assert_refused(&cli, &optimize("/nowhere/a.png"), 2, &["could not read /nowhere/a.png"]).await;
    let jobs = async || cli.server.client.list_jobs(Default::default()).await.unwrap().jobs;
    assert_eq!(jobs().await, [], "no job is submitted if a file is missing");

    let arguments = ["hologram", "optimize", &eye, &zero, "--display", "lab", "--distance", "50mm"];
    let refused = lightpath(cli.server.url(), &arguments).await;
    let [job] = &jobs().await[..] else { panic!("the first target has no job") };
    let watch = format!("lightpath job watch {}", job.name.strip_prefix("jobs/").unwrap());
    refused.assert_refused(1, &["zero.png: INVALID_ARGUMENT", "submitted before that", &watch]);
    let (levels, colours) = (cli.write("p1.png", &png(64, 48, |x, y| (x * y) as u8)), cli.write("p2.png", b"no PNG"));
    let photo = cli.path("photos/");
    let simulate = ["simulate", "--display", "lab", "--distance", "50mm", "--pattern", &levels, &colours, "-o"];
    let refused = lightpath(cli.server.url(), &[&simulate[..], &[photo.to_str().unwrap()]].concat()).await;
    refused.assert_refused(1, &["p2.png: INVALID_ARGUMENT", "submitted before that", "lightpath job watch"]);
    cli.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_numbers_and_unknown_names_are_refused() {
    let cli = start().await;
    let file = cli.write("eye.png", &target(64, 48, 0));
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
        ("lab", &["--distance", "50mm", "--kernel", "7"], 1, ["display lab has no kernel at 50 mm", "learn one"]),
        ("lab", &["--distance", "50mm", "--region", "60,0,10,10"], 1, ["INVALID_ARGUMENT", "region"]),
        ("nowhere", &["--distance", "50mm"], 1, ["NOT_FOUND", "displays/nowhere"]),
        ("lba", &["--distance", "50mm"], 1, ["displays/lba does not exist", "did you mean lab?"]),
    ] {
        let arguments = optimize(display, rest);
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        assert_refused(&cli, &arguments, code, &signs).await;
    }
    for (pitch, sign) in [("0um", "is 0,"), ("-8um", "is -0.000008,")] {
        let create = ["display", "create", "new", "--resolution", "64x48", "--wavelength", "515nm", "--pixel-pitch"];
        let arguments = [&create[..], &[pitch]].concat();
        assert_refused(&cli, &arguments, 1, &["INVALID_ARGUMENT", "display.modulator.pixel_pitch_x_m", sign]).await;
    }
    let all = optimize("lab", &["--distance", "0mm", "--iterations", "20000", "--subframes", "99", "--batch", "a\tb"]);
    let all: Vec<&str> = all.iter().map(String::as_str).collect();
    let signs = [
        "4 fields of the request are wrong",
        "batch has the control character",
        "planes[0].place.distance_m is 0",
        "iterations is 20000",
    ];
    assert_refused(&cli, &all, 1, &[&signs[..], &["subframes is 99, but must be 1 to 24"]].concat()).await;
    let create = ["dataset", "create", "B", "--display", "nowhere", "--distance", "11m", "--photo-bit-depth", "40"];
    let signs = [
        "4 fields",
        "dataset.name is",
        "names displays/nowhere, which does not exist",
        "dataset.place.distance_m is 11",
    ];
    assert_refused(&cli, &create, 1, &[&signs[..], &["dataset.photo_bit_depth is 40"]].concat()).await;
    let fetch = ["kernel", "fetch", "--display", "lab", "--distance", "50mm", "--version", "3", "-o"];
    let out = cli.path("kernel.safetensors");
    let arguments = [&fetch[..], &[out.to_str().unwrap()]].concat();
    assert_refused(&cli, &arguments, 1, &["display lab has no kernel at 50 mm", "lightpath kernel list"]).await;
    assert_refused(&cli, &["job", "show", "none"], 1, &["NOT_FOUND", "jobs/none"]).await;
    cli.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn invalid_pairs_and_datasets_are_refused() {
    let cli = start().await;
    let phase = cli.write("p.png", &png(64, 48, |x, y| (x * y) as u8));
    let photo = cli.write("c.png", &png(64, 48, |x, y| (x + y) as u8));
    let small = cli.write("small.png", &png(32, 32, |x, y| (x + y) as u8));
    let create = ["dataset", "create", "bench", "--display", "lab", "--distance", "50mm"];
    lightpath(cli.server.url(), &create).await.ok();
    let add = ["dataset", "add", "bench"];
    let with = |pair: &[&str]| -> Vec<String> { add.iter().chain(pair).map(|part| (*part).to_owned()).collect() };
    for (pair, code, signs) in [
        (["--pattern", &phase, "--photo", &small].as_slice(), 1, ["INVALID_ARGUMENT", "pairs[0].photo", "32×32"]),
        (&["--pattern", &small, "--photo", &photo], 1, ["INVALID_ARGUMENT", "pairs[0].pattern", "32×32"]),
        (&["--pattern", "/nowhere/p.png", "--photo", &photo], 2, ["could not read", "/nowhere/p.png", ""]),
        (&["--photo", &photo], 2, ["--pattern", "", ""]),
    ] {
        let arguments = with(pair);
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        assert_refused(&cli, &arguments, code, &signs).await;
    }
    assert_refused(&cli, &["dataset", "finalize", "bench"], 1, &["FAILED_PRECONDITION", "datasets/bench"]).await;
    let learn = ["kernel", "learn", "--dataset", "bench"];
    assert_refused(&cli, &learn, 1, &["FAILED_PRECONDITION", "datasets/bench"]).await;
    assert_refused(&cli, &["kernel", "learn", "--dataset", "no"], 1, &["NOT_FOUND", "datasets/no"]).await;
    let wrong = ["--epochs", "5000", "--learning-rate", "50", "--detector", "supersampled"];
    let fields = ["epochs is 5000", "learning_rate is 50", "detector is supersampled"];
    let signs = [&["4 fields", "datasets[0] names datasets/no, which does not exist"][..], &fields].concat();
    assert_refused(&cli, &[&["kernel", "learn", "--dataset", "no"][..], &wrong].concat(), 1, &signs).await;
    let signs = [&["3 fields"][..], &fields].concat();
    assert_refused(&cli, &[&["kernel", "learn", "--dataset", "bench"][..], &wrong].concat(), 1, &signs).await;
    cli.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn outputs_that_cannot_be_written_are_refused_before_any_job() {
    let cli = start().await;
    let (eye, sky) = (cli.write("eye.png", &target(64, 48, 0)), cli.write("sky.png", &target(64, 48, 1)));
    std::fs::create_dir_all(cli.path("folder.png/eye-pattern.png")).unwrap();
    let rest = ["--display", "lab", "--distance", "50mm", "-o"];
    let optimize = ["hologram", "optimize"];
    let run = |targets: &[&str], out: &str| -> Vec<String> {
        optimize.iter().chain(targets).chain(&rest).chain(&[out]).map(|part| (*part).to_owned()).collect()
    };
    for (targets, out, signs) in [
        (&[eye.as_str(), &sky][..], cli.path("one.png").to_str().unwrap(), ["2 targets", "{name}"]),
        (&[&eye], "/nowhere/at/all.png", ["there is no folder /nowhere/at", ""]),
        (&[&eye], &eye, ["is an input", ""]),
        (&[&eye], "/proc/p.png", ["no file can be written in the folder /proc", ""]),
        (&[&eye], cli.path("folder.png").to_str().unwrap(), ["folder.png/eye-pattern.png is a folder", "name a file"]),
        (&[&eye], cli.path("{job}.png").to_str().unwrap(), ["{job} is not known", "{name}"]),
        (&[&eye], cli.path("p.jpg").to_str().unwrap(), [".jpg, which is not known", ".png (grey levels"]),
        (&[&eye, &sky], "-", ["standard output, which takes one file", ""]),
        (&[&eye, &eye], cli.path("").to_str().unwrap(), ["written twice", ""]),
    ] {
        let arguments = run(targets, out);
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        assert_refused(&cli, &arguments, 2, &signs).await;
    }
    let jobs = cli.server.client.list_jobs(Default::default()).await.unwrap().jobs;
    assert_eq!(jobs, []);
    cli.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn unreachable_server_gives_exit_code_3_and_a_hint() {
    // A port that was free a moment ago.
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let url = format!("http://127.0.0.1:{port}");
    for arguments in [&["job", "list"][..], &["job", "watch", "x"], &["display", "show", "lab"]] {
        lightpath(&url, arguments).await.assert_refused(3, &["could not be reached", &url, "lightpathd serve"]);
    }
    lightpath("127.0.0.1:7070", &["job", "list"]).await.assert_refused(2, &["write http://127.0.0.1:7070"]);
}
