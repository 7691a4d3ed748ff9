//! What the rig keeps in its folder: what it has taken, whether somebody works at the bench, and that it runs.

mod pause;
mod remembered;

pub use pause::{Pause, PauseFile};
pub use remembered::Remembered;

use crate::Problem;
use std::fs::{File, OpenOptions};
use std::path::Path;

/// The lock of a running rig. The folder is free again when it is dropped, also by a kill.
#[derive(Debug)]
pub struct Running(#[allow(dead_code)] File); // an open file holds the lock

impl Running {
    /// Takes the folder for this program alone, and creates it if it is missing.
    ///
    /// # Errors
    ///
    /// [`Problem::Setting`] if the folder cannot be used, or another program uses it.
    pub fn take(folder: &Path) -> Result<Self, Problem> {
        let place = folder.display();
        let wrong = |error| Problem::Setting(format!("state_folder {place} cannot be used: {error}"));
        std::fs::create_dir_all(folder).map_err(wrong)?;
        let file =
            OpenOptions::new().create(true).truncate(false).write(true).open(folder.join("lock")).map_err(wrong)?;
        match file.try_lock() {
            Ok(()) => Ok(Self(file)),
            Err(std::fs::TryLockError::WouldBlock) => Err(Problem::Setting(format!(
                "another lightpath-rig uses {place}: end it, or name another state_folder"
            ))),
            Err(std::fs::TryLockError::Error(error)) => Err(wrong(error)),
        }
    }

    /// Whether a rig runs with this folder.
    #[must_use]
    pub fn is_taken(folder: &Path) -> bool {
        let opened = OpenOptions::new().write(true).open(folder.join("lock"));
        opened.is_ok_and(|file| matches!(file.try_lock(), Err(std::fs::TryLockError::WouldBlock)))
    }
}
