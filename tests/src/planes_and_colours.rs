use crate::command_line::CommandLine;
use crate::material::{png, target};

/// A server with the display `rgb` of three wavelengths, and pictures in its folder.
async fn start() -> CommandLine {
    let cli = CommandLine::start().await;
    let create = "display create rgb --resolution 96x64 --pixel-pitch 8um";
    cli.text(&format!("{create} --wavelength 638nm --wavelength 520nm --wavelength 450nm")).await;
    for (name, number) in [("near.png", 1), ("middle.png", 9), ("far.png", 17)] {
        cli.write(name, &target(96, 64, number));
    }
    cli.write("depth.png", &png(96, 64, |x, _| (255 * x / 95) as u8));
    cli
}

fn picture(cli: &CommandLine, name: &str) -> image::DynamicImage {
    image::open(cli.path(name)).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn three_wavelengths_show_three_planes_in_colour() {
    let cli = start().await;
    let text = cli
        .text(
            "hologram optimize --display rgb --wavelength 638nm,520nm,450nm --iterations 15 \
             --plane 8mm=@/near.png --plane 12mm=@/middle.png:2 --plane 16mm=@/far.png -o @/pattern.png \
             --reconstruction @/seen.png",
        )
        .await;
    for sign in ["638 nm", "520 nm", "450 nm", "8 mm", "12 mm", "16 mm", "pattern-638nm.png", "seen-16mm.png"] {
        assert!(text.contains(sign), "{sign} is not in {text}");
    }
    for name in ["pattern-638nm.png", "pattern-520nm.png", "pattern-450nm.png"] {
        assert_eq!(picture(&cli, name).color(), image::ColorType::L8, "{name}");
    }
    for name in ["seen-8mm.png", "seen-12mm.png", "seen-16mm.png"] {
        let seen = picture(&cli, name);
        assert_eq!((seen.width(), seen.height(), seen.color()), (96, 64, image::ColorType::Rgb8), "{name}");
    }
    let listed = cli.text("--output json job list").await;
    let jobs: serde_json::Value = serde_json::from_str(&listed).unwrap();
    let spec = &jobs["jobs"][0]["spec"]["optimizeHologram"];
    assert_eq!(spec["planes"].as_array().unwrap().len(), 3, "{spec}");
    assert_eq!(spec["planes"][1]["weight"], 2.0);
    assert_eq!(spec["wavelengthsM"].as_array().unwrap().len(), 3);
    let kernels = jobs["jobs"][0]["kernels"].as_array().unwrap();
    assert_eq!(kernels.len(), 9);
    let last = serde_json::json!({ "wavelengthM": 450e-9, "place": { "distanceM": 0.016 }, "kernelVersion": "" });
    assert_eq!(kernels[8], last);
    // The holograms as files of another program.
    let files = "@/pattern-638nm.png @/pattern-520nm.png @/pattern-450nm.png";
    let planes = "--plane 8mm=@/near.png --plane 12mm=@/middle.png:2 --plane 16mm=@/far.png";
    let evaluate = "hologram evaluate --display rgb --wavelength 638nm,520nm,450nm";
    cli.text(&format!("{evaluate} {files} {planes} --reconstruction @/judged.png")).await;
    for distance in ["8mm", "12mm", "16mm"] {
        let [seen, judged] = ["seen", "judged"].map(|name| picture(&cli, &format!("{name}-{distance}.png")));
        assert!(seen == judged, "{distance}");
    }
    let two = format!("{evaluate} @/pattern-638nm.png @/pattern-520nm.png {planes}");
    cli.run(&two).await.assert_refused(2, &["2 files", "3 files"]);
    cli.server.assert_tidy();
    cli.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn depth_map_divides_picture_into_planes_and_each_subframe_gets_a_file() {
    let cli = start().await;
    let text = cli
        .text(
            "hologram optimize @/near.png --display rgb --wavelength 520nm --distance 8mm,16mm --depth-map @/depth.png \
             --subframes 2 --iterations 15 -o @/out/ --reconstruction @/out/",
        )
        .await;
    assert!(text.contains("8 mm") && text.contains("16 mm"), "{text}");
    for name in ["near-pattern-subframe1.png", "near-pattern-subframe2.png", "near-reconstruction-8mm.png"] {
        assert_eq!(picture(&cli, &format!("out/{name}")).width(), 96, "{name}");
    }
    cli.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn every_method_and_initial_phase_runs_and_its_phase_can_start_another_run() {
    let cli = start().await;
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
        cli.text(&format!("{optimize} {options} --npy @/{i}.npy")).await;
        let continued = format!("{optimize} --initial-phase @/{i}.npy --npy @/{i}-on.npy");
        cli.text(&continued).await;
        let read = |name: String| std::fs::read(cli.path(&name)).unwrap();
        assert!(read(format!("{i}-on.npy")) != read(format!("{i}.npy")), "{options}");
    }
    cli.server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn incompatible_options_are_refused() {
    let cli = start().await;
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
        ("--distance 8mm --subframes 25", 1, &["subframes is 25", "1 to 24"]),
        ("--distance 8mm --speckle 0.1 --speckle-block 100", 1, &["speckle_block_px is 100", "region of interest"]),
        ("--distance 8mm,8mm --depth-map @/depth.png", 1, &["planes[1]", "again"]),
        ("--distance 8mm,16mm --depth-map @/depth.png --kernel 3", 2, &["--kernel is 3", "ideal, active or an alias"]),
    ] {
        cli.run(&format!("{optimize} {options}")).await.assert_refused(code, signs);
    }
    let colours = "hologram optimize @/near.png --display rgb --distance 8mm --wavelength";
    cli.run(&format!("{colours} 520nm,520nm")).await.assert_refused(1, &["wavelengths_m[1]", "again"]);
    cli.run(&format!("{colours} 520nm,633nm")).await.assert_refused(1, &["wavelengths_m[1]", "638nm"]);
    std::fs::write(cli.path("short.npy"), b"\x93NUMPY").unwrap();
    let short = "--distance 8mm --initial-phase @/short.npy";
    cli.run(&format!("{optimize} {short}")).await.assert_refused(1, &["initial_phase.given.phases[0]", "float32"]);
    cli.server.assert_tidy();
    cli.server.stop().await;
}
