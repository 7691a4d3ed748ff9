//! Parts of a learned display, and what the model loses without each of them.

use crate::display::{
    Crosstalk, DisplayModel, Dust, Ghost, KernelShape, LightBlur, ResponseVariation, SpatialVariation,
};
use crate::numerics::SmoothField;
use num_complex::Complex64;
use serde::{Deserialize, Serialize};

/// A part of a display that changes its light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ModelPart {
    /// Errors of the transfer function: aberrations, and light that the optics lose at some frequencies.
    TransferFunction,
    /// The change of these errors over the SLM.
    VaryingTransferFunction,
    /// Light of further modes, which does not interfere.
    PartialCoherence,
    /// A ghost.
    Ghost,
    /// The profile of the light on the SLM, and the uneven surface of the SLM.
    Source,
    /// Dust and fringes in this light.
    Dust,
    /// The bend of the phase response.
    PhaseResponse,
    /// The change of the phase response over the SLM.
    UnevenResponse,
    /// Cross-talk between neighbouring pixels.
    Crosstalk,
    /// Blur of the light, by the camera or by a source with an extent.
    LightBlur,
    /// Undiffracted light.
    ZeroOrder,
}

/// What a part of a model explains: how much larger the losses of photographs are without it, all else being equal
/// \[dB\].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PartCost {
    /// The part.
    pub part: ModelPart,
    /// Median over the photographs \[dB\].
    pub cost_db: f64,
    /// The least of all photographs \[dB\].
    pub least_db: f64,
    /// The most of all photographs \[dB\].
    pub most_db: f64,
}

impl PartCost {
    /// The cost of a part, from the losses of the same photographs with and without it. `None` without photographs, or
    /// where a loss is not positive.
    #[must_use]
    pub fn of(part: ModelPart, with: &[f64], without: &[f64]) -> Option<Self> {
        let mut costs_db: Vec<f64> =
            with.iter().zip(without).map(|(with, without)| 10.0 * (without / with).log10()).collect();
        costs_db.sort_by(f64::total_cmp);
        let (least_db, most_db) = (*costs_db.first()?, *costs_db.last()?);
        let middle = &costs_db[(costs_db.len() - 1) / 2..=costs_db.len() / 2];
        let cost_db = middle.iter().sum::<f64>() / middle.len() as f64;
        [least_db, cost_db, most_db].iter().all(|cost| cost.is_finite()).then_some(Self {
            part,
            cost_db,
            least_db,
            most_db,
        })
    }
}

/// The parts that a model has, each with the model without it. Empty for kernels with a value for each frequency.
#[must_use]
pub fn without_each_part(model: &DisplayModel) -> Vec<(ModelPart, DisplayModel)> {
    let KernelShape::Smooth(errors) = &model.kernel else { return Vec::new() };
    let is_bent = model.response.as_flattened().iter().any(|&harmonic| harmonic != 0.0);
    let mut parts = Vec::new();
    let mut add = |part, is_there: bool, remove: fn(&mut DisplayModel)| {
        if is_there {
            let mut without = model.clone();
            remove(&mut without);
            parts.push((part, without));
        }
    };
    add(ModelPart::TransferFunction, !errors.is_flat(), |model| {
        (model.kernel, model.variation) = (KernelShape::Smooth(SmoothField::flat(0)), SpatialVariation::none());
        model.beyond = SmoothField::flat(0);
    });
    add(ModelPart::VaryingTransferFunction, !model.variation.is_none(), |model| {
        model.variation = SpatialVariation::none()
    });
    add(ModelPart::PartialCoherence, !model.coherence.is_none(), |model| {
        *model = model.in_one_mode();
    });
    add(ModelPart::Ghost, !model.ghost.is_none(), |model| model.ghost = Ghost::NONE);
    add(ModelPart::Source, !model.source.is_flat(), |model| model.source = SmoothField::flat(0));
    add(ModelPart::Dust, !model.dust.is_none(), |model| model.dust = Dust::none());
    add(ModelPart::PhaseResponse, is_bent, |model| model.response.clear());
    add(ModelPart::UnevenResponse, !model.response_variation.is_none(), |model| {
        model.response_variation = ResponseVariation::none();
    });
    add(ModelPart::Crosstalk, !model.crosstalk.is_none(), |model| model.crosstalk = Crosstalk::NONE);
    add(ModelPart::LightBlur, !model.light_blur.is_none(), |model| model.light_blur = LightBlur::NONE);
    add(ModelPart::ZeroOrder, model.zero_order != Complex64::ZERO, |model| model.zero_order = Complex64::ZERO);
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::{FurtherMode, OpticalSetup, PartialCoherence};
    use crate::numerics::{Grid, Plane};

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
    fn cost_is_the_median_and_the_range_of_ratios() {
        let cost = PartCost::of(ModelPart::Dust, &[1.0, 2.0, 1.0], &[10.0, 2.0, 100.0]).unwrap();
        assert_eq!((cost.cost_db, cost.least_db, cost.most_db), (10.0, 0.0, 20.0));
        assert_eq!(PartCost::of(ModelPart::Dust, &[], &[]), None);
        assert_eq!(PartCost::of(ModelPart::Dust, &[0.0], &[1.0]), None);
    }
}
