//! Enumerations of the API as command-line values. Their words and their help come from the proto files.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Arg, Command, Error};
use lightpath::{Word, Words};
use std::ffi::OsStr;

/// Parses a word into a value of an enumeration.
#[derive(Clone, Debug)]
pub(crate) struct WordParser<E> {
    values: Vec<(PossibleValue, E)>,
}

impl<E: Words> WordParser<E> {
    /// Accepts every value except the unspecified one.
    pub(crate) fn new() -> Self {
        let given = E::WORDS.iter().filter(|word| word.number != 0);
        let value = |word: &Word| Some((PossibleValue::new(word.word).help(word.help), E::from_word(word.word)?));
        Self { values: given.filter_map(value).collect() }
    }

    /// Also accepts the unspecified value, as `word`.
    pub(crate) fn or_unspecified_as(mut self, word: &'static str, help: &'static str) -> Self {
        self.values.extend(E::try_from(0).ok().map(|value| (PossibleValue::new(word).help(help), value)));
        self
    }

    /// Also accepts `alias` for the value with this word.
    pub(crate) fn alias(mut self, word: &str, alias: &'static str) -> Self {
        for (value, _) in self.values.iter_mut().filter(|(value, _)| value.get_name() == word) {
            *value = value.clone().alias(alias);
        }
        self
    }

    /// No longer accepts the value with this word.
    pub(crate) fn without(mut self, word: &str) -> Self {
        self.values.retain(|(value, _)| value.get_name() != word);
        self
    }

    fn names(&self) -> PossibleValuesParser {
        PossibleValuesParser::new(self.values.iter().map(|(value, _)| value.clone()))
    }
}

impl<E: Words + Send + Sync + 'static> TypedValueParser for WordParser<E> {
    type Value = E;

    fn parse_ref(&self, command: &Command, arg: Option<&Arg>, value: &OsStr) -> Result<E, Error> {
        let name = self.names().parse_ref(command, arg, value)?;
        let found = self.values.iter().find(|(value, _)| value.matches(&name, false));
        // The lookup always succeeds, because `names` accepts only words and aliases of `values`.
        found.map(|(_, value)| *value).ok_or_else(|| Error::new(clap::error::ErrorKind::InvalidValue))
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        Some(Box::new(self.values.iter().map(|(value, _)| value.clone())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath::v1::HologramMethod;

    #[test]
    fn words_and_aliases_are_parsed() {
        let parser = WordParser::<HologramMethod>::new().alias("double-phase", "dpac").without("adam");
        let read = |word: &str| parser.parse_ref(&Command::new("x"), None, OsStr::new(word)).ok();
        assert_eq!(read("lbfgs"), Some(HologramMethod::Lbfgs));
        assert_eq!((read("dpac"), read("double-phase")), (read("double-phase"), Some(HologramMethod::DoublePhase)));
        assert_eq!((read("adam"), read("unspecified"), read("")), (None, None, None));
        let parser = parser.or_unspecified_as("auto", "the server's choice");
        let auto = parser.parse_ref(&Command::new("x"), None, OsStr::new("auto")).ok();
        assert_eq!(auto, Some(HologramMethod::Unspecified));
    }
}
