//! Blocks of the display model: parts that only some displays need.
//!
//! Learning tries each block when the simpler model is fitted, and keeps it if it lowers the validation loss by at least
//! [`GAIN_MIN`].

use super::KernelModel;
use super::layout::FINE_SOURCE_ORDER;
use crate::DisplayModel;
use serde::{Deserialize, Serialize};

/// Least relative decrease of the validation loss by which a block is kept. Each block makes learning or every hologram
/// more expensive.
pub(super) const GAIN_MIN: f64 = 0.1;

/// Most fits of `refinement_evaluations` evaluations that learning takes: one over all orders, and one for each trial of
/// a block. n blocks take up to n(n + 1)/2 trials, because those refused are tried again after each that is kept.
pub(super) fn fits_max(model: KernelModel) -> u32 {
    let (last, first): (Vec<Block>, Vec<Block>) =
        Block::ALL.into_iter().filter(|block| block.belongs_to(model)).partition(|&block| block == Block::Varying);
    (1 + first.len() * (first.len() + 1) / 2 + last.len()) as u32
}

/// A part of the display model that only some displays need.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Block {
    /// A source profile of order 10 instead of 4, for the uneven surface of a modulator.
    FineSource,
    /// A kernel that [varies over the SLM](crate::SpatialVariation).
    Varying,
}

impl Block {
    /// All blocks.
    pub const ALL: [Self; 2] = [Self::FineSource, Self::Varying];

    /// Name of the block in lower case, as it is stored.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::FineSource => "fine_source",
            Self::Varying => "varying",
        }
    }

    /// Whether validation pairs may choose the block in a fit of `model`.
    pub(super) fn belongs_to(self, model: KernelModel) -> bool {
        match self {
            Self::FineSource => matches!(model, KernelModel::Display | KernelModel::Varying),
            Self::Varying => model == KernelModel::Varying,
        }
    }
}

/// A set of blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Blocks {
    /// [`Block::FineSource`]
    pub fine_source: bool,
    /// [`Block::Varying`]
    pub varying: bool,
}

impl Blocks {
    /// No block.
    pub const NONE: Self = Self { fine_source: false, varying: false };

    /// All blocks.
    pub const ALL: Self = Self { fine_source: true, varying: true };

    /// The blocks that a display model has.
    #[must_use]
    pub fn of(model: &DisplayModel) -> Self {
        Self { fine_source: model.source.order >= FINE_SOURCE_ORDER, varying: !model.variation.is_none() }
    }

    /// Whether the set has a block.
    #[must_use]
    pub fn contains(mut self, block: Block) -> bool {
        *self.place(block)
    }

    /// The set with one more block.
    #[must_use]
    pub fn with(mut self, block: Block) -> Self {
        *self.place(block) = true;
        self
    }

    /// The set without a block.
    #[must_use]
    pub fn without(mut self, block: Block) -> Self {
        *self.place(block) = false;
        self
    }

    /// The blocks of the set, in the order of [`Block::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Block> {
        Block::ALL.into_iter().filter(move |&block| self.contains(block))
    }

    fn place(&mut self, block: Block) -> &mut bool {
        match block {
            Block::FineSource => &mut self.fine_source,
            Block::Varying => &mut self.varying,
        }
    }
}
