//! What goes wrong with a graphics card.

use std::sync::{Arc, Mutex, PoisonError};

/// A failure of a card or its driver. A card with a fault computes nothing any more; what it was computing goes on on the
/// processor.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// There is no card with this number.
    #[error("there is no graphics card number {number}: the Vulkan drivers of this machine offer {offered}")]
    Missing {
        /// The number.
        number: usize,
        /// Number of cards that there are.
        offered: usize,
    },
    /// The card is gone: its driver was reset, or the card was removed.
    #[error("the graphics card was lost: {0}")]
    Lost(String),
    /// The card has no memory left. Other, smaller problems may still fit.
    #[error("the graphics card has no memory left for this: {0}")]
    OutOfMemory(String),
    /// The driver refused what it was told to do.
    #[error("the graphics card's driver refused a command: {0}")]
    Refused(String),
    /// The card did not end a computation in time.
    #[error("the graphics card did not answer within {0} s")]
    TimedOut(u64),
    /// The card computed something wrong.
    #[error("the graphics card computed something wrong: {0}")]
    Wrong(String),
}

impl Fault {
    /// Whether the fault is that of one problem, and the card still serves others.
    #[must_use]
    pub fn is_of_one_problem(&self) -> bool {
        matches!(self, Self::OutOfMemory(_))
    }
}

impl From<wgpu::Error> for Fault {
    fn from(error: wgpu::Error) -> Self {
        match error {
            wgpu::Error::OutOfMemory { source } => Self::OutOfMemory(source.to_string()),
            wgpu::Error::Validation { description, .. } | wgpu::Error::Internal { description, .. } => {
                // The description has many lines; the log and a job's result take one.
                Self::Refused(description.split_whitespace().collect::<Vec<_>>().join(" "))
            }
        }
    }
}

/// The first fault of a card that puts it aside; none while it works.
#[derive(Clone, Debug, Default)]
pub(crate) struct Faults(Arc<Mutex<Option<Fault>>>);

impl Faults {
    /// Notes a fault, unless there is one already.
    pub(crate) fn note(&self, fault: Fault) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(fault);
    }

    pub(crate) fn first(&self) -> Option<Fault> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// An error if the card has a fault.
    pub(crate) fn check(&self) -> Result<(), Fault> {
        self.first().map_or(Ok(()), Err)
    }
}
