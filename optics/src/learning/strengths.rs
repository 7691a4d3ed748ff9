//! How strong the parts of a learned display are that only some displays need.

use crate::display::DisplayModel;
use crate::display::parts::blocks::Blocks;
use crate::display::parts::measures::{Measures, Scale, Unit};
use crate::display::parts::{Block, ModelPart};
use serde::{Deserialize, Serialize};

/// A part of a display: whether the display needed it, and how strong it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartStrength {
    /// The part.
    pub part: ModelPart,
    /// Whether the model has the part, or of a part that only some displays need: its block.
    pub kept: bool,
    /// What tells how strong the part is; empty for a part that no number describes.
    pub measures: Vec<Measure>,
}

/// A number that tells how strong a part is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measure {
    /// Its name, unique among those of the part.
    pub name: String,
    /// Its unit.
    pub unit: Unit,
    /// Its value; `None` for a part that was not kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// One standard deviation of the value; `None` if it is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std: Option<f64>,
    /// Two standard deviations, for a part that was not kept: with less, the photographs would look the same. `None` if
    /// that is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hidden: Option<f64>,
}

impl PartStrength {
    /// The parts of a display model that only some displays need, whether it has them or not.
    #[must_use]
    pub fn all_of(model: &DisplayModel) -> Vec<Self> {
        let blocks = Blocks::of(model);
        Block::ALL.into_iter().map(|block| Self::of(block.part(), blocks.contains(block), model)).collect()
    }

    /// The parts that a display model has, also those that every display needs.
    #[must_use]
    pub fn present_in(model: &DisplayModel) -> Vec<Self> {
        let present = ModelPart::ALL.iter().filter(|part| part.is_in(model));
        present.map(|&part| Self::of(part, true, model)).collect()
    }

    fn of(part: ModelPart, kept: bool, model: &DisplayModel) -> Self {
        let values = if kept { part.row().strengths(model) } else { Vec::new() };
        let measure = |(i, scale): (usize, &Scale)| Measure {
            name: scale.name.to_owned(),
            unit: scale.unit,
            value: values.get(i).copied(),
            std: None,
            hidden: None,
        };
        Self { part, kept, measures: part.row().measures().scales.iter().enumerate().map(measure).collect() }
    }

    /// Name of the part for people.
    #[must_use]
    pub fn title(&self) -> &'static str {
        self.part.row().block_title()
    }

    /// For people: how strong a part is that was kept, or how strong one could be that was not. Values whose certainty
    /// is not known have `more_digits` decimal places more than usual. Empty if nothing is known.
    #[must_use]
    pub fn text(&self, more_digits: usize) -> String {
        let Measures { phrase, scales, .. } = self.part.row().measures();
        let text = |scale: &Scale| {
            let measure = self.measures.iter().find(|measure| measure.name == scale.name)?;
            match self.kept {
                true => Some(scale.text(measure.value?, measure.std, more_digits)),
                false => Some(scale.text(measure.hidden?, None, more_digits)),
            }
        };
        match scales.iter().map(text).collect::<Option<Vec<String>>>() {
            Some(texts) if self.kept || !texts.is_empty() => {
                texts.iter().fold((*phrase).to_owned(), |phrase, text| phrase.replacen("{}", text, 1))
            }
            _ => String::new(),
        }
    }

    /// What people should know of the part besides; empty for nothing.
    #[must_use]
    pub fn note(&self) -> &'static str {
        self.part.row().measures().note
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strength(part: ModelPart, kept: bool, numbers: &[(f64, Option<f64>)]) -> PartStrength {
        let measure = |(scale, &(number, std)): (&Scale, &(f64, Option<f64>))| Measure {
            name: scale.name.to_owned(),
            unit: scale.unit,
            value: kept.then_some(number),
            std,
            hidden: (!kept).then_some(number),
        };
        PartStrength { part, kept, measures: part.row().measures().scales.iter().zip(numbers).map(measure).collect() }
    }

    #[test]
    fn strengths_in_words_have_the_digits_that_their_certainty_allows() {
        let text = |part, kept, numbers: &[(f64, Option<f64>)]| strength(part, kept, numbers).text(0);
        let crosstalk = text(ModelPart::Crosstalk, true, &[(0.45, Some(0.011)), (0.3, Some(0.0023))]);
        assert_eq!(crosstalk, "σ 0.45 ± 0.01 px along x, 0.300 ± 0.002 px along y");
        assert_eq!(text(ModelPart::LightBlur, true, &[(0.5, None); 2]), "σ 0.50 px along x, 0.50 px along y");
        assert_eq!(text(ModelPart::Dust, true, &[(0.1, None)]), "contrast of 10.0 %");
        assert_eq!(text(ModelPart::UnevenResponse, false, &[(0.004, None)]), "0.4 % RMS");
        assert_eq!(
            text(ModelPart::Source, true, &[(0.31, Some(1e-7))]),
            "phase of 0.3100 ± 0.0000 rad RMS without tilt"
        );
        let ghost = [(0.02, Some(0.001)), (3.0, Some(0.04)), (-4.5, None)];
        assert_eq!(
            text(ModelPart::Ghost, true, &ghost),
            "2.00 ± 0.10 % of the light, 3.00 ± 0.04 px beside the image along x and -4.5 px along y"
        );
        assert_eq!(strength(ModelPart::Dust, true, &[(0.1, None)]).text(1), "contrast of 10.00 %");
    }

    #[test]
    fn nothing_is_said_of_a_part_of_which_nothing_is_known() {
        let [ghost, varying] = [ModelPart::Ghost, ModelPart::VaryingTransferFunction];
        assert_eq!(strength(ghost, false, &[]).text(0), "");
        assert_eq!(strength(varying, false, &[]).text(0), "");
        assert_eq!(strength(varying, true, &[]).text(0), "differs from place to place");
        // A result that was stored before the part had all of its measures.
        assert_eq!(strength(ghost, true, &[(0.02, None)]).text(0), "");
    }
}
