use crate::material::{png, target};
use crate::process::lightpath;
use crate::server::TestServer;
use std::path::PathBuf;

/// A display with three wavelengths, and pictures in a folder.
struct Bench {
    server: TestServer,
    folder: tempfile::TempDir,
}

impl Bench {
    async fn start() -> Self {
        let bench = Self { server: TestServer::start().await, folder: tempfile::tempdir().unwrap() };
        bench
            .text("display create rgb --resolution 96x64 --pixel-pitch 8um --wavelength 638nm --wavelength 520nm --wavelength 450nm")
            .await;
        for (name, number) in [("near", 1), ("middle", 9), ("far", 17)] {
            std::fs::write(bench.path(&format!("{name}.png")), target(96, 64, number)).unwrap();
        }
        let slope = png(96, 64, |x, _| (255 * x / 95) as u8);
        std::fs::write(bench.path("depth.png"), slope).unwrap();
        bench
    }

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

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn picture(&self, name: &str) -> image::DynamicImage {
        image::open(self.path(name)).unwrap()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn three_wavelengths_show_three_planes_in_colour() {
    let bench = Bench::start().await;
    let text = bench
        .text(
            "hologram optimize --display rgb --wavelength 638nm,520nm,450nm --iterations 15 \
             --plane 8mm=@/near.png --plane 12mm=@/middle.png:2 --plane 16mm=@/far.png -o @/phase.png \
             --reconstruction @/seen.png",
        )
        .await;
    for sign in ["638 nm", "520 nm", "450 nm", "8 mm", "12 mm", "16 mm", "phase-638nm.png", "seen-16mm.png"] {
        assert!(text.contains(sign), "{sign} is not in {text}");
    }
    for name in ["phase-638nm.png", "phase-520nm.png", "phase-450nm.png"] {
        assert_eq!(bench.picture(name).color(), image::ColorType::L8, "{name}");
    }
    for name in ["seen-8mm.png", "seen-12mm.png", "seen-16mm.png"] {
        let seen = bench.picture(name);
        assert_eq!((seen.width(), seen.height(), seen.color()), (96, 64, image::ColorType::Rgb8), "{name}");
    }
    let listed = bench.text("--output json job list").await;
    let jobs: serde_json::Value = serde_json::from_str(&listed).unwrap();
    let spec = &jobs["jobs"][0]["spec"]["optimizeHologram"];
    assert_eq!(spec["planes"].as_array().unwrap().len(), 3, "{spec}");
    assert_eq!(spec["planes"][1]["weight"], 2.0);
    assert_eq!(spec["wavelengthsM"].as_array().unwrap().len(), 3);
    assert_eq!(jobs["jobs"][0]["kernelVersions"], serde_json::json!([0, 0, 0, 0, 0, 0, 0, 0, 0]));
    bench.server.assert_tidy();
    bench.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_depth_map_cuts_a_picture_into_planes_and_frames_take_turns() {
    let bench = Bench::start().await;
    let text = bench
        .text(
            "hologram optimize @/near.png --display rgb --wavelength 520nm --distance 8mm,16mm --depth-map @/depth.png \
             --frames 2 --iterations 15 -o @/out/ --reconstruction @/out/",
        )
        .await;
    assert!(text.contains("8 mm") && text.contains("16 mm"), "{text}");
    for name in ["near-phase-frame1.png", "near-phase-frame2.png", "near-reconstruction-8mm.png"] {
        assert_eq!(bench.picture(&format!("out/{name}")).width(), 96, "{name}");
    }
    bench.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_method_and_start_runs_and_goes_on_from_another() {
    let bench = Bench::start().await;
    let optimize = "hologram optimize @/near.png --display rgb --wavelength 520nm --distance 8mm --iterations 12";
    for (i, options) in [
        "--method adam --learning-rate 0.2 --loss amplitude --quantization-aware",
        "--method gs --initial-phase back-propagated",
        "--method wgs --initial-phase quadratic:20mm",
        "--method dpac --initial-phase constant:1",
        "--total-variation 0.001 --speckle 0.01 --speckle-block 6 --weight-mask @/depth.png --detector supersampled",
    ]
    .into_iter()
    .enumerate()
    {
        bench.text(&format!("{optimize} {options} --npy @/{i}.npy")).await;
        let goes_on = format!("{optimize} --initial-phase @/{i}.npy --npy @/{i}-on.npy");
        bench.text(&goes_on).await;
        let read = |name: String| std::fs::read(bench.path(&name)).unwrap();
        assert!(read(format!("{i}-on.npy")) != read(format!("{i}.npy")), "{options}");
    }
    bench.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_does_not_go_together_is_refused() {
    let bench = Bench::start().await;
    let optimize = "hologram optimize @/near.png --display rgb --wavelength 520nm";
    for (options, code, signs) in [
        ("--distance 8mm,16mm", 2, &["--depth-map", "--plane"][..]),
        ("--distance 8mm --depth-map @/depth.png", 2, &["two distances"]),
        ("--distance 8mm --plane 8mm=@/far.png", 2, &["--plane"]),
        ("--distance 8mm --initial-phase lens", 2, &["quadratic"]),
        ("--distance 8mm --learning-rate 0.1", 1, &["learning_rate", "adam"]),
        ("--distance 8mm --method gs --speckle 0.1", 1, &["loss", "lbfgs"]),
        ("--distance 8mm --method dpac --quantization-aware", 1, &["quantization_aware", "lbfgs"]),
        ("--distance 8mm --method dpac --initial-phase back-propagated", 1, &["initial_phase is back-propagated"]),
        ("--distance 8mm --frames 25", 1, &["frames is 25", "1 to 24"]),
        ("--distance 8mm --speckle 0.1 --speckle-block 100", 1, &["speckle_block_px is 100", "region of interest"]),
        ("--distance 8mm,8mm --depth-map @/depth.png", 1, &["planes[1]", "again"]),
        ("--distance 8mm,16mm --depth-map @/depth.png --kernel 3", 1, &["kernel", "active or ideal"]),
    ] {
        bench.run(&format!("{optimize} {options}")).await.refused(code, signs);
    }
    let colours = "hologram optimize @/near.png --display rgb --distance 8mm --wavelength";
    bench.run(&format!("{colours} 520nm,520nm")).await.refused(1, &["wavelengths_m[1]", "again"]);
    bench.run(&format!("{colours} 520nm,633nm")).await.refused(1, &["wavelengths_m[1]", "638nm"]);
    std::fs::write(bench.path("short.npy"), b"\x93NUMPY").unwrap();
    let short = "--distance 8mm --initial-phase @/short.npy";
    bench.run(&format!("{optimize} {short}")).await.refused(1, &["initial_phase.given.phases[0]", "float32"]);
    bench.server.assert_tidy();
    bench.server.stop().await;
}
