//! On which terms each [`Block`] is tried and kept. Each block makes learning or every hologram more expensive.

use crate::learning::blocks::Block;

/// Least relative decrease of the validation loss by which a block is kept.
const GAIN_MIN: f64 = 0.1;
/// [`GAIN_MIN`] before all blocks have been tried.
const FIRST_GAIN_MIN: f64 = 0.05;
/// [`GAIN_MIN`] of [`Block::Dust`], which makes a kernel of some kilobytes one of megabytes.
const DUST_GAIN_MIN: f64 = 0.2;
/// [`GAIN_MIN`] of [`Block::PartialCoherence`], which makes every hologram three times as expensive.
const COHERENCE_GAIN_MIN: f64 = 0.3;
/// [`GAIN_MIN`] of [`Block::LightBlur`]. The sub-samples of a pixel stand for its integral to 2 % of the light's
/// variation, and a small blur mends some of that: on a display without a flaw it lowers the loss by a fifth.
const LIGHT_BLUR_GAIN_MIN: f64 = 0.3;

/// When a block is tried, and when it is kept.
#[derive(Clone, Copy, Debug)]
pub(super) struct Terms {
    pub(super) turn: Turn,
    /// Least relative decrease of the validation loss by which the block is kept.
    pub(super) gain_min: f64,
    /// [`Self::gain_min`] before all blocks have been tried.
    pub(super) first_gain_min: f64,
    /// A block beside which this one is not tried: together they take too many transfer functions.
    pub(super) never_beside: Option<Block>,
    /// For a block that is dear to try.
    pub(super) dear: Option<Dear>,
}

/// When a block is tried for the first time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
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
pub(super) struct Dear {
    /// Least part of the decrease with which the trial passes that it must have reached after one step.
    pub(super) hopeful: f64,
    /// A block that starts anew in the trial, because this one may describe better what it describes.
    pub(super) replaces: Block,
    /// Validation loss, relative to that before, above which a trial ends after one step that starts without the block
    /// it may replace.
    pub(super) loss_max: f64,
}

impl Block {
    /// On which terms the block is tried and kept.
    pub(super) fn terms(self) -> Terms {
        let with =
            |turn, first_gain_min, gain_min| Terms { turn, gain_min, first_gain_min, never_beside: None, dear: None };
        match self {
            Self::FineSource | Self::Crosstalk | Self::UnevenResponse => with(Turn::First, FIRST_GAIN_MIN, GAIN_MIN),
            Self::LightBlur => with(Turn::First, LIGHT_BLUR_GAIN_MIN, LIGHT_BLUR_GAIN_MIN),
            Self::PartialCoherence => Terms {
                dear: Some(Dear { hopeful: 1.0 / 3.0, replaces: Self::LightBlur, loss_max: 1.25 }),
                ..with(Turn::First, COHERENCE_GAIN_MIN, COHERENCE_GAIN_MIN)
            },
            Self::Varying => {
                Terms { never_beside: Some(Self::PartialCoherence), ..with(Turn::Last, GAIN_MIN, GAIN_MIN) }
            }
            Self::Ghost => with(Turn::Last, GAIN_MIN, GAIN_MIN),
            Self::Dust => with(Turn::OwnFit, DUST_GAIN_MIN, DUST_GAIN_MIN),
        }
    }
}
