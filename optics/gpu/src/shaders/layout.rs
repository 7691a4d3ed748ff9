//! Where the values of a half-transformed field lie.
//!
//! A block of `tile_rows` rows and `tile_columns` columns is contiguous, so that the passes over rows and those over
//! columns both read whole sectors of memory.

use super::transform::{Held, Transform};

/// Sizes that all shaders of a problem share.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Layout {
    pub(crate) height_px: usize,
    pub(crate) width_px: usize,
    pub(crate) rows: Transform,
    pub(crate) columns: Transform,
}

/// Rows of a block. With more, the passes over columns gain little and those over rows lose.
const TILE_ROWS: usize = 6;

impl Layout {
    /// Number of values of a half-transformed field, with whole blocks of rows.
    pub(crate) fn lane_len(&self) -> usize {
        self.height_px.next_multiple_of(TILE_ROWS) * 2 * self.width_px
    }

    /// Number of workgroups of a pass over columns.
    pub(crate) fn column_groups(&self) -> usize {
        2 * self.width_px / self.columns.columns
    }

    /// Function `at(y, x)`: the index of row y and bin x in a field.
    pub(crate) fn text(&self) -> String {
        let (rows, columns, blocks) = (TILE_ROWS, self.columns.columns, self.column_groups());
        format!(
            "\nfn at(y: u32, x: u32) -> u32 {{\n  return ((y / {rows}u) * {blocks}u + x / {columns}u) * {0}u + \
             (y % {rows}u) * {columns}u + x % {columns}u;\n}}\n",
            rows * columns
        )
    }

    /// Index of a value of a column.
    pub(crate) fn in_column(&self, held: &Held) -> String {
        let n = self.columns.plan.butterflies(0);
        if n.is_multiple_of(TILE_ROWS) {
            return format!("at({}, x) + {}u", held.base, held.offset * 2 * self.width_px);
        }
        format!("at({}, x)", held.place())
    }

    /// Index of a bin of a row, in the half `half` of the bins.
    pub(crate) fn in_row(&self, held: &Held) -> String {
        let last = self.rows.plan.radices.len() - 1;
        let w = self.width_px;
        if self.rows.plan.butterflies(last).is_multiple_of(self.columns.columns) {
            return format!("at(y, half * {w}u + {}) + {}u", held.base, held.offset * TILE_ROWS);
        }
        format!("at(y, half * {w}u + {})", held.place())
    }

    /// Index of a bin of a column in a transfer function.
    pub(crate) fn in_transfer(&self, held: &Held) -> String {
        let (h, c) = (self.height_px, self.columns.columns);
        format!("((group.x * 2u + half) * {h}u + {}) * {c}u + cc", held.place())
    }

    /// The same index, on the processor, for column x and bin k of a half.
    pub(crate) fn transfer_index(&self, x: usize, half: usize, k: usize) -> usize {
        let c = self.columns.columns;
        ((x / c * 2 + half) * self.height_px + k) * c + x % c
    }
}
