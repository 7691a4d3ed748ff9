//! Taking a photograph: show, settle, expose, throw away what is too early, average.
//!
//! ```text
//! show ─ exposure ─ settled ─ shutter opens ─ frames … ─ shutter closes ─ read back
//!                             └ a frame counts if it began after this, has a new number, and has the new exposure
//! ```

use crate::bench::{Bench, Halt, Permit};
use crate::device::{DeviceError, Frame, Levels};
use crate::limits::{Duty, Limits};
use crate::pictures;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime};

/// Frames in a row that may be too early. With more, the camera gives none that belongs to the pattern.
const EARLY_MAX: u32 = 100;
/// Part by which an exposure that a frame reports may differ from the one that was set: cameras round it to their rows.
const EXPOSURE_TOLERANCE: f64 = 0.01;

/// A photograph that is wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// What the SLM shows.
    pub levels: Levels,
    /// Exposure \[s\].
    pub exposure_s: f64,
    /// Number of frames of which the photograph is the mean.
    pub frames: u32,
    /// Whether the shutter stays closed.
    pub dark: bool,
    /// Wavelength of the light \[m\].
    pub wavelength_m: f64,
}

/// A photograph that was taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Photograph {
    /// A grey PNG whose white is that of the camera.
    pub png: Vec<u8>,
    /// SHA-256 of the levels on the SLM, in hexadecimal digits.
    pub levels_sha256: String,
    /// Number of the first frame, as the camera counts, or else the rig.
    pub frame: u64,
    /// Begin of the first frame's exposure.
    pub exposure_time: SystemTime,
    /// Exposure that the frames had \[s\].
    pub exposure_s: f64,
    /// Temperature of the SLM or else of the camera \[°C\].
    pub temperature_c: Option<f64>,
}

/// Why there is no photograph.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NoPhotograph {
    /// The bench was made safe meanwhile.
    Stopped,
    /// The bench cannot do, or its limits forbid, what was asked for; asking again is in vain.
    Refused(String),
    /// It failed, and may succeed later.
    Failed(String),
}

impl From<Halt> for NoPhotograph {
    fn from(halt: Halt) -> Self {
        match halt {
            Halt::Stopped => Self::Stopped,
            Halt::Device(error) => Self::Failed(error.0),
        }
    }
}

impl From<DeviceError> for NoPhotograph {
    fn from(error: DeviceError) -> Self {
        Self::Failed(error.0)
    }
}

/// Takes one photograph after another at a bench.
#[derive(Debug)]
pub struct Photographer {
    limits: Limits,
    /// Wavelengths of the rig \[m\].
    wavelengths_m: Vec<f64>,
    state: Mutex<State>,
}

/// What is known from the photographs before.
#[derive(Debug, Default)]
struct State {
    /// The exposure that was asked for and the one that the camera chose \[s\].
    exposure: Option<(f64, f64)>,
    /// Frames since the exposure was changed: the number of the first one, and how many.
    since_change: (Option<u64>, u32),
    /// Number of the last frame that was seen.
    last_number: Option<u64>,
    /// Frames so far, where the camera does not count.
    counted: u64,
    duty: Duty,
}

impl Photographer {
    /// A photographer who keeps these limits.
    #[must_use]
    pub fn new(limits: Limits, wavelengths_m: Vec<f64>) -> Self {
        Self { limits, wavelengths_m, state: Mutex::default() }
    }

    /// Takes a photograph. Blocks for as long as that takes.
    ///
    /// # Errors
    ///
    /// [`NoPhotograph`]. The shutter is closed then, too.
    pub fn photograph(&self, bench: &Bench, permit: Permit, order: &Order) -> Result<Photograph, NoPhotograph> {
        self.check(bench, order).map_err(NoPhotograph::Refused)?;
        // One photograph at a time.
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let taken = self.take(&mut state, bench, permit, order);
        if taken.is_err() {
            // The camera may have been opened anew, or have lost the change.
            state.exposure = None;
        }
        taken
    }

    fn take(
        &self,
        state: &mut State,
        bench: &Bench,
        permit: Permit,
        order: &Order,
    ) -> Result<Photograph, NoPhotograph> {
        bench.choose_light(permit, order.wavelength_m)?;
        let shown = Instant::now();
        let levels = order.levels.clone();
        bench.with_slm(permit, "show a pattern", move |slm, by| slm.show(&levels, by))?;
        let exposure_s = state.set_exposure(bench, permit, order.exposure_s)?;
        // Cameras round exposures, and some choose others.
        let most_s = self.limits.exposure_max_s * (1.0 + EXPOSURE_TOLERANCE);
        if !(exposure_s > 0.0 && exposure_s <= most_s) {
            let (asked_ms, chosen_ms) = (order.exposure_s * 1e3, exposure_s * 1e3);
            return Err(NoPhotograph::Refused(format!(
                "the camera was told to expose {asked_ms} ms and chose {chosen_ms} ms, which limits.exposure_max_ms of this \
                 rig does not allow"
            )));
        }
        bench.wait_until(permit, shown + bench.slm().settling)?;
        let taken = match order.dark || !bench.has_shutter() {
            true => state.expose(bench, permit, order, exposure_s, None)?,
            false => self.expose_lit(state, bench, permit, order, exposure_s)?,
        };
        let levels_sha256 = match bench.slm().reads_back {
            true => bench.with_slm(permit, "read back its pattern", |slm, by| slm.read_back(by))?.sha256(),
            false => order.levels.sha256(),
        };
        let temperature_c = match bench.with_slm(permit, "say its temperature", |slm, _| Ok(slm.temperature_c()))? {
            None => bench
                .with_camera(permit, "say its temperature", Duration::ZERO, |camera, _| Ok(camera.temperature_c()))?,
            some => some,
        };
        let (width_px, height_px) = (bench.camera().width_px, bench.camera().height_px);
        let png = pictures::photograph(width_px, height_px, &taken.sum, order.frames, bench.camera().white())?;
        let (frame, exposure_time) = (taken.frame, taken.time);
        Ok(Photograph { png, levels_sha256, frame, exposure_time, exposure_s, temperature_c })
    }

    /// Refuses what the bench cannot do or its limits forbid.
    fn check(&self, bench: &Bench, order: &Order) -> Result<(), String> {
        let camera = bench.camera();
        self.limits.check(order.exposure_s, order.frames, order.dark)?;
        if order.frames == 0 {
            return Err("a photograph of 0 frames was asked for: ask for at least 1".to_owned());
        }
        if !(camera.exposure_min_s..=camera.exposure_max_s).contains(&order.exposure_s) {
            let (asked, least, most) =
                (order.exposure_s * 1e3, camera.exposure_min_s * 1e3, camera.exposure_max_s * 1e3);
            return Err(format!("the exposure of {asked} ms is not within those of the camera, {least} to {most} ms"));
        }
        if order.dark && !bench.has_shutter() {
            return Err("a dark photograph needs a shutter, and this bench has none".to_owned());
        }
        let has = |wavelength_m: &f64| (wavelength_m - order.wavelength_m).abs() < 1e-12;
        if !self.wavelengths_m.iter().any(has) {
            let asked = order.wavelength_m * 1e9;
            return Err(format!("this rig has no light of {asked:.3} nm: see wavelengths in its file"));
        }
        Ok(())
    }

    /// Exposes with the shutter open, as soon as the duty allows it.
    fn expose_lit(
        &self,
        state: &mut State,
        bench: &Bench,
        permit: Permit,
        order: &Order,
        exposure_s: f64,
    ) -> Result<Exposed, NoPhotograph> {
        let allowed = self.limits.duty_max.map(|part| Duration::from_secs_f64(60.0 * part));
        if let Some(allowed) = allowed {
            let wanted = Duration::from_secs_f64(exposure_s * f64::from(order.frames)).min(allowed);
            bench.wait_until(permit, state.duty.earliest(wanted, allowed, Instant::now()))?;
        }
        let opened = Instant::now();
        let lit = allowed.map(|allowed| allowed.saturating_sub(state.duty.lit(opened)));
        let taken = match bench.open_shutter(permit) {
            Ok(()) => state.expose(bench, permit, order, exposure_s, lit.map(|lit| opened + lit)),
            Err(halt) => Err(halt.into()),
        };
        // The shutter closes whatever happened, also when a frame was good: light that stays on is not safe.
        let closed = bench.close_shutter();
        state.duty.add(opened, Instant::now());
        let taken = taken?;
        closed?;
        Ok(taken)
    }
}

/// The frames of a photograph.
struct Exposed {
    sum: Vec<u32>,
    frame: u64,
    time: SystemTime,
}

impl State {
    /// Changes the exposure, if it is another one, and returns the one that the camera has \[s\].
    fn set_exposure(&mut self, bench: &Bench, permit: Permit, exposure_s: f64) -> Result<f64, NoPhotograph> {
        if let Some((asked, actual)) = self.exposure
            && asked == exposure_s
        {
            return Ok(actual);
        }
        let set = move |camera: &mut dyn crate::device::Camera, by| camera.set_exposure(exposure_s, by);
        let actual = bench.with_camera(permit, "change its exposure", Duration::ZERO, set)?;
        self.exposure = Some((exposure_s, actual));
        self.since_change = (None, 0);
        Ok(actual)
    }

    /// Takes frames until enough of them belong to the pattern. Light must not be on after `dark_by`.
    fn expose(
        &mut self,
        bench: &Bench,
        permit: Permit,
        order: &Order,
        exposure_s: f64,
        dark_by: Option<Instant>,
    ) -> Result<Exposed, NoPhotograph> {
        let (camera, ready) = (bench.camera().clone(), Instant::now());
        let pixels = camera.width_px as usize * camera.height_px as usize;
        let mut exposed = Exposed { sum: vec![0; pixels], frame: 0, time: SystemTime::now() };
        let (mut taken, mut early, mut held) = (0, 0, camera.held_frames);
        let exposure = Duration::from_secs_f64(exposure_s);
        while taken < order.frames {
            if dark_by.is_some_and(|end| Instant::now() + exposure > end) {
                let what = "light was on for as long as limits.duty_percent allows before the photograph was complete";
                return Err(NoPhotograph::Failed(format!("{what}; the camera takes longer than its exposures")));
            }
            let asked = Instant::now();
            let frame = bench.with_camera(permit, "take a frame", exposure, |camera, by| camera.frame(by))?;
            let frame = frame.turned_right(&camera)?;
            if !self.belongs(&frame, ready, exposure_s, camera.exposure_delay_frames, &mut held) {
                early += 1;
                if early > EARLY_MAX {
                    return Err(NoPhotograph::Failed(format!(
                        "{early} frames began before the pattern was settled or had another exposure; see that the camera \
                         runs, and camera.exposure_delay_frames and camera.held_frames"
                    )));
                }
                continue;
            }
            if taken == 0 {
                exposed.frame = frame.number.unwrap_or(self.counted);
                exposed.time = SystemTime::now() - frame.begun.unwrap_or(asked).elapsed();
            }
            exposed.sum.iter_mut().zip(&frame.values).for_each(|(sum, &value)| *sum += u32::from(value));
            taken += 1;
        }
        Ok(exposed)
    }

    /// Whether a frame shows the settled pattern with the new exposure, and is another one than those before.
    fn belongs(&mut self, frame: &Frame, ready: Instant, exposure_s: f64, delay: u32, held: &mut u32) -> bool {
        self.counted += 1;
        let is_repeated = frame.number.is_some() && frame.number == self.last_number;
        self.last_number = frame.number.or(self.last_number);
        let is_new = match frame.begun {
            Some(begun) => begun >= ready,
            None if *held > 0 => {
                *held -= 1;
                false
            }
            None => true,
        };
        if is_repeated || !is_new {
            return false;
        }
        // How many frames after the change this one is: by the camera's own count where it has one, so that frames which
        // the driver dropped count, too.
        let (first, seen) = &mut self.since_change;
        let by_number = match (*first, frame.number) {
            (Some(first), Some(number)) => number.saturating_sub(first),
            (None, Some(number)) => {
                *first = Some(number);
                0
            }
            (_, None) => 0,
        };
        let position = by_number.max(u64::from(*seen));
        *seen = seen.saturating_add(1);
        let said = frame.exposure_s.unwrap_or(exposure_s);
        position >= u64::from(delay) && (said - exposure_s).abs() <= EXPOSURE_TOLERANCE * exposure_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Which frames count, of frames of 10 ms after a change of the exposure that takes effect after two frames.
    fn counted(frames: &[(Option<u64>, Option<f64>)], held_frames: u32) -> Vec<bool> {
        let (ready, mut state, mut held) = (Instant::now() + Duration::from_secs(60), State::default(), held_frames);
        state.last_number = Some(10);
        let belongs = |&(number, exposure_s): &(Option<u64>, Option<f64>)| {
            let frame = Frame { number, begun: None, exposure_s, values: Vec::new() };
            state.belongs(&frame, ready, 0.01, 2, &mut held)
        };
        frames.iter().map(belongs).collect()
    }

    #[test]
    fn frames_count_once_and_from_when_the_exposure_takes_effect() {
        let numbered = |numbers: &[u64]| numbers.iter().map(|&number| (Some(number), None)).collect::<Vec<_>>();
        let (no, yes) = (false, true);
        assert_eq!(counted(&numbered(&[11, 12, 13, 14]), 0), [no, no, yes, yes]);
        assert_eq!(counted(&numbered(&[10, 11, 12, 13, 13]), 0), [no, no, no, yes, no], "the same number twice");
        assert_eq!(counted(&numbered(&[11, 14]), 0), [no, yes], "frames that were dropped passed, too");
        assert_eq!(counted(&numbered(&[11, 12, 13, 14]), 1), [no, no, no, yes], "one is held back");
        assert_eq!(counted(&[(None, None); 4], 0), [no, no, yes, yes]);
        let said = [(Some(11), Some(0.01)), (Some(12), Some(0.02)), (Some(13), Some(0.02)), (Some(14), Some(0.01005))];
        assert_eq!(counted(&said, 0), [no, no, no, yes], "what a frame says of its exposure counts, too");
    }

    #[test]
    fn frames_that_begin_before_the_pattern_has_settled_do_not_count() {
        let (ready, mut state) = (Instant::now(), State::default());
        let mut of = |number, begun| {
            let frame = Frame { number: Some(number), begun: Some(begun), exposure_s: None, values: Vec::new() };
            state.belongs(&frame, ready, 0.01, 0, &mut 0)
        };
        assert!(!of(1, ready - Duration::from_micros(1)));
        assert!(of(2, ready));
    }
}
