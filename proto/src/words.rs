//! The values of the API's enumerations as words, for command lines and tables, with their comments in the proto files.

use crate::v1;

/// A value of an enumeration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Word {
    /// Its number on the wire; 0 is always unspecified.
    pub number: i32,
    /// Its name in lower case without the enumeration's prefix: `half-order-x` for `CARRIER_HALF_ORDER_X`.
    pub word: &'static str,
    /// Its comment in the proto file, as one line.
    pub help: &'static str,
}

/// An enumeration of the API.
pub trait Words: Copy + Into<i32> + TryFrom<i32> {
    /// Its values in the order of the proto file.
    const WORDS: &'static [Word];

    /// The value as a word.
    fn word(self) -> &'static str {
        let number = self.into();
        Self::WORDS.iter().find(|word| word.number == number).map_or("unknown", |word| word.word)
    }

    /// The value that a word names.
    fn from_word(word: &str) -> Option<Self> {
        let word = Self::WORDS.iter().find(|known| known.word == word)?;
        Self::try_from(word.number).ok()
    }
}

include!(concat!(env!("OUT_DIR"), "/words.rs"));

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_words_with_their_comments() {
        assert_eq!(v1::Carrier::HalfOrderX.word(), "half-order-x");
        assert_eq!(v1::job::State::Running.word(), "running");
        assert_eq!(v1::Detector::from_word("supersampled"), Some(v1::Detector::Supersampled));
        assert_eq!(v1::Detector::from_word("eye"), None);
        let point = v1::Detector::WORDS[1];
        assert_eq!((point.number, point.word, point.help), (1, "point", "The intensity at the sample point alone."));
    }
}
