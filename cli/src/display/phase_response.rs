//! The text file with the measured phase of each grey level.
//!
//! A line has the phase of a level, or a level and its phase. Lines of text before the first number are the heading. It
//! may name the unit of the phases; without one they are radians, and the server asks about numbers that cannot be.

use crate::failure::Failure;
use crate::inputs;
use std::collections::BTreeSet;
use std::f64::consts::{PI, TAU};
use std::path::Path;

/// Words of headings, each with its unit.
const UNITS: [(&str, Unit); 13] = [
    ("rad", Unit::Radians),
    ("rads", Unit::Radians),
    ("radian", Unit::Radians),
    ("radians", Unit::Radians),
    ("deg", Unit::Degrees),
    ("degree", Unit::Degrees),
    ("degrees", Unit::Degrees),
    ("°", Unit::Degrees),
    ("pi", Unit::Pi),
    ("π", Unit::Pi),
    ("waves", Unit::Turns),
    ("turns", Unit::Turns),
    ("2π", Unit::Turns),
];

/// A unit of phases.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Unit {
    Radians,
    Degrees,
    Pi,
    Turns,
}

impl Unit {
    fn rad(self) -> f64 {
        match self {
            Self::Radians => 1.0,
            Self::Degrees => PI / 180.0,
            Self::Pi => PI,
            Self::Turns => TAU,
        }
    }
}

/// Reads the phase of each level \[rad\].
pub(super) fn read(path: &Path) -> Result<Vec<f64>, Failure> {
    let text = inputs::text(path)?;
    parse(&text).map_err(|problem| Failure::Usage(format!("{}{problem}", path.display())))
}

/// A line of numbers.
struct Row {
    line: usize,
    numbers: Vec<f64>,
}

fn parse(text: &str) -> Result<Vec<f64>, String> {
    let lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
    let (mut heading, mut rows) = (String::new(), Vec::<Row>::new());
    for (number, line) in lines.filter(|(_, line)| !line.is_empty()) {
        match numbers(line) {
            Some(numbers) => rows.push(Row { line: number, numbers }),
            None if rows.is_empty() => heading = format!("{heading}{line}\n"),
            None if line.starts_with('#') => {}
            None => {
                return Err(format!(
                    ", line {number}: \"{line}\" must be a number of radians, such as 1.5708, or a level and its phase"
                ));
            }
        }
    }
    let unit = unit(&heading).map_err(|problem| format!(": {problem}"))?;
    Ok(phases(&rows)?.into_iter().map(|phase| phase * unit.rad()).collect())
}

/// The numbers of a line; `None` for a line of text.
fn numbers(line: &str) -> Option<Vec<f64>> {
    let cells = line.split(|c: char| c.is_whitespace() || c == ',' || c == ';').filter(|cell| !cell.is_empty());
    cells.map(|cell| cell.parse().ok()).collect()
}

/// The phases of rows with one column, or with a column of levels and one of phases.
fn phases(rows: &[Row]) -> Result<Vec<f64>, String> {
    let columns = rows.first().map_or(1, |row| row.numbers.len());
    if let Some(Row { line, numbers }) = rows.iter().find(|row| row.numbers.len() != columns) {
        let count = numbers.len();
        return Err(format!(", line {line}: the line has {count} numbers, but the first has {columns}; {COMMA}"));
    }
    if columns > 2 {
        let line = rows[0].line;
        return Err(format!(
            ", line {line}: the line has {columns} numbers; give one, the phase of a level, or two, a level and its \
             phase; {COMMA}"
        ));
    }
    if columns == 2 {
        require_levels(rows)?;
    }
    Ok(rows.iter().filter_map(|row| row.numbers.last().copied()).collect())
}

/// What to do if a comma was taken for the end of a number.
const COMMA: &str = "write decimals with a point, not with a comma";

/// Checks that the first column counts the levels.
fn require_levels(rows: &[Row]) -> Result<(), String> {
    match rows.iter().zip(0_u32..).find(|(row, level)| row.numbers[0] != f64::from(*level)) {
        None => Ok(()),
        Some((Row { line, numbers }, level)) => Err(format!(
            ", line {line}: of two columns the first must count the levels, 0, 1, 2 …, and the second has their phases, \
             but here is {} instead of level {level}; if there are several phases for a level, or levels without one, \
             give one phase for each level; {COMMA}",
            numbers[0]
        )),
    }
}

/// What stands before a unit, as in "phase (rad)", "phase / pi", "phase in deg", "unit: waves".
const BEFORE_A_UNIT: [&str; 9] = ["(", "[", "/", "in", "phase", ":", "=", "_", "-"];

/// The unit that a heading names: radians if it names none. A word that may mean something else, such as the pi of another
/// word, names a unit only where units stand.
fn unit(heading: &str) -> Result<Unit, String> {
    let (mut placed, mut has_loose) = (BTreeSet::new(), false);
    for line in heading.lines() {
        let tokens = tokens(line);
        let words = tokens.iter().filter(|token| token.chars().all(char::is_alphanumeric)).count();
        let mut before: Option<&str> = None;
        for token in &tokens {
            let named = UNITS.iter().find(|(name, _)| *name == token.as_str()).map(|(_, unit)| *unit);
            match named {
                // "π rad" is one unit.
                Some(Unit::Radians) if before.is_some_and(is_pi) => {}
                Some(unit) if words <= 1 || before.is_some_and(|token| BEFORE_A_UNIT.contains(&token)) => {
                    placed.insert(unit);
                }
                Some(_) => has_loose = true,
                None => {}
            }
            before = Some(token.as_str());
        }
    }
    let placed: Vec<Unit> = placed.into_iter().collect();
    match placed[..] {
        [unit] => Ok(unit),
        [] if !has_loose => Ok(Unit::Radians),
        _ => Err(format!(
            "the unit of the phases is not clear from the heading \"{}\"; write it in brackets: phase (rad), phase (deg), \
             phase (pi) or phase (waves)",
            heading.trim()
        )),
    }
}

fn is_pi(token: &str) -> bool {
    UNITS.iter().any(|(name, unit)| *name == token && *unit == Unit::Pi)
}

/// The words of a line in small letters, and each other character by itself, without what marks a comment.
fn tokens(line: &str) -> Vec<String> {
    let text = line.trim_start_matches(['#', ' ']).to_lowercase().replace("2pi", "2π");
    let apart = |c: char| if c.is_alphanumeric() { c.to_string() } else { format!(" {c} ") };
    text.chars().map(apart).collect::<String>().split_whitespace().map(str::to_owned).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn accepted(text: &str) -> Vec<f64> {
        parse(text).unwrap_or_else(|problem| panic!("{text:?}{problem}"))
    }

    fn refused(text: &str) -> String {
        match parse(text) {
            Ok(phases) => panic!("{text:?} was read as {phases:?}"),
            Err(problem) => problem,
        }
    }

    #[test]
    fn a_line_has_a_phase_or_a_level_and_its_phase() {
        let expected = [0.0, 1.5, 3.1];
        for text in [
            "# radians\n0\n1.5\n\n 3.1 \n",
            "0 0.0\n1 1.5\n2 3.1\n",
            "0,0.0\r\n1,1.5\r\n2,3.1\r\n",
            "0; 0.0\n1; 1.5\n# the end\n2; 3.1\n",
            "0\t0.0\n1\t1.5\n2\t3.1",
            "Gray level,Phase (rad)\n0,0.0\n1,1.5\n2,3.1\n",
            "SLM 4711 at 515 nm\nlevel\tphase\n0\t0.0\n1\t1.5\n2\t3.1\n",
        ] {
            assert_eq!(accepted(text), expected, "{text:?}");
        }
    }

    #[test]
    fn headings_name_the_unit() {
        for (heading, second) in [
            ("level phase[deg]", "90"),
            ("Phase (°)", "90"),
            ("# Phase in degrees", "90"),
            ("phase / pi", "0.5"),
            ("Phase [π rad]", "0.5"),
            ("phase (waves)", "0.25"),
            ("phase/2π", "0.25"),
            ("φ", "1.5707963267948966"),
            ("# radians", "1.5707963267948966"),
            ("phase (rad), 0 to 2pi", "1.5707963267948966"),
            ("# made from degrees by hand\n# radians", "1.5707963267948966"),
            ("phase_deg", "90"),
            ("unit: waves", "0.25"),
        ] {
            let phases = accepted(&format!("{heading}\n0\n{second}\n"));
            assert!((phases[1] - PI / 2.0).abs() < 1e-12, "{heading}: {phases:?}");
        }
        for heading in [
            "# Raspberry Pi camera",
            "# LUT, 2π at 515 nm",
            "Phase, 0 to 2pi",
            "# polarizer at 45 deg",
            "PI stage, rad",
            "phase (rad), phase (deg)",
        ] {
            assert!(refused(&format!("{heading}\n0\n1\n")).contains("is not clear"), "{heading}");
        }
    }

    #[test]
    fn tables_that_can_be_read_in_two_ways_are_refused() {
        for (text, sign) in [
            ("0\n1,5\n", ", line 2: the line has 2 numbers, but the first has 1; write decimals with a point"),
            ("0,0\n0,5\n", ", line 2: of two columns the first must count the levels"),
            ("0,0\n0,5\n", "but here is 0 instead of level 1"),
            ("0 0\n8 1.5\n16 3.1\n", "but here is 8 instead of level 1"),
            ("0;0,0\n1;1,5\n", ", line 1: the line has 3 numbers"),
            ("0\n1.5 rad\n", ", line 2: \"1.5 rad\" must be a number of radians"),
        ] {
            let problem = refused(text);
            assert!(problem.contains(sign), "{text:?}: {problem}");
        }
    }
}
