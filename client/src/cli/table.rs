//! Text tables with aligned columns.

/// A table with a title row. Columns whose title starts with `>` are aligned to the right.
#[derive(Debug)]
pub(crate) struct Table {
    rows: Vec<Vec<String>>,
    /// True for each column that is aligned to the right.
    right: Vec<bool>,
}

impl Table {
    pub(crate) fn new(titles: &[&str]) -> Self {
        let title = |title: &&str| title.trim_start_matches('>').to_uppercase();
        let right = titles.iter().map(|title| title.starts_with('>')).collect();
        Self { rows: vec![titles.iter().map(title).collect()], right }
    }

    pub(crate) fn row<const COLUMNS: usize>(&mut self, cells: [String; COLUMNS]) {
        debug_assert_eq!(COLUMNS, self.right.len(), "a row has a cell for each column");
        // A control character of somebody else's text must not reach the terminal.
        let plain = |cell: String| cell.replace(char::is_control, "\u{fffd}");
        self.rows.push(cells.map(plain).into());
    }

    /// The lines of the table, or the line `empty` if the table has no rows.
    pub(crate) fn text_or(&self, empty: &str) -> String {
        if self.rows.len() == 1 { format!("{empty}\n") } else { self.text() }
    }

    /// The lines of the table.
    pub(crate) fn text(&self) -> String {
        let width = |column: usize| self.rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.right.len()).map(width).collect();
        let mut text = String::new();
        for row in &self.rows {
            let cells = row.iter().zip(&widths).zip(&self.right).map(|((cell, &width), &right)| {
                if right { format!("{cell:>width$}") } else { format!("{cell:<width$}") }
            });
            text.push_str(cells.collect::<Vec<_>>().join("  ").trim_end());
            text.push('\n');
        }
        text
    }
}

/// Lines with a name and a value each. The values are aligned.
#[derive(Debug, Default)]
pub(crate) struct Facts {
    facts: Vec<(String, String)>,
}

impl Facts {
    pub(crate) fn add(&mut self, name: &str, value: impl Into<String>) {
        self.facts.push((name.to_owned(), value.into()));
    }

    /// Adds a line if its value is known.
    pub(crate) fn add_some(&mut self, name: &str, value: Option<String>) {
        if let Some(value) = value {
            self.add(name, value);
        }
    }

    pub(crate) fn text(&self) -> String {
        let width = self.facts.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
        let line = |(name, value): &(String, String)| format!("{name:<width$}  {value}\n");
        self.facts.iter().map(line).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_columns_are_aligned() {
        let mut table = Table::new(&["display", ">pitch", "notes"]);
        table.row(["lab-2".into(), "8 µm".into(), "by the window".into()]);
        table.row(["a".into(), "3.74 µm".into(), String::new()]);
        let lines = ["DISPLAY    PITCH  NOTES", "lab-2       8 µm  by the window", "a        3.74 µm", ""];
        assert_eq!(table.text(), lines.join("\n"));
        assert_eq!(Table::new(&["display"]).text_or("no displays"), "no displays\n");
    }
}
