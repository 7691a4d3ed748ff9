//! Sets of [blocks](Block): parts that only some displays need.

use super::Block;
use crate::display::DisplayModel;
use serde::{Deserialize, Serialize};

impl Block {
    /// Name of the block in lower case, as it is stored.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.part().row().block_name()
    }
}

/// A set of blocks: whether it has each of [`Block::ALL`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Blocks([bool; Block::ALL.len()]);

impl Blocks {
    /// No block.
    pub const NONE: Self = Self([false; Block::ALL.len()]);
    /// All blocks.
    pub const ALL: Self = Self([true; Block::ALL.len()]);

    /// The blocks that a display model has.
    #[must_use]
    pub fn of(model: &DisplayModel) -> Self {
        Self(Block::ALL.map(|block| block.part().row().has_block(model)))
    }

    /// Whether the set has a block.
    #[must_use]
    pub const fn contains(self, block: Block) -> bool {
        self.0[block as usize]
    }

    /// The set with one more block.
    #[must_use]
    pub const fn with(mut self, block: Block) -> Self {
        self.0[block as usize] = true;
        self
    }

    /// The set without a block.
    #[must_use]
    pub const fn without(mut self, block: Block) -> Self {
        self.0[block as usize] = false;
        self
    }

    /// The set with those blocks besides that a display can have without photographs showing them.
    #[must_use]
    pub fn with_hidden(self) -> Self {
        Block::ALL.into_iter().filter(|block| block.part().row().hidden().is_some()).fold(self, Self::with)
    }

    /// The blocks of the set, in the order of [`Block::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Block> {
        Block::ALL.into_iter().filter(move |&block| self.contains(block))
    }
}
