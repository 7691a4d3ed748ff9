//! The small picture that a running job shows of what it has reached.

use lightpath_media::live_pictures::LivePictures;
use std::cell::Cell;
use std::time::{Duration, Instant};

/// Least time from one picture to the next: people see a job move, and clients need not ask often.
const INTERVAL: Duration = Duration::from_secs(2);
/// Pause after a picture, in units of the time that drawing it took: pictures take at most a hundredth of a job's time.
const DRAWINGS_PER_PAUSE: u32 = 100;

/// Shows pictures of one attempt, which are forgotten at its end.
#[derive(Debug)]
pub(super) struct LivePicture {
    pictures: LivePictures,
    job: String,
    next: Cell<Instant>,
}

impl LivePicture {
    /// Shows the first picture [`INTERVAL`] from now.
    pub(super) fn new(pictures: LivePictures, job: String) -> Self {
        Self { pictures, job, next: Cell::new(Instant::now() + INTERVAL) }
    }

    /// Shows the PNG that `draw` makes, if it is time for one. `None`: there is no picture now.
    pub(super) fn show(&self, draw: impl FnOnce() -> Option<Vec<u8>>) {
        let begin = Instant::now();
        if begin < self.next.get() {
            return;
        }
        if let Some(png) = draw() {
            self.pictures.show(&self.job, png);
        }
        let took = begin.elapsed();
        self.next.set(begin + took + INTERVAL.max(DRAWINGS_PER_PAUSE * took));
        tracing::trace!(job = self.job, took_ms = took.as_secs_f64() * 1e3, "showed a picture");
    }
}

impl Drop for LivePicture {
    fn drop(&mut self) {
        self.pictures.forget(&self.job);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_rare_and_end_with_the_attempt() {
        let pictures = LivePictures::default();
        let picture = LivePicture::new(pictures.clone(), "job".to_owned());
        picture.show(|| unreachable!("it is too early"));
        picture.next.set(Instant::now());
        picture.show(|| Some(vec![1]));
        picture.show(|| unreachable!("the last picture was just drawn"));
        assert!(pictures.latest("job").is_some());
        drop(picture);
        assert!(pictures.latest("job").is_none());
    }

    #[test]
    fn the_pause_grows_with_the_time_of_drawing() {
        let picture = LivePicture::new(LivePictures::default(), "job".to_owned());
        let begin = Instant::now();
        picture.next.set(begin);
        let took = Duration::from_millis(40);
        picture.show(|| {
            let drawing = Instant::now();
            while drawing.elapsed() < took {}
            None
        });
        assert!(picture.next.get() >= begin + took + DRAWINGS_PER_PAUSE * took);
    }
}
