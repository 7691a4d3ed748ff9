//! Texts of numbers. A line that begins with a letter is a title; the lines after it hold its numbers.

/// Significant digits of a number beyond the first.
const DIGITS: usize = 8;
/// Numbers in a line.
const IN_LINE: usize = 6;

/// A title with its numbers.
#[derive(Debug, PartialEq)]
pub(crate) struct Block {
    pub(crate) title: String,
    pub(crate) numbers: Vec<f64>,
}

/// Writes a text.
pub(crate) fn write(comment: &str, blocks: &[Block]) -> String {
    let mut text = format!("# {comment}\n");
    for block in blocks {
        text.push_str(&block.title);
        text.push('\n');
        for line in block.numbers.chunks(IN_LINE) {
            let numbers: Vec<String> = line.iter().map(|&number| written(number)).collect();
            text.push_str(&numbers.join(" "));
            text.push('\n');
        }
    }
    text
}

/// Whole numbers stay whole, and zeros short.
fn written(number: f64) -> String {
    if number.fract() == 0.0 && number.abs() < 1e6 { format!("{number:.0}") } else { format!("{number:.DIGITS$e}") }
}

/// Reads a text.
pub(crate) fn read(text: &str) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    for line in text.lines().filter(|line| !line.is_empty() && !line.starts_with('#')) {
        if line.starts_with(char::is_alphabetic) {
            blocks.push(Block { title: line.to_owned(), numbers: Vec::new() });
        } else {
            let numbers = line.split(' ').map(|number| number.parse::<f64>().unwrap());
            blocks.last_mut().expect("a title before its numbers").numbers.extend(numbers);
        }
    }
    blocks
}

/// Relative error over a block. Where all expected numbers are 0, so must the others be.
pub(crate) fn error(expected: &[f64], found: &[f64]) -> f64 {
    let squares = |numbers: &mut dyn Iterator<Item = f64>| numbers.map(|number| number * number).sum::<f64>();
    let off = squares(&mut expected.iter().zip(found).map(|(a, b)| a - b));
    if off == 0.0 { 0.0 } else { (off / squares(&mut expected.iter().copied())).sqrt() }
}
