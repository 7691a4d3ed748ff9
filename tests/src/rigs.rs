//! A display calibrates itself: the programs `lightpathd`, `lightpath-rig` and `lightpath calibrate` together.

use crate::command_line::CommandLine;
use crate::process::rig;
use std::time::Duration;
use tokio::time::sleep;

/// Settings of a rig on a simulated bench, whose camera is displaced and turned, and which plants faults now and then.
fn settings(server: &str) -> String {
    format!(
        r#"
server = "{server}"
display = "lab"
distance = "20mm"
wavelengths = ["515nm"]
adapter = "simulated"

[slm]
width_px = 160
height_px = 96
bit_depth = 8
settling_time_ms = 4.0

[camera]
width_px = 160
height_px = 96
bit_depth = 10
exposure_min_ms = 0.1
exposure_max_ms = 1000.0

[limits]
exposure_max_ms = 1000.0
frames_max = 8

[simulated]
bench = "bench.toml"
latency_ms = 1.0
jitter_ms = 1.0

[simulated.faults]
seed = 7
stale_frame = 0.05
half_frame = 0.05
black_frame = 0.05

"#
    )
}

#[tokio::test(flavor = "multi_thread")]
async fn one_command_calibrates_a_display_although_its_rig_is_killed() {
    let cli = CommandLine::start().await;
    cli.text("display create lab --resolution 160x96 --pixel-pitch 8um --wavelength 515nm").await;
    cli.write("bench.toml", b"seed = 4\nmisalignment_px = 2.0\nrotation_rad = 0.01\n");
    let file = cli.write("rig.toml", settings(cli.server.url()).as_bytes());
    let refused = cli.run("calibrate --display lab").await;
    refused.assert_refused(1, &["no rig serves displays/lab; start lightpath-rig at its bench"]);

    let mut first = rig(&["serve", "--settings", &file]);
    while !cli.text("rig list").await.contains("lab") {
        sleep(Duration::from_millis(50)).await;
    }
    let calibrating = cli.run("calibrate --display lab --photos 6 --degree 5 -o @/out");
    let killing = async {
        let is_photographing = |jobs: serde_json::Value| {
            let newest = jobs["jobs"][0].clone();
            newest["label"] == "calibrate calibration-lab: photos" && newest["state"] == "STATE_RUNNING"
        };
        while !is_photographing(cli.json("job list --limit 1").await) {
            sleep(Duration::from_millis(5)).await;
        }
        first.kill().await.unwrap();
        rig(&["serve", "--settings", &file])
    };
    let (calibrated, _second) = tokio::join!(calibrating, killing);
    let (said, noted) = (calibrated.stdout.clone(), calibrated.stderr.clone());
    assert!(calibrated.ok().contains("kernels/515nm-20mm/versions/1 is active now"), "{said}\n{noted}");
    assert!(noted.contains("12/12  ask the display's gate"), "{noted}");
    // Ideal optics, learned, gain.
    let gains: Vec<f64> = said
        .lines()
        .filter_map(|line| line.trim_end().strip_suffix(" dB")?.rsplit(['+', '-']).next()?.parse().ok())
        .collect();
    assert!(gains.len() == 2 && gains.iter().all(|gain_db| *gain_db > 1.0), "{said}\n{noted}");
    for name in ["report.html", "judge-140-ideal-1.png", "judge-140-learned-1.png"] {
        assert!(cli.path("out").join(name).is_file(), "{name}");
    }
    let photos = cli.json("job list --limit 0").await;
    let jobs = photos["jobs"].as_array().unwrap().len();
    let again = cli.text("calibrate --display lab --photos 6 --degree 5").await;
    assert!(again.contains("versions/1 is active"), "{again}");
    let photos = cli.json("job list --limit 0").await;
    assert_eq!(photos["jobs"].as_array().unwrap().len(), jobs, "the same command again starts nothing anew");
    cli.server.stop().await;
}
