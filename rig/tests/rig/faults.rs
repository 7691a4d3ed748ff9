use super::adapters::small;
use lightpath_rig::adapters::simulated;
use lightpath_rig::device::{CameraFacts, Devices, Frame, Justified, Levels};
use lightpath_rig::opening;
use std::collections::HashMap;
use std::time::{Duration, Instant};

fn soon() -> Instant {
    Instant::now() + Duration::from_secs(10)
}

/// A bench with one fault, the only thing that differs from one without.
fn bench(fault: &str) -> (simulated::Simulated, Devices) {
    let settings = small(&[("stale_frame = 0.0", fault), ("shutter = true", "shutter = false")]);
    let bench = opening::simulated(&settings, None).unwrap();
    let devices = bench.devices();
    (bench, devices)
}

fn pattern(seed: u32) -> Levels {
    let level = |at: u32| (at.wrapping_mul(2654435761).wrapping_mul(seed + 1) >> 24) as u16;
    Levels::try_new(64, 40, 8, (0..64 * 40).map(level).collect::<Vec<_>>()).unwrap()
}

/// Shows two patterns, one after the other has appeared, and takes a frame of the second.
fn frame(devices: &mut Devices) -> Frame {
    for seed in [1, 2] {
        devices.slm.show(&pattern(seed), soon()).unwrap();
        std::thread::sleep(Duration::from_millis(3));
    }
    devices.camera.frame(soon()).unwrap()
}

/// Root of the mean square of the difference, as a part of white.
fn difference(a: &[u16], b: &[u16]) -> f64 {
    let squares = a.iter().zip(b).map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2)).sum::<f64>();
    (squares / a.len() as f64).sqrt() / 255.0
}

fn mean(values: &[u16]) -> f64 {
    values.iter().map(|&value| f64::from(value)).sum::<f64>() / values.len() as f64 / 255.0
}

#[test]
fn planted_faults_of_frames_really_occur() {
    let clean = frame(&mut bench("").1).values;
    let before = {
        let mut devices = bench("").1;
        devices.slm.show(&pattern(1), soon()).unwrap();
        std::thread::sleep(Duration::from_millis(3));
        devices.camera.frame(soon()).unwrap().values
    };
    let again = frame(&mut bench("").1).values;
    assert_eq!(clean, again, "the same seed gives the same photograph");
    let noise = 0.01;
    let of = |fault: &str| frame(&mut bench(&format!("{fault} = 1.0")).1).values;
    let (upper, lower) = (0..64 * 20, 64 * 20..64 * 40);
    assert!(difference(&before, &clean) > 5.0 * noise, "the patterns differ");
    assert!(difference(&of("stale_frame"), &before) < noise);
    let half = of("half_frame");
    assert!(difference(&half[upper.clone()], &clean[upper]) < noise);
    assert!(difference(&half[lower.clone()], &before[lower]) < noise);
    assert!(of("black_frame").iter().all(|&value| value == 0));
    assert!(of("saturated_frame").iter().filter(|&&value| value == 255).count() > 64 * 40 / 2);
    assert!(difference(&of("shifted_frame"), &clean) > 5.0 * noise);
    assert!(difference(&of("covered_pattern"), &clean) > 2.0 * noise);
    let hot = frame(&mut bench("hot_pixels = 40").1).values;
    let whites = |values: &[u16]| values.iter().filter(|&&value| value == 255).count();
    assert!(whites(&hot) >= whites(&clean) + 30);
    assert!(difference(&frame(&mut bench("read_noise = 0.05").1).values, &clean) > 0.03);
    let dim = frame(&mut bench("power_drift_per_frame = 0.2").1).values;
    assert!((0.75..0.9).contains(&(mean(&dim) / mean(&clean))), "{}", mean(&dim) / mean(&clean));
    assert!(difference(&frame(&mut bench("place_drift_px_per_frame = 7.0").1).values, &clean) > 3.0 * noise);
    assert!(frame(&mut bench("wrong_bits = 1.0").1).values.iter().any(|&value| value > 255));
}

#[test]
fn planted_faults_of_numbers_exposures_and_time_really_occur() {
    let (_, mut devices) = bench("dropped_frame = 1.0");
    let numbers = [frame(&mut devices), devices.camera.frame(soon()).unwrap()].map(|frame| frame.number.unwrap());
    assert_eq!(numbers[1] - numbers[0], 2);
    let (_, mut devices) = bench("doubled_frame = 1.0");
    assert_eq!(frame(&mut devices), devices.camera.frame(soon()).unwrap());
    let lit = |fault: &str| {
        let (_, mut devices) = bench(fault);
        devices.camera.set_exposure(0.003, soon()).unwrap();
        mean(&frame(&mut devices).values)
    };
    assert!(lit("late_exposure = 1.0") > 2.0 * lit(""), "the light is that of the exposure before");
    let (_, mut devices) = bench("hanging_camera = 1.0\nhang_s = 0.2");
    let begin = Instant::now();
    drop(devices.camera.frame(soon()));
    assert!(begin.elapsed() >= Duration::from_millis(200));
}

#[test]
fn faults_happen_as_often_as_their_probability_says_and_are_written_down() {
    let place = tempfile::tempdir().unwrap();
    let log = place.path().join("planted.txt");
    let (bench, mut devices) = bench(&format!("dropped_frame = 0.2\nblack_frame = 0.1\nlog = \"{}\"", log.display()));
    devices.camera.set_exposure(1e-3, soon()).unwrap();
    let black =
        (0..300).filter(|_| devices.camera.frame(soon()).unwrap().values.iter().all(|&value| value == 0)).count();
    let mut counts = HashMap::new();
    bench.planted().iter().for_each(|planted| *counts.entry(planted.fault).or_insert(0) += 1);
    // Nothing is shown, so there is no light, but the black level is above 0.
    assert_eq!(counts[&simulated::Fault::BlackFrame], black);
    assert!((15..50).contains(&black), "{black}");
    assert!((35..90).contains(&counts[&simulated::Fault::DroppedFrame]));
    let written = std::fs::read_to_string(log).unwrap();
    assert_eq!(written.lines().count(), bench.planted().len());
    assert!(written.contains(" black_frame\n"));
}

#[test]
fn a_frame_that_begins_before_the_pattern_appears_shows_the_one_before() {
    let slow = [("latency_ms = 1.0", "latency_ms = 60000.0"), ("shutter = true", "shutter = false")];
    let mut devices = opening::simulated(&small(&slow), None).unwrap().devices();
    devices.slm.show(&pattern(1), soon()).unwrap();
    let first = devices.camera.frame(soon()).unwrap().values;
    assert!(mean(&first) < 0.05, "nothing has appeared yet: {}", mean(&first));
}

#[test]
fn the_program_turns_bits_right_whatever_their_place() {
    let of = |justified: &str| {
        let bits = format!("bit_depth = 12\njustified = \"{justified}\"");
        let changes = [("bit_depth = 8\njustified = \"right\"", bits.as_str()), ("shutter = true", "shutter = false")];
        let mut devices = opening::simulated(&small(&changes), None).unwrap().devices();
        let facts: CameraFacts = devices.camera.facts();
        (frame(&mut devices), facts)
    };
    let ((right, right_facts), (left, left_facts)) = (of("right"), of("left"));
    assert_eq!((right_facts.justified, left_facts.justified), (Justified::Right, Justified::Left));
    assert!(left.values.iter().any(|&value| value > 4095));
    assert_eq!(left.turned_right(&left_facts).unwrap().values, right.turned_right(&right_facts).unwrap().values);
}
