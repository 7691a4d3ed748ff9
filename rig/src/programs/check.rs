//! `lightpath-rig check`: everything once, without a server.

use crate::bench::{Bench, Halt};
use crate::device::{Frame, Levels};
use crate::settings::Settings;
use crate::state::Running;
use crate::take::{NoPhotograph, Order, Photograph, Photographer};
use crate::{Problem, opening, pictures};
use std::path::Path;
use std::time::{Duration, Instant};

/// Frames with which the time until a pattern is settled is measured.
const TIMING_FRAMES: usize = 20;
/// Correlation with the settled picture from which on a frame counts as settled.
const SETTLED: f64 = 0.95;

/// Shows patterns, photographs them, and returns a table.
pub(super) fn check(path: &Path) -> Result<String, Problem> {
    let settings = Settings::read(path)?;
    let _running = Running::take(&settings.state_folder)?;
    let bench = opening::open(&settings, None)?;
    bench.make_safe()?;
    let measured = measure(&settings, &bench);
    let safe = bench.make_safe();
    let table = measured?;
    safe?;
    Ok(table)
}

fn measure(settings: &Settings, bench: &Bench) -> Result<String, Problem> {
    let (slm, camera) = (bench.slm(), bench.camera());
    let mut table = Vec::new();
    let mut row = |name: &str, value: String| table.push(format!("{name:<28} {value}"));
    row("SLM", format!("{}×{} px, {} bits", slm.width_px, slm.height_px, slm.bit_depth));
    row("camera", format!("{}×{} px, {} bits", camera.width_px, camera.height_px, camera.bit_depth));
    row("shutter", if bench.has_shutter() { "yes" } else { "no" }.to_owned());
    let photographer = Photographer::new(settings.bench_limits(), settings.wavelengths_m().map_err(Problem::Setting)?);
    let exposure_s =
        (settings.limits.exposure_max_ms / 1e3).min(camera.exposure_max_s).min(0.01).max(camera.exposure_min_s);
    let take = |seed: u32| {
        let wavelength_m = settings.wavelengths_m().ok().and_then(|all| all.first().copied()).unwrap_or_default();
        let order = Order { levels: speckles(bench, seed), exposure_s, frames: 1, dark: false, wavelength_m };
        photographer.photograph(bench, bench.permit(), &order).map_err(problem)
    };
    let (first, again) = (take(1)?, take(1)?);
    row("exposure", format!("{} ms", first.exposure_s * 1e3));
    let (values, others) = (values(&first)?, values(&again)?);
    row("mean", format!("{:.2} % of white", 100.0 * mean(&values)));
    row("noise of a frame", format!("{:.3} % of white", 100.0 * noise(&values, &others)));
    let saturated = values.iter().filter(|&&value| value >= 1.0).count() as f64 / values.len() as f64;
    row("saturated", format!("{:.3} % of pixels", 100.0 * saturated));
    row("same picture twice", format!("correlation {:.3}", correlation(&values, &others)));
    let other = self::values(&take(2)?)?;
    row("another pattern", format!("correlation {:.3}", correlation(&values, &other)));
    if !matches!(settings.adapter, crate::settings::Adapter::Folder) {
        row("settled after", settling(bench, exposure_s)?);
    }
    row("undiffracted light", "not measured: that needs a hologram of a dark middle".to_owned());
    if correlation(&values, &other) > 0.9 {
        row("WARNING", "two patterns look alike: is the right screen connected, and the light on?".to_owned());
    }
    Ok(table.join("\n"))
}

/// Time from showing a pattern until frames show it, beside what the file says.
fn settling(bench: &Bench, exposure_s: f64) -> Result<String, Problem> {
    let (permit, camera) = (bench.permit(), bench.camera().clone());
    let exposure = Duration::from_secs_f64(exposure_s);
    let run = || -> Result<Vec<(Duration, Frame)>, Halt> {
        let (from, to) = (speckles(bench, 3), speckles(bench, 4));
        bench.with_slm(permit, "show a pattern", move |slm, by| slm.show(&from, by))?;
        bench.wait_until(permit, Instant::now() + 2 * bench.slm().settling + Duration::from_millis(100))?;
        bench.open_shutter(permit)?;
        let shown = Instant::now();
        bench.with_slm(permit, "show a pattern", move |slm, by| slm.show(&to, by))?;
        let frame = |_| {
            let asked = Instant::now();
            let frame = bench.with_camera(permit, "take a frame", exposure, |camera, by| camera.frame(by))?;
            let frame = frame.turned_right(&camera)?;
            Ok((frame.begun.unwrap_or(asked).saturating_duration_since(shown), frame))
        };
        (0..TIMING_FRAMES).map(frame).collect()
    };
    let frames = run();
    bench.close_shutter()?;
    let frames = frames.map_err(|halt| problem(halt.into()))?;
    let values = |frame: &Frame| frame.values.iter().map(|&value| f64::from(value)).collect::<Vec<_>>();
    let Some((_, last)) = frames.last() else { return Ok("not measured".to_owned()) };
    let last = values(last);
    let is_settled = |(_, frame): &(Duration, Frame)| correlation(&values(frame), &last) >= SETTLED;
    // The first frame from which on all are settled.
    let first = frames.len() - frames.iter().rev().take_while(|frame| is_settled(frame)).count();
    let said_ms = bench.slm().settling.as_secs_f64() * 1e3;
    // The pattern settled between the last frame without it and the first with it.
    let ms = |at: usize| frames.get(at).map_or(0.0, |(time, _)| time.as_secs_f64() * 1e3);
    let after_ms = first.checked_sub(1).map_or(0.0, ms);
    Ok(match first + 1 < frames.len() {
        true => format!("{after_ms:.1} to {:.1} ms (slm.settling_time_ms is {said_ms})", ms(first)),
        false => format!("not within {TIMING_FRAMES} frames: is slm.settling_time_ms, {said_ms}, long enough?"),
    })
}

/// A pattern of blocks with random levels, whose light is spread.
fn speckles(bench: &Bench, seed: u32) -> Levels {
    let slm = bench.slm();
    let highest = u16::MAX >> (16 - slm.bit_depth);
    let level = |at: u32| {
        let block = (at % slm.width_px / 2, at / slm.width_px / 2);
        // A hash of place and seed: any mixing of bits does.
        let mixed = (block.0.wrapping_mul(0x9E37_79B1) ^ block.1.wrapping_mul(0x85EB_CA77)).wrapping_add(seed);
        let mixed = (mixed ^ (mixed >> 15)).wrapping_mul(0xC2B2_AE3D);
        ((mixed ^ (mixed >> 13)) >> 8) as u16 & highest
    };
    let values: Vec<u16> = (0..slm.width_px * slm.height_px).map(level).collect();
    Levels::try_new(slm.width_px, slm.height_px, slm.bit_depth, values)
        .unwrap_or_else(|error| unreachable!("the levels are those of the SLM: {error}"))
}

/// Values of a photograph, as parts of white.
fn values(photograph: &Photograph) -> Result<Vec<f64>, Problem> {
    let picture = pictures::grey(&photograph.png)?;
    let white = f64::from((1u32 << picture.file_bits) - 1);
    Ok(picture.values.iter().map(|&value| f64::from(value) / white).collect())
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Standard deviation of the noise of one frame, from two of the same picture.
fn noise(a: &[f64], b: &[f64]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    (squares / (2.0 * a.len() as f64)).sqrt()
}

/// Pearson's correlation; 0 if one is constant.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (mean_a, mean_b) = (mean(a), mean(b));
    let sum = |f: &dyn Fn(f64, f64) -> f64| a.iter().zip(b).map(|(a, b)| f(a - mean_a, b - mean_b)).sum::<f64>();
    let scale = (sum(&|a, _| a * a) * sum(&|_, b| b * b)).sqrt();
    if scale > 0.0 { sum(&|a, b| a * b) / scale } else { 0.0 }
}

fn problem(failure: NoPhotograph) -> Problem {
    match failure {
        NoPhotograph::Refused(why) => Problem::Setting(why),
        NoPhotograph::Failed(why) => Problem::Devices(why),
        NoPhotograph::Stopped => Problem::Devices("the bench was made safe".to_owned()),
    }
}
