//! Waiting for a file until it is complete.

use crate::device::{DeviceError, Result};
use crate::pictures::{self, Grey};
use std::fs;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant, SystemTime};

/// Folder for photographs that were used.
pub(super) const TAKEN: &str = "taken";
/// Time between two looks.
const LOOK: Duration = Duration::from_millis(100);
/// Time without a change after which a file that cannot be read is not merely incomplete.
const STILL: Duration = Duration::from_secs(3);

/// Waits for a picture for as long as its pattern is shown. A picture counts when it can be read to its end.
pub(super) fn wait_for(path: &Path, deadline: Instant, is_shown: impl Fn() -> bool) -> Result<Grey> {
    let mut seen: Option<((u64, Option<SystemTime>), Instant)> = None;
    loop {
        if let Ok(file) = fs::metadata(path) {
            let state = (file.len(), file.modified().ok());
            if seen.is_none_or(|(before, _)| before != state) {
                seen = Some((state, Instant::now()));
            }
            let still = seen.map_or(Duration::ZERO, |(_, since)| since.elapsed());
            let read = fs::read(path).map_err(|error| DeviceError(error.to_string()));
            match read.and_then(|bytes| pictures::grey(&bytes)) {
                Ok(picture) => return Ok(picture),
                // A file that still grows is not complete.
                Err(_) if still < STILL => {}
                Err(error) => return Err(DeviceError(format!("{}: {error}", path.display()))),
            }
        }
        if !is_shown() {
            return Err(DeviceError::new("another pattern is shown: nobody waits for this photograph any more"));
        }
        if Instant::now() >= deadline {
            return Err(DeviceError(format!("no photograph came as {}: see folder.wait_s", path.display())));
        }
        thread::sleep(LOOK);
    }
}

/// Moves a photograph that was used out of the way.
pub(super) fn put_away(path: &Path) -> Result<()> {
    let (Some(folder), Some(name)) = (path.parent(), path.file_name()) else { return Ok(()) };
    let moved = fs::rename(path, folder.join(TAKEN).join(name));
    moved.map_err(|error| DeviceError(format!("{} cannot be moved to {TAKEN}: {error}", path.display())))
}

/// The highest number with which a name in a folder begins.
pub(super) fn highest_number(folder: &Path) -> u64 {
    let Ok(entries) = fs::read_dir(folder) else { return 0 };
    let number = |name: &str| name.split('-').next().and_then(|digits| digits.parse().ok());
    entries.flatten().filter_map(|entry| number(&entry.file_name().to_string_lossy())).max().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_counts_when_it_is_complete_and_numbers_go_on() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join(TAKEN)).unwrap();
        let path = folder.path().join("000007-aa.png");
        let png = pictures::photograph(2, 1, &[7, 255], 1, 255).unwrap();
        fs::write(&path, &png[..png.len() / 2]).unwrap();
        let (file, rest) = (path.clone(), png.clone());
        let writer = thread::spawn(move || {
            thread::sleep(Duration::from_millis(150));
            fs::write(file, rest).unwrap();
        });
        let soon = Instant::now() + Duration::from_secs(20);
        assert_eq!(wait_for(&path, soon, || true).unwrap().values, [7, 255]);
        writer.join().unwrap();
        assert_eq!(highest_number(folder.path()), 7);
        put_away(&path).unwrap();
        assert_eq!((highest_number(folder.path()), highest_number(&folder.path().join(TAKEN))), (0, 7));
        assert!(wait_for(&path, soon, || false).unwrap_err().0.contains("another pattern"));
        assert!(wait_for(&path, Instant::now(), || true).unwrap_err().0.contains("folder.wait_s"));
    }
}
