//! What the fields of the rig's file may be, and what the program makes of them.

use super::file::{Adapter, Settings};
use crate::device::{CameraFacts, DeviceError, Levels, SlmFacts};
use crate::limits::Limits;
use crate::pictures;
use crate::ranges::{number, whole};
use lightpath_units::Length;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Largest side of an SLM or a camera \[px\].
const SIDE_PX_MAX: u32 = 16_384;
/// Largest number of frames of a photograph: their sum is kept in 32 bits.
const FRAMES_MAX: u32 = 10_000;
/// Longest time in the file \[s\].
const TIME_S_MAX: f64 = 86_400.0;
/// Time that an SLM has where the file does not say.
const DEVICE_LIMIT: Duration = Duration::from_secs(10);

impl Settings {
    /// Checks the fields, each alone and with those that belong to it.
    pub(super) fn check(&self) -> Result<(), String> {
        self.distance_m()?;
        if self.wavelengths_m()?.is_empty() {
            return Err("wavelengths is empty: name at least one, such as [\"515nm\"]".to_owned());
        }
        let (slm, camera, limits) = (&self.slm, &self.camera, &self.limits);
        for (name, value) in [
            ("slm.width_px", slm.width_px),
            ("slm.height_px", slm.height_px),
            ("camera.width_px", camera.width_px),
            ("camera.height_px", camera.height_px),
        ] {
            whole(name, value, 1, SIDE_PX_MAX)?;
        }
        whole("slm.bit_depth", slm.bit_depth, 1, 16)?;
        whole("camera.bit_depth", camera.bit_depth, 1, 16)?;
        whole("camera.exposure_delay_frames", camera.exposure_delay_frames, 0, 50)?;
        whole("camera.held_frames", camera.held_frames, 0, 50)?;
        whole("limits.frames_max", limits.frames_max, 1, FRAMES_MAX)?;
        let most_ms = TIME_S_MAX * 1e3;
        number("slm.settling_time_ms", slm.settling_time_ms, 0.0, most_ms)?;
        number("camera.exposure_min_ms", camera.exposure_min_ms, 1e-6, most_ms)?;
        number("camera.exposure_max_ms", camera.exposure_max_ms, camera.exposure_min_ms, most_ms)?;
        number("limits.exposure_max_ms", limits.exposure_max_ms, camera.exposure_min_ms, most_ms)?;
        number("safe.lost_link_s", self.safe.lost_link_s, 0.0, TIME_S_MAX)?;
        if let Some(percent) = limits.duty_percent {
            number("limits.duty_percent", percent, 0.01, 100.0)?;
            if !self.has_shutter() {
                return Err("limits.duty_percent needs a shutter: describe one, or leave the limit out".to_owned());
            }
        }
        if self.safe.pattern.is_some() && self.safe.level.is_some() {
            return Err("safe.pattern and safe.level are both given: keep one of them".to_owned());
        }
        self.check_adapter()
    }

    fn check_adapter(&self) -> Result<(), String> {
        match self.adapter {
            Adapter::Simulated => {
                if (self.slm.width_px, self.slm.height_px) != (self.camera.width_px, self.camera.height_px) {
                    return Err(
                        "camera.width_px and camera.height_px must be those of the SLM: a simulated camera has a \
                                pixel for each of the SLM's"
                            .to_owned(),
                    );
                }
                let simulated = &self.simulated;
                number("simulated.latency_ms", simulated.latency_ms, 0.0, 60_000.0)?;
                number("simulated.jitter_ms", simulated.jitter_ms, 0.0, 60_000.0)?;
                number("simulated.nominal_exposure_ms", simulated.nominal_exposure_ms, 1e-3, 60_000.0)?;
                number("simulated.frame_limit_s", simulated.frame_limit_s, 0.01, 3600.0)?;
                self.pixel_pitch_m().map(|_| ())
            }
            Adapter::Folder => number("folder.wait_s", self.folder.wait_s, 1.0, TIME_S_MAX),
            Adapter::Command => match &self.command {
                Some(command) => command.check(),
                None => Err("adapter is \"command\", but the section [command] is missing".to_owned()),
            },
        }
    }

    /// Lets paths count from a folder.
    pub(super) fn resolve(&mut self, folder: &Path) {
        let resolve = |path: &mut PathBuf| *path = folder.join(&*path);
        resolve(&mut self.state_folder);
        resolve(&mut self.folder.patterns);
        resolve(&mut self.folder.photos);
        self.safe.pattern.iter_mut().for_each(resolve);
        self.simulated.bench.iter_mut().for_each(resolve);
        self.simulated.faults.log.iter_mut().for_each(resolve);
        if let Some(command) = &mut self.command {
            command.resolve(folder);
        }
    }

    /// Distance of the camera's plane \[m\].
    ///
    /// # Errors
    ///
    /// It is no distance.
    pub fn distance_m(&self) -> Result<f64, String> {
        Length::Distance.parse_m(&self.distance).map_err(|error| format!("distance: {error}"))
    }

    /// Wavelengths in vacuum \[m\].
    ///
    /// # Errors
    ///
    /// One is no wavelength.
    pub fn wavelengths_m(&self) -> Result<Vec<f64>, String> {
        let parse = |text: &String| Length::Wavelength.parse_m(text).map_err(|error| format!("wavelengths: {error}"));
        self.wavelengths.iter().map(parse).collect()
    }

    /// Pixel pitch of the simulated bench \[m\], if the file has one.
    ///
    /// # Errors
    ///
    /// It is no length.
    pub fn pixel_pitch_m(&self) -> Result<Option<f64>, String> {
        let parse =
            |text: &String| Length::PixelPitch.parse_m(text).map_err(|why| format!("simulated.pixel_pitch: {why}"));
        self.simulated.pixel_pitch.as_ref().map(parse).transpose()
    }

    /// Whether the bench has a shutter.
    #[must_use]
    pub fn has_shutter(&self) -> bool {
        match self.adapter {
            Adapter::Simulated => self.simulated.shutter,
            Adapter::Folder => false,
            Adapter::Command => self.command.as_ref().is_some_and(|command| command.shutter_open.is_some()),
        }
    }

    /// What the SLM is.
    #[must_use]
    pub fn slm_facts(&self) -> SlmFacts {
        let slm = &self.slm;
        SlmFacts {
            width_px: slm.width_px,
            height_px: slm.height_px,
            bit_depth: slm.bit_depth,
            settling: Duration::from_secs_f64(slm.settling_time_ms / 1e3),
            reads_back: self.adapter == Adapter::Simulated && self.simulated.reads_back,
            limit: match (&self.adapter, &self.command) {
                (Adapter::Command, Some(command)) => Duration::from_secs_f64(command.show_limit_s),
                _ => DEVICE_LIMIT,
            },
        }
    }

    /// What the camera is. Its longest exposure is that of the limits, if that is shorter.
    #[must_use]
    pub fn camera_facts(&self) -> CameraFacts {
        let camera = &self.camera;
        CameraFacts {
            width_px: camera.width_px,
            height_px: camera.height_px,
            bit_depth: camera.bit_depth,
            justified: camera.justified,
            exposure_min_s: camera.exposure_min_ms / 1e3,
            exposure_max_s: camera.exposure_max_ms / 1e3,
            exposure_delay_frames: camera.exposure_delay_frames,
            held_frames: camera.held_frames,
            limit: match (&self.adapter, &self.command) {
                (Adapter::Command, Some(command)) => Duration::from_secs_f64(command.photograph_limit_s),
                (Adapter::Folder, _) => Duration::from_secs_f64(self.folder.wait_s),
                _ => Duration::from_secs_f64(self.simulated.frame_limit_s),
            },
        }
    }

    /// What no request can exceed.
    #[must_use]
    pub fn bench_limits(&self) -> Limits {
        Limits {
            exposure_max_s: self.limits.exposure_max_ms / 1e3,
            frames_max: self.limits.frames_max,
            duty_max: self.limits.duty_percent.map(|percent| percent / 100.0),
        }
    }

    /// The pattern of the safe state.
    ///
    /// # Errors
    ///
    /// The file cannot be read or does not fit the SLM, or the level is none of the SLM's.
    pub fn safe_pattern(&self, slm: &SlmFacts) -> crate::device::Result<Levels> {
        let of = |error: DeviceError| DeviceError(format!("safe.pattern: {error}"));
        if let Some(path) = &self.safe.pattern {
            let bytes = std::fs::read(path)
                .map_err(|error| DeviceError(format!("safe.pattern: {} cannot be read: {error}", path.display())))?;
            return pictures::pattern(&bytes, slm).map_err(of);
        }
        let pixels = slm.width_px as usize * slm.height_px as usize;
        let flat = vec![self.safe.level.unwrap_or(0); pixels];
        let levels = Levels::try_new(slm.width_px, slm.height_px, slm.bit_depth, flat);
        levels.map_err(|error| DeviceError(format!("safe.level: {error}")))
    }
}

#[cfg(test)]
mod tests {
    use super::super::EXAMPLE;
    use super::*;

    fn parsed(from: &str, to: &str) -> Result<Settings, String> {
        assert!(EXAMPLE.contains(from), "{from}");
        Settings::parse(&EXAMPLE.replacen(from, to, 1), Path::new("/etc/rig"))
    }

    #[test]
    fn the_example_is_right_and_paths_count_from_its_folder() {
        let settings = parsed("", "").unwrap();
        assert_eq!(settings.state_folder, Path::new("/etc/rig/rig-state"));
        assert_eq!((settings.distance_m(), settings.wavelengths_m()), (Ok(0.15), Ok(vec![515e-9])));
        assert!(settings.has_shutter());
        for adapter in ["folder", "command"] {
            parsed("adapter = \"simulated\"", &format!("adapter = \"{adapter}\"")).unwrap();
        }
    }

    #[test]
    fn wrong_fields_are_named_with_what_is_right() {
        for (from, to, text) in [
            ("bit_depth = 8", "bit_depth = 17", "slm.bit_depth is 17: it must be 1 to 16"),
            ("distance = \"150mm\"", "distance = \"150\"", "write 150mm"),
            ("[\"515nm\"]", "[]", "wavelengths is empty"),
            ("frames_max = 64", "frames_max = 0", "limits.frames_max is 0"),
            ("frames_max = 64", "frame_max = 64", "unknown field `frame_max`"),
            ("exposure_max_ms = 100.0", "exposure_max_ms = \"long\"", "exposure_max_ms"),
            ("level = 0", "level = 0\npattern = \"x.png\"", "keep one of them"),
            ("# duty_percent = 50.0", "duty_percent = 0.0", "limits.duty_percent is 0"),
            ("adapter = \"simulated\"", "adapter = \"usb\"", "simulated"),
        ] {
            let error = parsed(from, to).unwrap_err();
            assert!(error.contains(text), "{to}: {error}");
        }
    }

    #[test]
    fn a_duty_needs_a_shutter() {
        let text = EXAMPLE.replace("# duty_percent", "duty_percent");
        assert!(Settings::parse(&text, Path::new(".")).is_ok());
        let without = Settings::parse(&text.replace("shutter = true", "shutter = false"), Path::new("."));
        assert!(without.unwrap_err().contains("limits.duty_percent needs a shutter"));
    }

    #[test]
    fn the_safe_pattern_fits_the_slm() {
        let settings = parsed("level = 0", "level = 300").unwrap();
        let error = settings.safe_pattern(&settings.slm_facts()).unwrap_err();
        assert!(error.0.contains("safe.level: level 300"), "{error}");
        let settings = parsed("level = 0", "pattern = \"missing.png\"").unwrap();
        let error = settings.safe_pattern(&settings.slm_facts()).unwrap_err();
        assert!(error.0.contains("/etc/rig/missing.png cannot be read"), "{error}");
    }
}
