//! The terminal: its width, to which tables are fitted.

use std::io::{self, IsTerminal as _};
use std::sync::OnceLock;

/// Narrowest terminal that tables are fitted to \[characters\]: below it, ids would fill the lines.
const COLUMNS_MIN: usize = 40;

static COLUMNS: OnceLock<Option<usize>> = OnceLock::new();

/// Measures the width of the terminal. Until then, [`columns`] is unlimited.
pub(crate) fn measure() {
    let stdout = io::stdout();
    let width = stdout.is_terminal().then(|| terminal_size::terminal_size_of(stdout)).flatten();
    let columns = width.map(|(width, _)| usize::from(width.0)).filter(|columns| *columns > 0);
    // A second measurement would find the same.
    let _ = COLUMNS.set(columns.map(|columns| columns.max(COLUMNS_MIN)));
}

/// Width of the terminal \[characters\]; `None` for a pipe or a file, whose lines have no limit.
pub(crate) fn columns() -> Option<usize> {
    COLUMNS.get().copied().flatten()
}
