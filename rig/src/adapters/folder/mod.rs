//! Somebody photographs: patterns are written into one folder, and photographs are awaited in another under the same name.
//!
//! ```text
//! patterns/000012-3fa9c1d2.png   the rig writes it      ─> a person shows it
//! photos/000012-3fa9c1d2.png     the rig waits for it   <─ a person saves the photograph
//! photos/taken/…                 photographs that were used
//! ```
//!
//! Of several frames of one pattern the second is awaited as `…-2.png`, and so on, in any order.

mod watch;

use crate::device::{Camera, CameraFacts, DeviceError, Devices, Frame, Levels, Result, Slm, SlmFacts};
use crate::{log, pictures};
use serde::Deserialize;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// The folders, in the rig's file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Folder into which patterns are written.
    pub patterns: PathBuf,
    /// Folder in which photographs are awaited.
    pub photos: PathBuf,
    /// Longest wait for a photograph \[s\].
    pub wait_s: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { patterns: "patterns".into(), photos: "photos".into(), wait_s: 3600.0 }
    }
}

/// What SLM and camera know of each other: which pattern is shown.
#[derive(Debug, Default)]
struct Shown {
    /// Name of the pattern's file, without its ending.
    name: String,
    /// Number of the pattern.
    number: u64,
    /// Frames of it so far.
    frames: u32,
}

/// Creates the folders, and opens the devices.
///
/// # Errors
///
/// A folder cannot be created.
pub fn devices(settings: &Settings, slm: &SlmFacts, camera: &CameraFacts) -> Result<Devices> {
    for folder in [settings.patterns.clone(), settings.photos.join(watch::TAKEN)] {
        let wrong = |error| DeviceError(format!("the folder {} cannot be created: {error}", folder.display()));
        fs::create_dir_all(&folder).map_err(wrong)?;
    }
    // Numbers go on after those that are there, so that no photograph of an earlier run is taken for a new one.
    let number = watch::highest_number(&settings.patterns).max(watch::highest_number(&settings.photos));
    let number = number.max(watch::highest_number(&settings.photos.join(watch::TAKEN)));
    let shown = Arc::new(Mutex::new(Shown { number, ..Shown::default() }));
    Ok(Devices {
        slm: Box::new(FolderSlm { facts: slm.clone(), patterns: settings.patterns.clone(), shown: Arc::clone(&shown) }),
        camera: Box::new(FolderCamera {
            facts: camera.clone(),
            photos: settings.photos.clone(),
            shown,
            exposure_s: 0.0,
            count: 0,
        }),
        shutter: None,
        light: None,
    })
}

struct FolderSlm {
    facts: SlmFacts,
    patterns: PathBuf,
    shown: Arc<Mutex<Shown>>,
}

struct FolderCamera {
    facts: CameraFacts,
    photos: PathBuf,
    shown: Arc<Mutex<Shown>>,
    exposure_s: f64,
    count: u64,
}

impl Slm for FolderSlm {
    fn facts(&self) -> SlmFacts {
        self.facts.clone()
    }

    fn show(&mut self, levels: &Levels, _: Instant) -> Result<()> {
        let png = pictures::levels_png(levels)?;
        let mut shown = lock(&self.shown);
        let number = shown.number + 1;
        let name = format!("{number:06}-{}", &levels.sha256()[..8]);
        let path = self.patterns.join(format!("{name}.png"));
        lightpath::replace_file(&path, &png).map_err(|error| DeviceError(error.to_string()))?;
        // The camera gives up its wait for the pattern before.
        *shown = Shown { name, number, frames: 0 };
        log::line(format_args!("show {}", path.display()));
        Ok(())
    }
}

impl Camera for FolderCamera {
    fn facts(&self) -> CameraFacts {
        self.facts.clone()
    }

    fn set_exposure(&mut self, exposure_s: f64, _: Instant) -> Result<f64> {
        self.exposure_s = exposure_s;
        log::line(format_args!("set the camera's exposure to {} ms", exposure_s * 1e3));
        Ok(exposure_s)
    }

    fn frame(&mut self, deadline: Instant) -> Result<Frame> {
        let (name, pattern) = {
            let mut shown = lock(&self.shown);
            shown.frames += 1;
            let name = match shown.frames {
                1 => shown.name.clone(),
                n => format!("{}-{n}", shown.name),
            };
            (name, shown.number)
        };
        let path = self.photos.join(format!("{name}.png"));
        log::line(format_args!("photograph it with {} ms, and save that as {}", self.exposure_s * 1e3, path.display()));
        let begun = Instant::now();
        let is_shown = || lock(&self.shown).number == pattern;
        let picture = watch::wait_for(&path, deadline, is_shown)?;
        expect_size(&path, (picture.width_px, picture.height_px), &self.facts)?;
        watch::put_away(&path)?;
        self.count += 1;
        // Nobody knows when the person pressed the button, but it was after the pattern was shown.
        Ok(Frame { number: Some(self.count), begun: Some(begun), exposure_s: None, values: picture.values })
    }
}

/// Refuses a photograph of another size than the camera.
pub(super) fn expect_size(path: &Path, (width_px, height_px): (u32, u32), camera: &CameraFacts) -> Result<()> {
    if (width_px, height_px) == (camera.width_px, camera.height_px) {
        return Ok(());
    }
    let (place, wanted) = (path.display(), (camera.width_px, camera.height_px));
    Err(DeviceError(format!(
        "{place} has {width_px}×{height_px} px, but the camera {}×{} px: correct camera.width_px and camera.height_px, or \
         save the whole picture",
        wanted.0, wanted.1
    )))
}

fn lock(shown: &Mutex<Shown>) -> MutexGuard<'_, Shown> {
    // What is protected is replaced as a whole.
    shown.lock().unwrap_or_else(PoisonError::into_inner)
}
