//! Places at a distance.

use crate::v1::{Place, place};

impl Place {
    /// The place at a distance from the SLM through free space \[m\].
    #[must_use]
    pub fn at_m(distance_m: f64) -> Self {
        Self { kind: Some(place::Kind::DistanceM(distance_m)) }
    }

    /// The distance from the SLM through free space \[m\]; `None` for places of other kinds.
    #[must_use]
    pub fn distance_m(&self) -> Option<f64> {
        self.kind.as_ref().map(|place::Kind::DistanceM(distance_m)| *distance_m)
    }
}
