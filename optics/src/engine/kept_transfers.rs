//! Exact transfer functions that are kept from one judgement to the next.

use super::convolution::Transfer;
use crate::display::OpticalSetup;
use std::fmt::Debug;
use std::sync::Arc;

/// Keeps transfer functions to places in the pixels of setups, as far as there is memory. A place (x, y) is from the centre
/// of a pixel \[px\], and stands for its mirror images, too.
pub(crate) trait KeptTransfers<T>: Debug + Send + Sync {
    /// The transfer function, if it was kept.
    fn find(&self, setup: &OpticalSetup, place_px: [f64; 2]) -> Option<Arc<Transfer<T>>>;

    /// Keeps a transfer function.
    fn keep(&self, setup: &OpticalSetup, place_px: [f64; 2], transfer: &Arc<Transfer<T>>);
}
