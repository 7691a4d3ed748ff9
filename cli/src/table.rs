//! Text tables with aligned columns, and lists of facts. On a terminal both are fitted to its width.

use super::{show, terminal};

/// Characters between two columns.
const GAP: usize = 2;
/// Narrowest width of a column that is cut, as long as other columns can be left out instead \[characters\].
const CUT_MIN: usize = 14;
/// The same for a column whose texts are wrapped.
const WRAPPED_MIN: usize = 28;
/// Narrowest width of a column that is cut or wrapped \[characters\].
const LEAST: usize = 8;

/// A table with a title row.
///
/// Marks around a title say how its column behaves. `>` before it: the cells are aligned to the right. After it, for
/// terminals that are too narrow: `~`, the cells may be cut; `_`, the cells may be wrapped into several lines; `?`, the
/// column may be left out. Columns with more `?` are left out first, and of those with equally many the right ones.
/// Columns without marks, such as ids, are always whole.
#[derive(Debug)]
pub(crate) struct Table {
    columns: Vec<Column>,
    rows: Vec<Vec<String>>,
}

#[derive(Debug)]
struct Column {
    title: String,
    is_right: bool,
    fit: Fit,
    /// How readily the column is left out; 0: never.
    expendable: usize,
}

/// What happens to the cells of a column on a narrow terminal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fit {
    Whole,
    Cut,
    Wrapped,
}

impl Column {
    fn new(marked: &str) -> Self {
        let title = marked.trim_start_matches('>').trim_end_matches(['?', '~', '_']);
        let marks = &marked[marked.trim_end_matches(['?', '~', '_']).len()..];
        let fit = match (marks.contains('~'), marks.contains('_')) {
            (true, _) => Fit::Cut,
            (_, true) => Fit::Wrapped,
            _ => Fit::Whole,
        };
        let expendable = marks.matches('?').count();
        Self { title: title.to_uppercase(), is_right: marked.starts_with('>'), fit, expendable }
    }
}

impl Table {
    /// A table with these titles, with `|` between them.
    pub(crate) fn new(titles: &str) -> Self {
        let columns: Vec<Column> = titles.split('|').map(Column::new).collect();
        let titles = columns.iter().map(|column| column.title.clone()).collect();
        Self { columns, rows: vec![titles] }
    }

    pub(crate) fn row<const COLUMNS: usize>(&mut self, cells: [String; COLUMNS]) {
        debug_assert_eq!(COLUMNS, self.columns.len(), "a row has a cell for each column");
        // A control character of somebody else's text must not reach the terminal.
        self.rows.push(cells.map(|cell| show::plain(&cell)).into());
    }

    /// The lines of the table, or the line `empty` if the table has no rows.
    pub(crate) fn text_or(&self, empty: &str) -> String {
        if self.rows.len() == 1 { format!("{empty}\n") } else { self.text() }
    }

    /// The lines of the table, fitted to the terminal.
    pub(crate) fn text(&self) -> String {
        self.text_within(terminal::columns().unwrap_or(usize::MAX))
    }

    /// The lines of the table, fitted to a width \[characters\]. They are longer only if whole columns need more.
    pub(crate) fn text_within(&self, columns: usize) -> String {
        let (shown, widths) = self.layout(columns);
        let mut text = String::new();
        for row in &self.rows {
            let cells: Vec<Vec<String>> =
                shown.iter().zip(&widths).map(|(&c, &width)| fitted(&row[c], width, self.columns[c].fit)).collect();
            let height = cells.iter().map(Vec::len).max().unwrap_or(0);
            for line in 0..height {
                let parts = shown.iter().zip(&widths).zip(&cells).map(|((&c, &width), lines)| {
                    let cell = lines.get(line).map_or("", String::as_str);
                    if self.columns[c].is_right { format!("{cell:>width$}") } else { format!("{cell:<width$}") }
                });
                text.push_str(parts.collect::<Vec<_>>().join(&" ".repeat(GAP)).trim_end());
                text.push('\n');
            }
        }
        text
    }

    /// The columns that are shown and their widths.
    fn layout(&self, columns: usize) -> (Vec<usize>, Vec<usize>) {
        let mut shown: Vec<usize> = (0..self.columns.len()).collect();
        loop {
            let widths = self.widths(&shown, columns, CUT_MIN, WRAPPED_MIN);
            if total(&widths) <= columns {
                return (shown, widths);
            }
            let next = shown.iter().rposition(|&c| {
                let most = shown.iter().map(|&c| self.columns[c].expendable).max().unwrap_or(0);
                most > 0 && self.columns[c].expendable == most
            });
            match next {
                Some(position) => drop(shown.remove(position)),
                None => return (shown.clone(), self.widths(&shown, columns, LEAST, LEAST)),
            }
        }
    }

    /// Widths of columns. Those that may be cut or wrapped are as narrow as necessary, but not below the given widths.
    fn widths(&self, shown: &[usize], columns: usize, cut_min: usize, wrapped_min: usize) -> Vec<usize> {
        let natural = |&c: &usize| self.rows.iter().map(|row| row[c].chars().count()).max().unwrap_or(0);
        let mut widths: Vec<usize> = shown.iter().map(natural).collect();
        for (fit, least) in [(Fit::Wrapped, wrapped_min), (Fit::Cut, cut_min)] {
            // The widest of them gives way first.
            while total(&widths) > columns {
                let flexible = (0..shown.len()).filter(|&i| self.columns[shown[i]].fit == fit && widths[i] > least);
                let Some(widest) = flexible.max_by_key(|&i| widths[i]) else { break };
                widths[widest] -= 1;
            }
        }
        widths
    }
}

fn total(widths: &[usize]) -> usize {
    widths.iter().sum::<usize>() + GAP * widths.len().saturating_sub(1)
}

/// The lines of a cell.
fn fitted(cell: &str, width: usize, fit: Fit) -> Vec<String> {
    if cell.chars().count() <= width {
        return vec![cell.to_owned()];
    }
    match fit {
        Fit::Whole => vec![cell.to_owned()],
        Fit::Cut => vec![cell.chars().take(width.saturating_sub(1)).chain(['…']).collect()],
        Fit::Wrapped => wrapped(cell, width),
    }
}

/// Lines of at most this width. Only longer words make longer lines.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// A text that is indented by two characters and wrapped at the width of the terminal, further lines by four.
pub(crate) fn indented(text: &str) -> String {
    let columns = terminal::columns().unwrap_or(usize::MAX);
    let lines = wrapped(text, columns.saturating_sub(4).max(LEAST));
    lines.iter().enumerate().map(|(i, line)| format!("{}{line}\n", if i == 0 { "  " } else { "    " })).collect()
}

/// Lines with a name and a value each. The values are aligned, also the further lines of a value, so that none looks like
/// another fact.
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

    /// The lines, with values wrapped at the width of the terminal.
    pub(crate) fn text(&self) -> String {
        self.text_within(terminal::columns().unwrap_or(usize::MAX))
    }

    fn text_within(&self, columns: usize) -> String {
        let width = self.facts.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
        let room = columns.saturating_sub(width + GAP).max(LEAST);
        let mut text = String::new();
        for (name, value) in &self.facts {
            let lines: Vec<String> = show::plain_lines(value)
                .split('\n')
                .flat_map(|line| if line.chars().count() > room { wrapped(line, room) } else { vec![line.to_owned()] })
                .collect();
            for (i, line) in lines.iter().enumerate() {
                let name = if i == 0 { name.as_str() } else { "" };
                text.push_str(format!("{name:<width$}  {line}").trim_end());
                text.push('\n');
            }
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_columns_are_aligned() {
        let mut table = Table::new("display|>pitch|notes~?");
        table.row(["lab-2".into(), "8 µm".into(), "by the window".into()]);
        table.row(["a".into(), "3.74 µm".into(), String::new()]);
        let lines = ["DISPLAY    PITCH  NOTES", "lab-2       8 µm  by the window", "a        3.74 µm", ""];
        assert_eq!(table.text(), lines.join("\n"));
        assert_eq!(Table::new("display").text_or("no displays"), "no displays\n");
    }

    #[test]
    fn texts_of_others_change_neither_terminal_nor_facts() {
        let mut table = Table::new("display|notes");
        table.row(["lab".into(), "a\u{1b}[2J\u{202e}b\nc".into()]);
        assert_eq!(table.text(), "DISPLAY  NOTES\nlab      a\u{fffd}[2J\u{fffd}b\u{fffd}c\n");
        let mut facts = Facts::default();
        facts.add("notes", "first\nowner  ada\u{1b}[1A");
        assert_eq!(facts.text(), "notes  first\n       owner  ada\u{fffd}[1A\n", "no line looks like another fact");
    }

    #[test]
    fn narrow_tables_cut_texts_and_leave_out_columns_but_keep_ids() {
        let id = "01939a5e-7c1b-7d52-9b7e-0d6f3a1c2b4e";
        let mut table = Table::new("job|target~|state|>tries??|kind?");
        table.row([id, "a_photograph_of_the_old_town.png", "succeeded", "1", "hologram"].map(Into::into));
        let lines = |width| table.text_within(width).lines().map(str::to_owned).collect::<Vec<_>>();
        assert!(lines(110)[1].ends_with("old_town.png  succeeded      1  hologram"), "{:?}", lines(110));
        assert_eq!(lines(88)[1], format!("{id}  a_photograph_of_the_o…  succeeded      1  hologram"));
        assert_eq!(lines(78)[0].split_whitespace().collect::<Vec<_>>(), ["JOB", "TARGET", "STATE", "KIND"]);
        assert_eq!(lines(65)[1], format!("{id}  a_photograph_of…  succeeded"));
        assert_eq!(lines(60)[1], format!("{id}  a_photogra…  succeeded"));
        assert_eq!(lines(20)[1], format!("{id}  a_photo…  succeeded"));
        for width in 57..120 {
            assert!(lines(width).iter().all(|line| line.chars().count() <= width), "{width}");
        }
    }

    #[test]
    fn long_texts_are_wrapped_between_words() {
        let mut table = Table::new("check|finding_");
        table.row(["passed".into(), "it has less loss than the active version on twelve pairs".into()]);
        let text = table.text_within(40);
        assert!(text.lines().count() == 3 && text.lines().all(|line| line.chars().count() <= 40), "{text}");
        assert_eq!(text.lines().nth(2), Some("        version on twelve pairs"));
        let mut facts = Facts::default();
        facts.add("saved", "holograms/eye.png, holograms/sky.png, holograms/sea.png");
        facts.add("job", "1");
        let text = facts.text_within(30);
        assert_eq!(text, "saved  holograms/eye.png,\n       holograms/sky.png,\n       holograms/sea.png\njob    1\n");
    }
}
