//! Texts of files in messages. A file may hold a text of any length, but a message must stay short.

use std::fmt::Display;

/// Longest part of a file that a message quotes \[characters\].
const CHARACTERS_MAX: usize = 200;

/// The text, or its beginning and a sign that it goes on.
pub(crate) fn shortened(text: impl Display) -> String {
    let mut text = text.to_string();
    if let Some((end, _)) = text.char_indices().nth(CHARACTERS_MAX) {
        text.truncate(end);
        text.push('…');
    }
    text
}

/// The sides of an array, or the first of them.
pub(crate) fn sides<T: std::fmt::Debug>(shape: &[T]) -> String {
    const SIDES_MAX: usize = 8;
    match shape.get(..SIDES_MAX) {
        Some(first) if shape.len() > SIDES_MAX => format!("{first:?} and {} more sides", shape.len() - SIDES_MAX),
        _ => format!("{shape:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_long_texts_are_cut_and_at_a_character() {
        assert_eq!(shortened("–1"), "–1");
        let long = shortened("ä".repeat(300));
        assert_eq!((long.chars().count(), long.ends_with("ä…")), (201, true));
        assert_eq!(sides(&[1, 2]), "[1, 2]");
        assert_eq!(sides(&[7; 20]), "[7, 7, 7, 7, 7, 7, 7, 7] and 12 more sides");
    }
}
