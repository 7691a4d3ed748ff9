use super::fake::Fake;
use lightpath_rig::adapters::{command, folder};
use lightpath_rig::pictures;
use lightpath_rig::settings::{EXAMPLE, Settings};
use lightpath_rig::{conformance, opening};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// The example of the rig's file, with a small bench.
pub fn small(changes: &[(&str, &str)]) -> Settings {
    let mut text = EXAMPLE.replace("width_px = 1920", "width_px = 64").replace("height_px = 1080", "height_px = 40");
    let fast = [
        ("settling_time_ms = 100.0", "settling_time_ms = 2.0"),
        ("exposure_min_ms = 0.1", "exposure_min_ms = 1.0"),
        ("latency_ms = 30.0", "latency_ms = 1.0"),
        ("jitter_ms = 10.0", "jitter_ms = 0.5"),
        ("distance = \"150mm\"", "distance = \"5mm\""),
    ];
    for (from, to) in fast.iter().chain(changes) {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    Settings::parse(&text, Path::new("/nowhere")).unwrap()
}

#[test]
fn the_fake_conforms() {
    let fake = Fake::default();
    conformance::check(move || Ok(fake.devices())).unwrap();
}

#[test]
fn the_simulated_bench_conforms() {
    for bits in ["bit_depth = 8\njustified = \"right\"", "bit_depth = 12\njustified = \"left\""] {
        let simulated = opening::simulated(&small(&[("bit_depth = 8\njustified = \"right\"", bits)]), None).unwrap();
        conformance::check(move || Ok(simulated.devices())).unwrap();
    }
}

/// A person who shows each pattern and photographs it: the photograph is the pattern.
fn person(patterns: &Path, photos: &Path, is_over: &AtomicBool) {
    while !is_over.load(Ordering::Acquire) {
        for entry in std::fs::read_dir(patterns).into_iter().flatten().flatten() {
            let Ok(pattern) = std::fs::read(entry.path()) else { continue };
            let stem = entry.path().file_stem().unwrap().to_str().unwrap().to_owned();
            // The second photograph first: they may come in any order.
            for name in
                [format!("{stem}-4.png"), format!("{stem}-3.png"), format!("{stem}-2.png"), format!("{stem}.png")]
            {
                let used = photos.join("taken").join(&name).exists();
                if !used && photos.exists() && !photos.join(&name).exists() {
                    // As many programs write: the file grows under its name.
                    std::fs::write(photos.join(&name), &pattern[..pattern.len() / 2]).unwrap();
                    std::fs::write(photos.join(&name), &pattern).unwrap();
                }
            }
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn folders_with_a_person_conform() {
    let place = tempfile::tempdir().unwrap();
    let folders = folder::Settings { patterns: place.path().join("p"), photos: place.path().join("q"), wait_s: 20.0 };
    let is_over = Arc::new(AtomicBool::new(false));
    let (over, patterns, photos) = (Arc::clone(&is_over), folders.patterns.clone(), folders.photos.clone());
    let works = std::thread::spawn(move || person(&patterns, &photos, &over));
    let settings = small(&[("adapter = \"simulated\"", "adapter = \"folder\"")]);
    let checked =
        conformance::check(move || folder::devices(&folders, &settings.slm_facts(), &settings.camera_facts()));
    is_over.store(true, Ordering::Release);
    works.join().unwrap();
    checked.unwrap();
}

#[test]
fn commands_conform_and_say_what_went_wrong() {
    let place = tempfile::tempdir().unwrap();
    let kept = place.path().join("shown.png").display().to_string();
    let sh = |script: &str| vec!["sh".to_owned(), "-c".to_owned(), script.to_owned()];
    let commands = command::Settings {
        show: sh(&format!("cp {{pattern}} {kept}")),
        photograph: sh(&format!("test {{exposure_s}} = 0.001 && cp {kept} {{photo}}")),
        shutter_open: Some(sh("true")),
        shutter_close: Some(sh("true")),
        show_limit_s: 10.0,
        photograph_limit_s: 10.0,
    };
    let settings = small(&[("adapter = \"simulated\"", "adapter = \"command\"")]);
    let (slm, camera) = (settings.slm_facts(), settings.camera_facts());
    let devices = move |commands: &command::Settings| command::devices(commands, &slm, &camera);
    let (good, open) = (commands.clone(), devices.clone());
    conformance::check(move || open(&good)).unwrap();
    for (script, said) in [
        ("echo the camera is asleep >&2; exit 3", "exit status: 3: the camera is asleep"),
        ("true", "wrote no photograph"),
        ("echo hello > {photo}", "neither PNG nor TIFF"),
    ] {
        let (bad, open) = (command::Settings { photograph: sh(script), ..commands.clone() }, devices.clone());
        let broken = conformance::check(move || open(&bad)).unwrap_err();
        assert!(broken.contains(said), "{script}: {broken}");
    }
    let small = pictures::photograph(2, 1, &[1, 2], 1, 255).unwrap();
    std::fs::write(place.path().join("small.png"), small).unwrap();
    let script = format!("cp {} {{photo}}", place.path().join("small.png").display());
    let bad = command::Settings { photograph: sh(&script), ..commands };
    let broken = conformance::check(move || devices(&bad)).unwrap_err();
    assert!(broken.contains("2×1 px, but the camera 64×40 px"), "{broken}");
}
