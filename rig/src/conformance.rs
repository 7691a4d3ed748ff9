//! What every adapter must do: the suite for whoever writes one.
//!
//! ```no_run
//! # fn devices() -> lightpath_rig::device::Result<lightpath_rig::device::Devices> { Err(lightpath_rig::device::DeviceError::new("no device")) }
//! lightpath_rig::conformance::check(devices).unwrap_or_else(|broken| panic!("{broken}"));
//! ```
//!
//! It shows patterns and takes frames, so on a real bench it needs the light that a photograph needs. What it cannot see is
//! whether the SLM truly shows what it was told; photographs are for that.

use crate::bench::Bench;
use crate::device::{Devices, Levels, Result};
use crate::limits::Limits;
use crate::pictures;
use crate::take::{NoPhotograph, Order, Photographer};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

/// Checks an adapter, which is opened by the function. It returns what is broken, in words.
///
/// # Errors
///
/// The first rule that does not hold, and how.
pub fn check(open: impl Fn() -> Result<Devices> + Send + Sync + 'static) -> std::result::Result<(), String> {
    let text = |error: crate::device::DeviceError| error.0;
    let flat = |slm: &crate::device::SlmFacts| pattern(slm.width_px, slm.height_px, slm.bit_depth, |_| 0);
    let bench = Arc::new(Bench::open(Box::new(open), flat).map_err(text)?);
    facts_are_possible(&bench)?;
    bench.make_safe().map_err(|error| format!("the safe state: {error}"))?;
    let all = Photographer::new(
        Limits { exposure_max_s: bench.camera().exposure_max_s, frames_max: 4, duty_max: None },
        vec![515e-9],
    );
    frames_are_whole_and_new(&bench, &all)?;
    read_back_is_what_was_shown(&bench)?;
    dark_is_as_asked(&bench, &all)?;
    limits_are_kept(&bench, &all)?;
    a_stop_is_quick(&bench, all)?;
    bench.make_safe().map_err(|error| format!("the safe state at the end: {error}"))
}

fn facts_are_possible(bench: &Bench) -> std::result::Result<(), String> {
    let (slm, camera) = (bench.slm(), bench.camera());
    let is_depth = |bits: u32| (1..=16).contains(&bits);
    require(slm.width_px > 0 && slm.height_px > 0 && is_depth(slm.bit_depth), || format!("the SLM says {slm:?}"))?;
    let sized = camera.width_px > 0 && camera.height_px > 0 && is_depth(camera.bit_depth);
    let exposes = camera.exposure_min_s > 0.0 && camera.exposure_min_s <= camera.exposure_max_s;
    require(sized && exposes, || format!("the camera says {camera:?}"))
}

/// A photograph of two frames has the camera's size, a number that grows, and a time within the call.
fn frames_are_whole_and_new(bench: &Bench, all: &Photographer) -> std::result::Result<(), String> {
    let mut last = None;
    for step in 0..3 {
        let order = order(bench, step, 2);
        let before = std::time::SystemTime::now();
        let taken = all.photograph(bench, bench.permit(), &order).map_err(|why| format!("a photograph: {why:?}"))?;
        let picture = pictures::grey(&taken.png).map_err(|error| error.0)?;
        let size = (picture.width_px, picture.height_px);
        require(size == (bench.camera().width_px, bench.camera().height_px), || {
            format!("a photograph of {size:?} px")
        })?;
        require(last.is_none_or(|last| taken.frame > last), || format!("frame {} after frame {last:?}", taken.frame))?;
        // A clock of milliseconds may be behind by one.
        let is_new = taken.exposure_time + Duration::from_millis(2) >= before;
        require(is_new && taken.exposure_time <= std::time::SystemTime::now(), || {
            format!("a frame of {:?}, asked for at {before:?}", taken.exposure_time)
        })?;
        require(taken.levels_sha256.len() == 64, || "no digest of the levels".to_owned())?;
        last = Some(taken.frame);
    }
    Ok(())
}

fn read_back_is_what_was_shown(bench: &Bench) -> std::result::Result<(), String> {
    if !bench.slm().reads_back {
        return Ok(());
    }
    let levels = order(bench, 7, 1).levels;
    let shown = levels.clone();
    let permit = bench.permit();
    let show = bench.with_slm(permit, "show a pattern", move |slm, by| slm.show(&shown, by));
    let read = show.and_then(|()| bench.with_slm(permit, "read back its pattern", |slm, by| slm.read_back(by)));
    let read = read.map_err(|halt| format!("reading back: {halt:?}"))?;
    require(read == levels, || "what is read back is not what was shown".to_owned())
}

fn dark_is_as_asked(bench: &Bench, all: &Photographer) -> std::result::Result<(), String> {
    let dark = Order { dark: true, ..order(bench, 1, 1) };
    match (bench.has_shutter(), all.photograph(bench, bench.permit(), &dark)) {
        (true, Ok(_)) | (false, Err(NoPhotograph::Refused(_))) => Ok(()),
        (has_shutter, other) => Err(format!("a dark photograph, with a shutter: {has_shutter}, gave {other:?}")),
    }
}

fn limits_are_kept(bench: &Bench, all: &Photographer) -> std::result::Result<(), String> {
    let plain = order(bench, 1, 1);
    let long = 2.0 * bench.camera().exposure_max_s;
    for wrong in [
        Order { exposure_s: long, ..plain.clone() },
        Order { frames: 5, ..plain.clone() },
        Order { frames: 0, ..plain.clone() },
        Order { exposure_s: f64::NAN, ..plain.clone() },
        Order { wavelength_m: 1e-6, ..plain },
    ] {
        let answer = all.photograph(bench, bench.permit(), &wrong);
        require(matches!(answer, Err(NoPhotograph::Refused(_))), || {
            format!("{} frames of {} s gave {answer:?}", wrong.frames, wrong.exposure_s)
        })?;
    }
    Ok(())
}

/// The safe state ends a photograph that is being taken, and the next one is taken all the same.
fn a_stop_is_quick(bench: &Arc<Bench>, all: Photographer) -> std::result::Result<(), String> {
    let all = Arc::new(all);
    let (order, permit) = (order(bench, 5, 4), bench.permit());
    let (photographer, used, wanted) = (Arc::clone(&all), Arc::clone(bench), order.clone());
    let taking = thread::spawn(move || photographer.photograph(&used, permit, &wanted));
    let begin = Instant::now();
    bench.make_safe().map_err(|error| format!("the safe state during a photograph: {error}"))?;
    let stopped = taking.join().map_err(|_| "a photograph panicked".to_owned())?;
    require(matches!(stopped, Err(NoPhotograph::Stopped)), || {
        format!("a photograph that was stopped gave {stopped:?}")
    })?;
    let limit = bench.slm().limit + Duration::from_secs(1);
    require(begin.elapsed() < limit, || format!("the stop took {:?}", begin.elapsed()))?;
    all.photograph(bench, bench.permit(), &order)
        .map(|_| ())
        .map_err(|why| format!("a photograph after a stop: {why:?}"))
}

/// A photograph of a pattern that differs for each `step`, with the shortest exposure.
fn order(bench: &Bench, step: u32, frames: u32) -> Order {
    let (slm, camera) = (bench.slm(), bench.camera());
    let levels = pattern(slm.width_px, slm.height_px, slm.bit_depth, |at| at.wrapping_mul(step + 1));
    let levels = levels.unwrap_or_else(|error| unreachable!("the levels are those of the SLM: {error}"));
    Order { levels, exposure_s: camera.exposure_min_s, frames, dark: false, wavelength_m: 515e-9 }
}

fn pattern(width_px: u32, height_px: u32, bit_depth: u32, level: impl Fn(u32) -> u32) -> Result<Levels> {
    let highest = u32::from(u16::MAX >> (16 - bit_depth.clamp(1, 16)));
    let values: Vec<u16> = (0..width_px * height_px).map(|at| (level(at) & highest) as u16).collect();
    Levels::try_new(width_px, height_px, bit_depth, values)
}

fn require(holds: bool, broken: impl FnOnce() -> String) -> std::result::Result<(), String> {
    if holds { Ok(()) } else { Err(broken()) }
}
