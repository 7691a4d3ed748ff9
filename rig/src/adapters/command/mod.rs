//! Programs show and photograph.
//!
//! Each call starts a program, hands it paths and numbers, and waits for its end. Programs take and leave files in a folder
//! of their own, which is removed with the devices.

mod run;

use super::folder::expect_size;
use crate::device::{Camera, CameraFacts, DeviceError, Devices, Frame, Levels, Result, Shutter, Slm, SlmFacts};
use crate::pictures;
use crate::ranges::number;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// The programs, in the rig's file: each a program and its arguments.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Shows the pattern in the file `{pattern}`, a grey PNG of levels.
    pub show: Vec<String>,
    /// Photographs with `{exposure_s}`, and writes a grey PNG or TIFF to `{photo}`.
    pub photograph: Vec<String>,
    /// Lets light through.
    pub shutter_open: Option<Vec<String>>,
    /// Keeps the light back.
    pub shutter_close: Option<Vec<String>>,
    /// Longest time of showing \[s\].
    #[serde(default = "show_limit_s")]
    pub show_limit_s: f64,
    /// Longest time of photographing beyond the exposure \[s\].
    #[serde(default = "photograph_limit_s")]
    pub photograph_limit_s: f64,
}

fn show_limit_s() -> f64 {
    10.0
}

fn photograph_limit_s() -> f64 {
    30.0
}

impl Settings {
    /// Lets programs that are named with a path count from a folder. Others are searched for as a shell does.
    pub(crate) fn resolve(&mut self, folder: &Path) {
        let programs = [&mut self.show, &mut self.photograph].into_iter();
        let programs = programs.chain(self.shutter_open.iter_mut()).chain(self.shutter_close.iter_mut());
        for program in programs.filter_map(|words| words.first_mut()).filter(|program| program.contains('/')) {
            *program = text(&folder.join(&*program));
        }
    }

    /// Checks the fields.
    pub(crate) fn check(&self) -> std::result::Result<(), String> {
        number("command.show_limit_s", self.show_limit_s, 0.1, 3600.0)?;
        number("command.photograph_limit_s", self.photograph_limit_s, 0.1, 3600.0)?;
        if self.shutter_open.is_some() != self.shutter_close.is_some() {
            return Err("command.shutter_open and command.shutter_close belong together: give both or none".to_owned());
        }
        let empty: &[String] = &[];
        let of = |words: &Option<Vec<String>>| words.clone();
        for (name, words, needs) in [
            ("command.show", Some(self.show.clone()), "{pattern}"),
            ("command.photograph", Some(self.photograph.clone()), "{photo}"),
            ("command.shutter_open", of(&self.shutter_open), ""),
            ("command.shutter_close", of(&self.shutter_close), ""),
        ] {
            let Some(words) = words else { continue };
            if words == empty {
                return Err(format!("{name} is empty: name a program and its arguments"));
            }
            if !needs.is_empty() && !words.iter().any(|word| word.contains(needs)) {
                return Err(format!("{name} has no {needs}: the program must learn the path of the file"));
            }
        }
        Ok(())
    }
}

/// Opens the devices.
///
/// # Errors
///
/// There is no place for the files of the programs.
pub fn devices(settings: &Settings, slm: &SlmFacts, camera: &CameraFacts) -> Result<Devices> {
    let files = Arc::new(Files::new()?);
    let settings = Arc::new(settings.clone());
    let shutter = || Box::new(CommandShutter(Arc::clone(&settings))) as Box<dyn Shutter>;
    Ok(Devices {
        shutter: settings.shutter_open.is_some().then(shutter),
        slm: Box::new(CommandSlm { facts: slm.clone(), settings: Arc::clone(&settings), files: Arc::clone(&files) }),
        camera: Box::new(CommandCamera { facts: camera.clone(), settings, files, exposure_s: 0.0, count: 0 }),
        light: None,
    })
}

/// A folder for the files of the programs. It goes when the devices go.
#[derive(Debug)]
struct Files(PathBuf);

impl Files {
    fn new() -> Result<Self> {
        let wrong = |error| DeviceError(format!("no folder for the files of the programs: {error}"));
        // The number of the process keeps two rigs apart, and the time two opens of one rig.
        let time = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default().as_nanos();
        let path = std::env::temp_dir().join(format!("lightpath-rig-{}-{time}", std::process::id()));
        // Fails if it is there: nobody else has put something into it.
        std::fs::create_dir(&path).map_err(wrong)?;
        Ok(Self(path))
    }
}

impl Drop for Files {
    fn drop(&mut self) {
        // A folder that stays is one of the system's temporary ones.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

struct CommandSlm {
    facts: SlmFacts,
    settings: Arc<Settings>,
    files: Arc<Files>,
}

struct CommandCamera {
    facts: CameraFacts,
    settings: Arc<Settings>,
    files: Arc<Files>,
    exposure_s: f64,
    count: u64,
}

struct CommandShutter(Arc<Settings>);

impl Slm for CommandSlm {
    fn facts(&self) -> SlmFacts {
        self.facts.clone()
    }

    fn show(&mut self, levels: &Levels, deadline: Instant) -> Result<()> {
        let path = self.files.0.join("pattern.png");
        lightpath::replace_file(&path, &pictures::levels_png(levels)?)
            .map_err(|error| DeviceError(error.to_string()))?;
        run::run(&self.settings.show, &[("{pattern}", &text(&path))], deadline)
    }
}

impl Camera for CommandCamera {
    fn facts(&self) -> CameraFacts {
        self.facts.clone()
    }

    fn set_exposure(&mut self, exposure_s: f64, _: Instant) -> Result<f64> {
        self.exposure_s = exposure_s;
        Ok(exposure_s)
    }

    fn frame(&mut self, deadline: Instant) -> Result<Frame> {
        self.count += 1;
        // A name of its own, so that no photograph before is taken for this one.
        let path = self.files.0.join(format!("photo-{}.png", self.count));
        let begun = Instant::now();
        let values = [("{photo}", text(&path)), ("{exposure_s}", self.exposure_s.to_string())];
        let values = values.each_ref().map(|(name, value)| (*name, value.as_str()));
        run::run(&self.settings.photograph, &values, deadline)?;
        let bytes = std::fs::read(&path).map_err(|error| {
            DeviceError(format!(
                "command.photograph ended well, but wrote no photograph to {}: {error}",
                path.display()
            ))
        })?;
        let picture = pictures::grey(&bytes).map_err(|error| DeviceError(format!("of command.photograph: {error}")))?;
        expect_size(&path, (picture.width_px, picture.height_px), &self.facts)?;
        let _ = std::fs::remove_file(&path);
        Ok(Frame { number: Some(self.count), begun: Some(begun), exposure_s: None, values: picture.values })
    }
}

impl Shutter for CommandShutter {
    fn open(&mut self, deadline: Instant) -> Result<()> {
        self.0.shutter_open.as_ref().map_or(Ok(()), |words| run::run(words, &[], deadline))
    }

    fn close(&mut self, deadline: Instant) -> Result<()> {
        self.0.shutter_close.as_ref().map_or(Ok(()), |words| run::run(words, &[], deadline))
    }
}

fn text(path: &Path) -> String {
    path.display().to_string()
}
