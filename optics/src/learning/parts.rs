//! What the parts of a learned display explain.

use crate::display::parts::ModelPart;
use serde::{Deserialize, Serialize};

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cost_is_the_median_and_the_range_of_ratios() {
        let cost = PartCost::of(ModelPart::Dust, &[1.0, 2.0, 1.0], &[10.0, 2.0, 100.0]).unwrap();
        assert_eq!((cost.cost_db, cost.least_db, cost.most_db), (10.0, 0.0, 20.0));
        assert_eq!(PartCost::of(ModelPart::Dust, &[], &[]), None);
        assert_eq!(PartCost::of(ModelPart::Dust, &[0.0], &[1.0]), None);
    }
}
