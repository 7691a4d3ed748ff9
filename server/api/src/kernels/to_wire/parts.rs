//! Conversion of the parts of displays into messages.

use lightpath_media::kernel_formats::Loss;
use lightpath_media::report::Comparison;
use lightpath_optics::learning::{Measure, ModelPart, PartCost, PartStrength};
use lightpath_proto::v1::kernel_comparison::PartComparison;
use lightpath_proto::v1::{self, Part};

/// Decimal places that a compared number has more than usual, so that small differences show.
const MORE_DIGITS: usize = 2;

/// Converts what learning found of a part into its message.
pub(crate) fn learned(strength: PartStrength) -> Part {
    let (title, kept) = (strength.title().to_owned(), Some(strength.kept));
    Part { title, kept, ..present(strength, 0) }
}

/// Converts a part of a model into its message.
fn present(strength: PartStrength, more_digits: usize) -> Part {
    let (name, title) = (strength.part.name().to_owned(), strength.part.title().to_owned());
    let text = strength.text(more_digits);
    let value = |Measure { name, unit, value, std, hidden }: Measure| {
        let value = value.map(|value| v1::Measure { value, std, ..v1::Measure::default() });
        v1::PartValue { name, unit: unit.name().to_owned(), value, detectable: hidden }
    };
    Part { name, title, values: strength.measures.into_iter().map(value).collect(), text, ..Part::default() }
}

/// Converts what a part explains into its message.
pub(super) fn cost(&PartCost { part, cost_db, least_db, most_db }: &PartCost) -> Part {
    let cost_db = v1::Measure { value: cost_db, low: Some(least_db), high: Some(most_db), std: None };
    let (name, title) = (part.name().to_owned(), part.title().to_owned());
    Part { name, title, cost_db: Some(cost_db), ..Part::default() }
}

/// Converts what a form does not hold into its message.
pub(crate) fn loss(loss: Loss) -> Part {
    Part { name: loss.name().to_owned(), title: loss.to_string(), ..Part::default() }
}

/// Converts the parts of two versions, and the gains of their cameras, into messages.
pub(crate) fn compared(comparison: &Comparison) -> Vec<PartComparison> {
    let pair = |(part, strengths): &(ModelPart, [Option<PartStrength>; 2])| {
        let [first, second] = strengths.clone().map(|strength| Some(present(strength?, MORE_DIGITS)));
        PartComparison { name: part.name().to_owned(), title: part.title().to_owned(), first, second }
    };
    let [first, second] = comparison.gains.map(|gain| Some(camera(gain)));
    let (name, title) = (GAIN.0.to_owned(), GAIN.1.to_owned());
    comparison.parts.iter().map(pair).chain([PartComparison { name, title, first, second }]).collect()
}

/// Name and title of the gain of the camera, which belongs to the exposure, and not to the display.
const GAIN: (&str, &str) = ("gain", "gain of the camera");

fn camera(gain: f64) -> Part {
    let (name, title) = (GAIN.0.to_owned(), GAIN.1.to_owned());
    let value = Some(v1::Measure { value: gain, ..v1::Measure::default() });
    let values = vec![v1::PartValue { name: name.clone(), unit: "1".to_owned(), value, detectable: None }];
    Part { name, title, values, text: format!("{gain:.4}"), ..Part::default() }
}
