//! Faults that tests plant in a card.

use crate::fault::Fault;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};

/// Faults of a card.
#[derive(Debug)]
pub(crate) struct Planted {
    /// Number of allocations before one is refused; negative: none is.
    pub(crate) allocations: AtomicI64,
    /// Shader whose text is changed, with the part that is replaced and its replacement.
    pub(crate) wrong: Mutex<Option<(&'static str, &'static str, &'static str)>>,
    /// Whether all that is read is 0.
    pub(crate) zeros: AtomicBool,
}

impl Default for Planted {
    fn default() -> Self {
        Self { allocations: AtomicI64::new(-1), wrong: Mutex::default(), zeros: AtomicBool::default() }
    }
}

impl Planted {
    pub(crate) fn allocate(&self) -> Result<(), Fault> {
        match self.allocations.fetch_sub(1, Ordering::Relaxed) {
            0 => Err(Fault::OutOfMemory("planted".to_owned())),
            _ => Ok(()),
        }
    }

    pub(crate) fn text(&self, name: &str, text: &str) -> String {
        match *self.wrong.lock().unwrap() {
            Some((of, part, by)) if of == name => {
                assert!(text.contains(part), "{name} has no {part}");
                text.replacen(part, by, 1)
            }
            _ => text.to_owned(),
        }
    }

    pub(crate) fn read(&self, values: &mut [u8]) {
        if self.zeros.load(Ordering::Relaxed) {
            values.fill(0);
        }
    }
}
