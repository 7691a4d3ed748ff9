//! On which terms each [`Block`] is tried and kept. Each block makes learning or every hologram more expensive.

use super::Block;

/// Least relative decrease of the validation loss by which a block is kept.
pub(super) const GAIN_MIN: f64 = 0.1;
/// [`GAIN_MIN`] before all blocks have been tried.
const FIRST_GAIN_MIN: f64 = 0.05;

/// When a block is tried, and when it is kept.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Terms {
    pub(crate) turn: Turn,
    /// Least relative decrease of the validation loss by which the block is kept.
    pub(crate) gain_min: f64,
    /// [`Self::gain_min`] before all blocks have been tried.
    pub(crate) first_gain_min: f64,
    /// A block beside which this one is not tried: together they take too many transfer functions.
    pub(crate) never_beside: Option<Block>,
    /// For a block that is dear to try.
    pub(crate) dear: Option<Dear>,
}

/// When a block is tried for the first time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Turn {
    /// At the lowest order of the kernel.
    First,
    /// After the highest order: its light is little beside what the others change.
    Last,
    /// In a fit of its own.
    OwnFit,
}

/// A block whose steps take several times as long as those of other trials, and which describes a part of what others
/// describe. It waits until no other block of a round has helped, and its trial ends after one step if that helped
/// little.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Dear {
    /// Least part of the decrease with which the trial passes that it must have reached after one step.
    pub(crate) hopeful: f64,
    /// A block that starts anew in the trial, because this one may describe better what it describes.
    pub(crate) replaces: Block,
    /// Validation loss, relative to that before, above which a trial ends after one step that starts without the block
    /// it may replace.
    pub(crate) loss_max: f64,
}

impl Terms {
    /// Terms of a block without further conditions.
    pub(super) const fn new(turn: Turn, first_gain_min: f64, gain_min: f64) -> Self {
        Self { turn, gain_min, first_gain_min, never_beside: None, dear: None }
    }

    /// Terms of a block that changes much of the light.
    pub(super) const USUAL: Self = Self::new(Turn::First, FIRST_GAIN_MIN, GAIN_MIN);
}

impl Block {
    /// On which terms the block is tried and kept.
    pub(crate) fn terms(self) -> Terms {
        self.part().row().terms().unwrap_or(Terms::USUAL)
    }
}
