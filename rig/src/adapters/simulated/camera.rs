//! The simulated camera.

use super::faults::{Fault, draws};
use super::{Simulated, milliseconds};
use crate::device::{Camera, CameraFacts, DeviceError, Frame, Justified, Levels, Result};
use lightpath_optics::Plane;
use std::thread;
use std::time::{Duration, Instant};

/// Purposes of random numbers. Those below 100 are of the faults.
const NOISE: u64 = 101;
const HOT: u64 = 102;
const SHIFT: u64 = 103;
/// How much brighter a saturated frame is.
const SATURATION: f32 = 100.0;
/// Largest shift of a shifted frame \[px\].
const SHIFT_PX_MAX: f64 = 20.0;

/// Takes frames of what the SLM shows when their exposure begins.
pub(super) struct SimulatedCamera {
    bench: Simulated,
    /// The exposure that was set, and the one before \[s\].
    exposure_s: f64,
    before_s: f64,
    /// Frames since the exposure was set, and how many pass until it takes effect.
    since: u32,
    delay: u32,
    /// The frame that comes again.
    doubled: Option<Frame>,
}

/// What the sensor sees during a frame.
struct Scene {
    number: u64,
    begun: Instant,
    shown: Option<Levels>,
    before: Option<Levels>,
    is_dark: bool,
    wavelength_m: f64,
    /// Exposure that acts \[s\].
    exposure_s: f64,
    faults: Vec<Fault>,
}

impl SimulatedCamera {
    pub(super) fn new(bench: Simulated) -> Self {
        let exposure_s = bench.settings.nominal_exposure_ms / 1e3;
        Self { bench, exposure_s, before_s: exposure_s, since: 0, delay: 0, doubled: None }
    }

    /// Begins a frame: what is shown, and what goes wrong.
    fn begin(&mut self) -> Scene {
        let begun = Instant::now();
        let mut inside = self.bench.lock();
        let mut number = inside.frames + 1;
        if inside.planter.happens(Fault::DroppedFrame, number, number) {
            number += 1;
        }
        inside.frames = number;
        let each = [
            Fault::StaleFrame,
            Fault::HalfFrame,
            Fault::BlackFrame,
            Fault::SaturatedFrame,
            Fault::ShiftedFrame,
            Fault::DoubledFrame,
            Fault::HangingCamera,
            Fault::WrongBits,
        ];
        let faults: Vec<Fault> =
            each.into_iter().filter(|&fault| inside.planter.happens(fault, number, number)).collect();
        let has_effect = self.since >= self.delay;
        self.since = self.since.saturating_add(1);
        // A frame that begins before the pattern appears shows the one before, as at a real bench.
        let has_appeared = begun >= inside.appears;
        Scene {
            number,
            begun,
            shown: if has_appeared { inside.shown.clone() } else { inside.before.clone() },
            before: inside.before.clone(),
            is_dark: !inside.is_open,
            wavelength_m: inside.wavelength_m,
            exposure_s: if has_effect { self.exposure_s } else { self.before_s },
            faults,
        }
    }

    /// The values of a frame, in the lower bits.
    fn values(&self, scene: &Scene) -> Result<Vec<u16>> {
        let (camera, seed) = (&self.bench.facts.camera, self.bench.settings.faults.seed);
        let (height, width) = (camera.height_px as usize, camera.width_px as usize);
        let light = self.light(scene)?.unwrap_or_else(|| Plane::filled(height, width, 0.0));
        let bench = self.bench.light.bench(scene.wavelength_m)?;
        let white = camera.white();
        let mut values = bench.expose_to(&light, white, seed.wrapping_add(scene.number)).into_vec();
        let faults = &self.bench.settings.faults;
        if faults.read_noise > 0.0 {
            let (mut noise, scale) = (draws(seed, NOISE, scene.number), faults.read_noise * f64::from(white));
            let noisy = |value: &mut u16| *value = (f64::from(*value) + scale * noise.normal()).round() as u16;
            values.iter_mut().for_each(noisy);
            values.iter_mut().for_each(|value| *value = (*value).min(white));
        }
        for hot in 0..u64::from(faults.hot_pixels) {
            values[(draws(seed, HOT, hot).next() * (height * width) as f64) as usize] = white;
        }
        if scene.faults.contains(&Fault::BlackFrame) {
            values.fill(0);
        }
        Ok(values)
    }

    /// The light on the camera, as a part of white; `None`: it is dark.
    fn light(&self, scene: &Scene) -> Result<Option<Plane<f32>>> {
        let has = |fault| scene.faults.contains(&fault);
        let stale = has(Fault::StaleFrame);
        let shown = if stale { scene.before.as_ref().or(scene.shown.as_ref()) } else { scene.shown.as_ref() };
        let Some(shown) = shown.filter(|_| !scene.is_dark) else { return Ok(None) };
        let of = |levels: &Levels| self.bench.light.of(levels, scene.wavelength_m);
        let light = of(shown)?;
        let lower = match (&scene.before, has(Fault::HalfFrame)) {
            (Some(before), true) => of(before)?,
            _ => light.clone(),
        };
        let faults = &self.bench.settings.faults;
        let power = (1.0 - faults.power_drift_per_frame).powf(scene.number as f64);
        let nominal_s = self.bench.settings.nominal_exposure_ms / 1e3;
        let mut gain = (power * scene.exposure_s / nominal_s) as f32;
        if has(Fault::SaturatedFrame) {
            gain *= SATURATION;
        }
        let (dx, dy) = self.shift(scene, has(Fault::ShiftedFrame));
        let (height, width) = (light.height_px(), light.width_px());
        Ok(Some(Plane::from_fn(height, width, |y, x| {
            let half = if 2 * y < height { &light } else { &lower };
            gain * moved(half, y as f64 - dy, x as f64 - dx)
        })))
    }

    /// By how much the picture is moved, along x and y \[px\].
    fn shift(&self, scene: &Scene, is_shifted: bool) -> (f64, f64) {
        let faults = &self.bench.settings.faults;
        let drift = faults.place_drift_px_per_frame * scene.number as f64;
        if !is_shifted {
            return (drift, 0.0);
        }
        let mut draws = draws(faults.seed, SHIFT, scene.number);
        // At least a quarter of the largest, so that it is a fault and not a rounding.
        let mut far = || (SHIFT_PX_MAX * (0.25 + 0.75 * draws.next())).round();
        (drift + far(), far())
    }
}

/// A sample of a plane between its pixels, linear in both directions; its border goes on for ever.
fn moved(plane: &Plane<f32>, y: f64, x: f64) -> f32 {
    let at = |y: f64, x: f64| {
        let within = |i: f64, n: usize| i.clamp(0.0, (n - 1) as f64) as usize;
        plane.at(within(y, plane.height_px()), within(x, plane.width_px()))
    };
    let (y0, x0) = (y.floor(), x.floor());
    let (fy, fx) = ((y - y0) as f32, (x - x0) as f32);
    if fy == 0.0 && fx == 0.0 {
        return at(y0, x0);
    }
    let row = |y: f64| (1.0 - fx) * at(y, x0) + fx * at(y, x0 + 1.0);
    (1.0 - fy) * row(y0) + fy * row(y0 + 1.0)
}

impl Camera for SimulatedCamera {
    fn facts(&self) -> CameraFacts {
        self.bench.facts.camera.clone()
    }

    fn set_exposure(&mut self, exposure_s: f64, _: Instant) -> Result<f64> {
        let mut inside = self.bench.lock();
        let next = inside.frames + 1;
        let is_late = inside.planter.happens(Fault::LateExposure, next, next);
        (self.before_s, self.exposure_s, self.since) = (self.exposure_s, exposure_s, 0);
        self.delay = self.bench.facts.camera.exposure_delay_frames + u32::from(is_late);
        Ok(exposure_s)
    }

    fn frame(&mut self, deadline: Instant) -> Result<Frame> {
        if let Some(again) = self.doubled.take() {
            return Ok(again);
        }
        let scene = self.begin();
        if scene.faults.contains(&Fault::HangingCamera) {
            thread::sleep(milliseconds(self.bench.settings.faults.hang_s * 1e3));
        }
        let mut values = self.values(&scene)?;
        let camera = &self.bench.facts.camera;
        let is_wrong = scene.faults.contains(&Fault::WrongBits);
        if (camera.justified == Justified::Left) != is_wrong {
            let shift = 16 - camera.bit_depth;
            values.iter_mut().for_each(|value| *value <<= shift);
        }
        // The frame takes its exposure, of which the computation was a part.
        let end = scene.begun + Duration::from_secs_f64(scene.exposure_s);
        thread::sleep(end.saturating_duration_since(Instant::now()));
        if Instant::now() > deadline {
            return Err(DeviceError::new("no frame came in time"));
        }
        let (number, begun) = (Some(scene.number), Some(scene.begun));
        let frame = Frame { number, begun, exposure_s: Some(self.exposure_s), values };
        if scene.faults.contains(&Fault::DoubledFrame) {
            self.doubled = Some(frame.clone());
        }
        Ok(frame)
    }

    fn temperature_c(&mut self) -> Option<f64> {
        Some(35.0)
    }
}
