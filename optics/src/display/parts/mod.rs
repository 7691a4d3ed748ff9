//! The parts of a display that its [model](super) describes: one file for each, and one table of all.
//!
//! A file says what its part is, and implements `Part`: the part's names, its numbers in θ with their limits, how a
//! model is left without it, what is stored of it, on which terms learning tries it, and how strong it is. Whatever
//! treats all parts alike goes through `PARTS`.

pub(crate) mod blocks;
pub mod blur_ratios;
mod blur_row;
pub mod crosstalk;
pub(crate) mod dust;
pub(crate) mod ghost;
pub(crate) mod layout;
pub mod light_blur;
pub(crate) mod measures;
pub(crate) mod order_errors;
pub(crate) mod partial_coherence;
pub(crate) mod phase_response;
pub(crate) mod response_variation;
pub(crate) mod source;
pub mod spatial_variation;
pub mod stored;
pub(crate) mod terms;
pub(crate) mod transfer_function;
pub(crate) mod zero_order;

use super::{DisplayModel, KernelShape};
use layout::Layout;
use measures::{Deviation, Hidden, Measures};
use serde::{Deserialize, Serialize};
use stored::{Restored, Stored, StoredParts};
use terms::Terms;

/// What everything that treats all parts alike needs to know of one.
pub(crate) trait Part: Sync {
    /// Name as it is stored.
    fn name(&self) -> &'static str;

    /// Name of the [`Block`] that adds the part to a model, as it is stored.
    fn block_name(&self) -> &'static str {
        self.name()
    }

    /// Name for people.
    fn title(&self) -> &'static str;

    /// Name for people of what the part's block adds.
    fn block_title(&self) -> &'static str {
        self.title()
    }

    /// Whether a model has the part.
    fn is_in(&self, model: &DisplayModel) -> bool;

    /// Whether a model has the part's block.
    fn has_block(&self, model: &DisplayModel) -> bool {
        self.is_in(model)
    }

    /// Takes the part out of a model that has it.
    fn remove(&self, model: &mut DisplayModel);

    /// Writes what is stored of the part.
    fn store(&self, model: &DisplayModel, to: &mut Stored);

    /// Reads what is stored of the part, and gives it to a model without the part.
    fn restore(&self, from: &dyn StoredParts, model: &mut DisplayModel) -> Restored;

    /// What H at each frequency holds of the part.
    fn in_bins(&self) -> InBins {
        InBins::Beside
    }

    /// How many numbers the part has in θ.
    fn count(&self, _layout: &Layout) -> usize {
        0
    }

    /// The part's numbers in θ, of a model with a smooth kernel. What the layout cannot describe is left out.
    fn numbers(&self, _layout: &Layout, _model: &DisplayModel) -> Vec<f64> {
        Vec::new()
    }

    /// Gives a model the part with these numbers. Without numbers the model does not get the part.
    fn set(&self, _layout: &Layout, _numbers: &[f64], _model: &mut DisplayModel) {}

    /// Whether the part of a model has the form that a layout gives it.
    fn has_form_of(&self, _layout: &Layout, _model: &DisplayModel) -> bool {
        true
    }

    /// Converts the part's numbers to another layout.
    fn converted(&self, from: &Layout, to: &Layout, numbers: &[f64]) -> Vec<f64> {
        let count = self.count(to);
        if self.count(from) == count { numbers.to_vec() } else { vec![0.0; count] }
    }

    /// The value of the number at a position among the part's own, moved into its limits.
    fn limited(&self, _layout: &Layout, _position: usize, value: f64) -> f64 {
        value
    }

    /// On which terms learning tries the part's block and keeps it; `None` for a part that each model has.
    fn terms(&self) -> Option<Terms> {
        None
    }

    /// What tells how strong the part is.
    fn measures(&self) -> &'static Measures;

    /// The measures of a model that has the part.
    fn strengths(&self, _model: &DisplayModel) -> Vec<f64> {
        Vec::new()
    }

    /// One standard deviation of each measure of a model that has the part's block, from the slopes of the measures;
    /// `None` for a part without numbers in θ.
    fn deviations(&self, layout: &Layout, model: &DisplayModel, deviation: Deviation<'_>) -> Option<Vec<f64>> {
        let numbers = self.numbers(layout, model);
        let changed = |position: usize, change: f64| {
            let (mut numbers, mut model) = (numbers.clone(), model.clone());
            numbers[position] += change;
            self.set(layout, &numbers, &mut model);
            self.strengths(&model)
        };
        let slopes = |position| -> Vec<f64> {
            let (more, less) = (changed(position, CHANGE), changed(position, -CHANGE));
            more.iter().zip(less).map(|(more, less)| (more - less) / (2.0 * CHANGE)).collect()
        };
        let slopes: Vec<Vec<f64>> = (0..numbers.len()).map(slopes).collect();
        let of_measure = |i| deviation(&slopes.iter().map(|slopes| slopes[i]).collect::<Vec<_>>());
        (!numbers.is_empty()).then(|| (0..self.measures().scales.len()).map(of_measure).collect())
    }

    /// How strong the part could be in a display whose photographs do not show it; `None` if nothing says that.
    fn hidden(&self) -> Option<Hidden> {
        None
    }
}

/// Change of a number in θ by which the slope of a measure is computed.
const CHANGE: f64 = 1e-4;

/// Makes the table of the parts: `Part / Block: file`, where only parts have a block that only some displays need.
macro_rules! parts {
    ($($(#[$doc:meta])* $part:ident $(/ $block:ident)?: $row:path,)*) => {
        /// A part of a display that changes its light.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum ModelPart { $($(#[$doc])* $part,)* }

        impl ModelPart {
            /// All parts.
            pub const ALL: &[Self] = &[$(Self::$part),*];
        }

        /// The parts, in the order of [`ModelPart::ALL`].
        pub(crate) static PARTS: [&dyn Part; ModelPart::ALL.len()] = [$(&$row),*];

        /// A part of the display model that only some displays need. Learning tries each block when the simpler model is
        /// fitted, and keeps it if it lowers the validation loss enough.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum Block {
            $($(#[doc = concat!("The block of [`ModelPart::", stringify!($part), "`].")] $block,)?)*
        }

        impl Block {
            /// How many blocks there are.
            const COUNT: usize = [$($(Self::$block,)?)*].len();
            /// All blocks, in the order in which learning tries them.
            pub const ALL: [Self; Self::COUNT] = [$($(Self::$block,)?)*];

            /// The part that the block adds.
            #[must_use]
            pub fn part(self) -> ModelPart {
                match self { $($(Self::$block => ModelPart::$part,)?)* }
            }
        }
    };
}

parts! {
    /// Errors of the transfer function: aberrations, and light that the optics lose at some frequencies.
    TransferFunction: transfer_function::Row,
    /// The profile of the light on the SLM, and the uneven surface of the SLM. As a block: a source profile of degree
    /// 10 instead of 4, for the uneven surface of a modulator.
    Source / FineSource: source::Row,
    /// [`Crosstalk`](crate::Crosstalk) between neighbouring pixels.
    Crosstalk / Crosstalk: crosstalk::ROW,
    /// A phase response that [varies over the SLM](crate::ResponseVariation).
    UnevenResponse / UnevenResponse: response_variation::Row,
    /// A [blur of the light](crate::LightBlur), by the camera or by a source with an extent.
    LightBlur / LightBlur: light_blur::ROW,
    /// Light of several modes that do not interfere: [partial coherence](crate::PartialCoherence).
    PartialCoherence / PartialCoherence: partial_coherence::Row,
    /// A kernel that [varies over the SLM](crate::SpatialVariation).
    VaryingTransferFunction / Varying: spatial_variation::Row,
    /// A [`Ghost`](crate::Ghost): a second image.
    Ghost / Ghost: ghost::Row,
    /// [`Dust`](crate::Dust) and fringes in the light on the SLM.
    Dust / Dust: dust::Row,
    /// The bend of the phase response.
    PhaseResponse: phase_response::Row,
    /// Undiffracted light.
    ZeroOrder: zero_order::Row,
}

/// The parts with numbers in θ, in θ's order. A new part goes to the end.
pub(crate) const THETA: [ModelPart; 10] = [
    ModelPart::TransferFunction,
    ModelPart::Source,
    ModelPart::PhaseResponse,
    ModelPart::ZeroOrder,
    ModelPart::Crosstalk,
    ModelPart::UnevenResponse,
    ModelPart::Ghost,
    ModelPart::LightBlur,
    ModelPart::VaryingTransferFunction,
    ModelPart::PartialCoherence,
];

/// The parts in the order in which they are stored. A new part goes to the end.
pub(crate) const STORED: [ModelPart; ModelPart::ALL.len()] = [
    ModelPart::ZeroOrder,
    ModelPart::TransferFunction,
    ModelPart::Source,
    ModelPart::VaryingTransferFunction,
    ModelPart::PhaseResponse,
    ModelPart::UnevenResponse,
    ModelPart::Crosstalk,
    ModelPart::LightBlur,
    ModelPart::Ghost,
    ModelPart::PartialCoherence,
    ModelPart::Dust,
];

/// What a transfer function H with a number for each frequency holds of a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InBins {
    /// The part is beside the transfer function.
    Beside,
    /// H holds the part.
    Held,
    /// The part needs a smooth transfer function, and a single H does not hold it.
    Lost,
}

impl ModelPart {
    /// Name of the part as it is stored.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.row().name()
    }

    /// Name of the part for people.
    #[must_use]
    pub fn title(self) -> &'static str {
        self.row().title()
    }

    /// Whether a model has the part.
    #[must_use]
    pub fn is_in(self, model: &DisplayModel) -> bool {
        self.row().is_in(model)
    }

    /// Takes the part out of a model.
    pub fn remove(self, model: &mut DisplayModel) {
        self.row().remove(model);
    }

    /// What H at each frequency holds of the part.
    #[must_use]
    pub fn in_bins(self) -> InBins {
        self.row().in_bins()
    }

    /// Whether two models have the same part, to the last digit.
    #[must_use]
    pub fn is_same_in(self, one: &DisplayModel, other: &DisplayModel) -> bool {
        Stored::of_part(self, one) == Stored::of_part(self, other)
    }

    pub(crate) fn row(self) -> &'static dyn Part {
        PARTS[self as usize]
    }
}

/// The parts that a model has, each with the model without it. Empty for kernels with a value for each frequency.
#[must_use]
pub fn without_each_part(model: &DisplayModel) -> Vec<(ModelPart, DisplayModel)> {
    let KernelShape::Smooth(_) = &model.kernel else { return Vec::new() };
    let without = |part: ModelPart| {
        let mut without = model.clone();
        part.row().remove(&mut without);
        (part, without)
    };
    ModelPart::ALL.iter().copied().filter(|part| part.is_in(model)).map(without).collect()
}

#[cfg(test)]
mod tests {
    use super::blocks::Blocks;
    use super::*;
    use crate::display::{
        Crosstalk, Dust, FurtherMode, Ghost, LightBlur, OpticalSetup, PartialCoherence, ResponseVariation,
        SpatialVariation,
    };
    use crate::numerics::{Grid, Plane, SmoothField};
    use num_complex::Complex64;

    #[test]
    fn each_part_that_a_model_has_is_left_out_alone() {
        let setup = OpticalSetup::try_new(Grid::try_new(4, 6, 8e-6).unwrap(), 515e-9, 2e-3).unwrap();
        let ideal = DisplayModel::ideal(setup);
        assert_eq!(without_each_part(&ideal), []);
        let wavy = SmoothField { order: 1, log_amplitude: vec![0.1, 0.0], phase: vec![0.0, 0.2] };
        let all = DisplayModel {
            kernel: KernelShape::Smooth(wavy.clone()),
            variation: SpatialVariation::new([(); 5].map(|()| wavy.clone())),
            coherence: PartialCoherence::new(vec![FurtherMode { light: 0.5, errors: wavy.clone() }]),
            source: wavy,
            dust: Dust::new(Plane::filled(4, 6, [10, -20])),
            response: vec![[0.1, 0.0]],
            response_variation: ResponseVariation { order: 0, coefficients: vec![0.1] },
            crosstalk: Crosstalk { ratio_x: 0.1, ratio_y: 0.0 },
            light_blur: LightBlur { ratio_x: 0.0, ratio_y: 0.1 },
            zero_order: Complex64::new(0.1, 0.0),
            ghost: Ghost { amplitude: Complex64::new(0.1, 0.0), ..Ghost::NONE },
            ..ideal.clone()
        };
        let parts = without_each_part(&all);
        assert_eq!(parts.len(), 11);
        for (part, without) in &parts {
            without.validate().unwrap();
            let left: Vec<ModelPart> = without_each_part(without).into_iter().map(|(part, _)| part).collect();
            // The change of the transfer function goes with it.
            let together = [ModelPart::TransferFunction, ModelPart::VaryingTransferFunction];
            let goes = |other: &ModelPart| other == part || *part == together[0] && *other == together[1];
            assert!(parts.iter().all(|(other, _)| left.contains(other) != goes(other)), "{part:?}");
        }
    }

    #[test]
    fn each_part_with_numbers_stands_in_theta_and_each_part_is_stored_once() {
        let layout = Layout::new(true, 5, Blocks::ALL);
        for part in ModelPart::ALL {
            let has_numbers = part.row().count(&layout) > 0;
            assert_eq!(THETA.iter().filter(|other| *other == part).count(), usize::from(has_numbers), "{part:?}");
            assert_eq!(STORED.iter().filter(|other| *other == part).count(), 1, "{part:?}");
        }
    }

    #[test]
    fn names_are_those_that_are_stored() {
        let stored = |value| serde_json::to_value(value).unwrap();
        for part in ModelPart::ALL {
            assert_eq!(stored(part), part.name());
        }
        for block in Block::ALL {
            assert_eq!(serde_json::to_value(block).unwrap(), block.name());
            assert!(block.part().row().terms().is_some());
        }
    }

    #[test]
    fn each_part_says_how_strong_it_is() {
        let setup = OpticalSetup::try_new(Grid::try_new(4, 6, 8e-6).unwrap(), 515e-9, 2e-3).unwrap();
        let ideal = DisplayModel::ideal(setup);
        for &part in ModelPart::ALL {
            let row = part.row();
            let measures = row.measures();
            assert!(!measures.phrase.is_empty(), "{part:?}");
            assert_eq!(measures.scales.is_empty(), part == ModelPart::VaryingTransferFunction, "{part:?}");
            assert_eq!(measures.phrase.matches("{}").count(), measures.scales.len(), "{part:?}");
            assert_eq!(row.strengths(&ideal).len(), measures.scales.len(), "{part:?}");
            let hidden = row.hidden().map(|hidden| hidden(&|_| 0.1));
            assert!(hidden.is_none_or(|hidden| hidden.len() == measures.scales.len()), "{part:?}");
        }
    }
}
