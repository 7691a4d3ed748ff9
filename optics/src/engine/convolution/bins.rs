//! The order of columns and of frequencies in half-transformed fields.

/// Number of columns in a tile. A row of a tile fills whole cache lines and whole registers, and a tile's spectra fit
/// into a core's second-level cache.
pub(crate) fn tile_columns<T>(height_px: usize) -> usize {
    if height_px * size_of::<T>() <= 1280 * size_of::<f32>() { 32 } else { 16 }
}

/// Number of columns of a padded spectrum, rounded up to whole tiles.
pub(crate) fn padded_columns(width_px: usize, tile_columns: usize) -> usize {
    (2 * width_px).next_multiple_of(tile_columns)
}

/// Padded bin, 0 … 2n−1, at index `i` of the split order, which lists the even bins first and then the odd bins.
pub(crate) fn split_bin(i: usize, n: usize) -> usize {
    if i < n { 2 * i } else { 2 * (i - n) + 1 }
}

/// Index in the split order of the bin with the opposite frequency.
pub(super) fn opposite_index(i: usize, n: usize) -> usize {
    if i < n { (n - i) % n } else { 3 * n - 1 - i }
}

/// Frequency \[cycles/px\] of the padded bin `bin`, 0 … 2n−1.
pub(crate) fn frequency_per_px(bin: usize, n: usize) -> f64 {
    crate::numerics::grid::frequency(bin, 2 * n, 1.0)
}

/// Frequencies \[cycles/px\] of the 2n padded bins in split order.
pub(crate) fn frequencies(n: usize) -> Vec<f64> {
    (0..2 * n).map(|i| frequency_per_px(split_bin(i, n), n)).collect()
}
