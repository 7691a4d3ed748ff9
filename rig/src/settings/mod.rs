//! The rig's file: what stands on the bench, how it is driven, and what it must never do.

mod checks;
mod file;

pub use file::{Adapter, CameraSection, Settings, SlmSection};

use crate::Problem;
use std::path::Path;

/// A commented example of the file.
pub const EXAMPLE: &str = include_str!("example.toml");

impl Settings {
    /// Reads and checks a file. Paths in it count from its folder.
    ///
    /// # Errors
    ///
    /// [`Problem::Setting`], which names the field and what to do.
    pub fn read(path: &Path) -> Result<Self, Problem> {
        let text = std::fs::read_to_string(path).map_err(|error| {
            let place = path.display();
            Problem::Setting(format!("{place} cannot be read: {error}; `lightpath-rig init` writes an example"))
        })?;
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Self::parse(&text, folder).map_err(|why| Problem::Setting(format!("{}: {why}", path.display())))
    }

    /// Reads and checks the text of a file. Paths in it count from `folder`.
    ///
    /// # Errors
    ///
    /// A text that names the field and what to do.
    pub fn parse(text: &str, folder: &Path) -> Result<Self, String> {
        let mut settings: Self = toml::from_str(text).map_err(|error| error.to_string().trim_end().to_owned())?;
        settings.check()?;
        settings.resolve(folder);
        Ok(settings)
    }
}
