//! A model as the course knows it.

use crate::display::parts::blocks::Blocks;
use serde::{Deserialize, Serialize};

/// A model whose validation loss is known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::learning) struct Model {
    /// Number by which whoever fits finds its parameters.
    pub(in crate::learning) number: usize,
    /// Order of the kernel.
    pub(in crate::learning) order: usize,
    /// Blocks of the model, beside dust.
    pub(in crate::learning) blocks: Blocks,
    /// Loss on the validation pairs.
    pub(in crate::learning) loss: f64,
}
