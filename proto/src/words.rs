//! Names and help texts of the values of the API's enumerations, for command lines and tables. The help texts are the
//! comments in the `.proto` files.

use crate::v1;

/// A named value of an enumeration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Word {
    /// Number of the value in messages; 0 is always the unspecified value.
    pub number: i32,
    /// Name of the value in lower case without the prefix of the enumeration: `half-order-x` for
    /// `CARRIER_HALF_ORDER_X`.
    pub word: &'static str,
    /// Comment of the value in the `.proto` file, as one line.
    pub help: &'static str,
}

/// An enumeration of the API.
pub trait Words: Copy + Into<i32> + TryFrom<i32> {
    /// The values in the order of the `.proto` file.
    const WORDS: &'static [Word];

    /// Name of the value; `unknown` if it is not in [`Self::WORDS`].
    fn word(self) -> &'static str {
        let number = self.into();
        Self::WORDS.iter().find(|word| word.number == number).map_or("unknown", |word| word.word)
    }

    /// The value with this name; `None` if there is none.
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
    fn values_have_words_and_help_texts() {
        assert_eq!(v1::Carrier::HalfOrderX.word(), "half-order-x");
        assert_eq!(v1::job::State::Running.word(), "running");
        assert_eq!(v1::Detector::from_word("supersampled"), Some(v1::Detector::Supersampled));
        assert_eq!(v1::Detector::from_word("unknown"), None);
        let point = v1::Detector::WORDS[1];
        assert_eq!((point.number, point.word, point.help), (1, "point", "The intensity at the sample point alone."));
    }
}
