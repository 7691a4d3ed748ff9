//! Ranges and defaults of numbers in requests, from the comments of their fields: `16 to 8192`, `above 0, at most 10`,
//! `Unset: 10`, and `0 means 50` of the sizes of pages. Only numbers in digits at the end of the first clause are a range,
//! and only one at the end of the comment is a default, so that no other number of a text is taken for one.

use protox::prost_reflect::{FieldDescriptor, Kind};
use serde_json::{Value, json};

/// What a comment says about a number.
#[derive(Default, Debug, Clone, Copy)]
pub(crate) struct Range {
    least: Option<f64>,
    most: Option<f64>,
    default: Option<f64>,
    /// Whether the number may be left out.
    may_be_absent: bool,
    /// Whether the number must be above 0.
    is_positive: bool,
    is_whole: bool,
}

impl Range {
    /// Adds the range to a schema.
    pub(crate) fn add_to(&self, schema: &mut Value) {
        let ends = [("minimum", self.least), ("maximum", self.most), ("default", self.default)];
        for (name, number) in ends.into_iter().filter_map(|(name, number)| Some((name, number?))) {
            schema[name] = if self.is_whole { json!(number as i64) } else { json!(number) };
        }
        if self.is_positive {
            schema["exclusiveMinimum"] = json!(0);
        }
    }

    /// Whether a request without the number is refused: an absent number is 0, which is not in the range.
    pub(crate) fn is_required(&self) -> bool {
        !self.may_be_absent && (self.is_positive || self.least.is_some_and(|least| least > 0.0))
    }
}

/// The range of a field with this comment.
pub(crate) fn range_of(field: &FieldDescriptor, comment: &str) -> Range {
    let is_whole = matches!(field.kind(), Kind::Uint32 | Kind::Int32);
    if !is_whole && !matches!(field.kind(), Kind::Double) {
        return Range::default();
    }
    let may_be_absent = field.supports_presence() || comment.contains("0 means ");
    let default = default_after(comment, "0 means ").or_else(|| default_after(comment, "Unset: "));
    let Ends { mut least, most, is_positive } = ends_of(comment).unwrap_or_default();
    if may_be_absent && !field.supports_presence() {
        // The number 0 stands for the default size of a page.
        least = least.map(|least| least.min(0.0));
    }
    if most.is_some() && least.is_none() && !is_positive && matches!(field.kind(), Kind::Uint32) {
        least = Some(0.0);
    }
    Range { least, most, default, may_be_absent, is_positive, is_whole }
}

/// The ends of a range.
#[derive(Default)]
struct Ends {
    least: Option<f64>,
    most: Option<f64>,
    /// Whether the least end is 0, which is outside.
    is_positive: bool,
}

/// The ends of the range at the end of the first clause.
fn ends_of(comment: &str) -> Option<Ends> {
    let end = ["; ", ". ", ": "].iter().filter_map(|mark| comment.find(mark)).min();
    let clause = end.map_or(comment, |end| &comment[..end]).trim_end_matches('.').trim_end_matches(" and not 0");
    if let Some((before, most)) = clause.rsplit_once(" to ") {
        let least = before.rsplit_once(", ").map(|(_, least)| least)?;
        return Some(Ends { least: Some(number(least)?), most: Some(number(most)?), is_positive: false });
    }
    let (before, most) = clause.rsplit_once(", at most ")?;
    Some(Ends { least: None, most: Some(number(most)?), is_positive: before.ends_with("above 0") })
}

/// The number with which a comment ends, after these words. A text that goes on may restrict it, as in `Unset: 0.1. Other
/// methods have none`, and generated clients send defaults.
fn default_after(comment: &str, words: &str) -> Option<f64> {
    number(comment.rsplit_once(words)?.1.trim_end_matches('.'))
}

/// A number in digits and nothing else, with the minus of texts or of programs.
fn number(text: &str) -> Option<f64> {
    let text = text.replace('−', "-");
    text.chars().all(|c| c.is_ascii_digit() || matches!(c, '-' | '.' | 'e')).then(|| text.parse().ok())?
}
