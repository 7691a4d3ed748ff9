//! The last photographs that were taken and uploaded, so that none is taken twice, also not after a kill.

use lightpath::digest_of;
use lightpath::v1::serve_rig_request::Taken;
use std::collections::VecDeque;
use std::io;
use std::path::{Path, PathBuf};

/// Answers that are kept. The server asks again only for what it has asked for just before.
const KEPT: usize = 256;

/// Answers in the order in which they were given, in memory and in files.
#[derive(Debug)]
pub struct Remembered {
    folder: PathBuf,
    answers: VecDeque<Taken>,
}

impl Remembered {
    /// Reads what was remembered. Files that cannot be read are removed: their photographs are taken again.
    ///
    /// # Errors
    ///
    /// The folder cannot be used.
    pub fn open(folder: &Path) -> io::Result<Self> {
        let folder = folder.join("taken");
        std::fs::create_dir_all(&folder)?;
        let mut found = Vec::new();
        for entry in std::fs::read_dir(&folder)? {
            let path = entry?.path();
            let answer = std::fs::read(&path).ok().and_then(|bytes| serde_json::from_slice::<Taken>(&bytes).ok());
            match (answer, std::fs::metadata(&path).and_then(|file| file.modified())) {
                (Some(answer), Ok(time)) => found.push((time, answer)),
                _ => std::fs::remove_file(&path)?,
            }
        }
        found.sort_by_key(|(time, _)| *time);
        let mut remembered = Self { folder, answers: VecDeque::new() };
        remembered.answers.extend(found.into_iter().map(|(_, answer)| answer));
        remembered.forget_old();
        Ok(remembered)
    }

    /// The answer to a request, if it was given lately.
    #[must_use]
    pub fn answer(&self, take: &str) -> Option<Taken> {
        self.answers.iter().rev().find(|answer| answer.take == take).cloned()
    }

    /// Remembers an answer.
    ///
    /// # Errors
    ///
    /// The file cannot be written. The answer is remembered in memory all the same.
    pub fn add(&mut self, answer: Taken) -> io::Result<()> {
        let path = self.path(&answer.take);
        let text = serde_json::to_vec(&answer).map_err(io::Error::other);
        self.answers.push_back(answer);
        self.forget_old();
        lightpath::replace_file(&path, &text?).map_err(io::Error::other)
    }

    fn forget_old(&mut self) {
        while self.answers.len() > KEPT {
            if let Some(old) = self.answers.pop_front() {
                // A file that stays is forgotten at the next start.
                let _ = std::fs::remove_file(self.path(&old.take));
            }
        }
    }

    /// The file of a request. Its id is hashed, so that it can be any text.
    fn path(&self, take: &str) -> PathBuf {
        self.folder.join(format!("{}.json", digest_of(take.as_bytes())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_outlive_the_program_and_old_ones_are_forgotten() {
        let folder = tempfile::tempdir().unwrap();
        let answer =
            |n: usize| Taken { take: format!("../take {n}"), photo: format!("sha256-{n}"), ..Taken::default() };
        let mut remembered = Remembered::open(folder.path()).unwrap();
        (0..KEPT + 5).for_each(|n| remembered.add(answer(n)).unwrap());
        std::fs::write(folder.path().join("taken/half.json"), "{").unwrap();
        let again = Remembered::open(folder.path()).unwrap();
        assert_eq!(again.answer("../take 4"), None);
        assert_eq!(again.answer("../take 5"), Some(answer(5)));
        assert_eq!(again.answer(&format!("../take {}", KEPT + 4)), Some(answer(KEPT + 4)));
        assert_eq!(std::fs::read_dir(folder.path().join("taken")).unwrap().count(), KEPT, "no other file is left");
    }
}
