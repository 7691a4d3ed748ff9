//! Phase response of a spatial light modulator: the relation between grey levels and phases.
//!
//! ```text
//! linear:   phase(level) = level · 2π / 2^b,   level(φ) = round(φ / 2π · 2^b) mod 2^b
//! measured: phase(level) as measured,          level(φ) = the level whose phase is nearest to φ modulo 2π
//! ```

use crate::error::{Error, Result};
use crate::numerics::Plane;
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Phase response of a display: the phase of each grey level.
#[derive(Clone, Debug, PartialEq)]
pub struct PhaseResponse {
    bit_depth: u32,
    curve: Curve,
}

#[derive(Clone, Debug, PartialEq)]
enum Curve {
    Linear,
    Measured {
        phase_rad: Vec<f64>,
        /// Phases wrapped to [0, 2π) with their levels, in ascending order without duplicate phases.
        ascending: Vec<(f64, u16)>,
    },
}

impl PhaseResponse {
    /// Largest number of bits of a grey level, so that levels fit into a 16-bit image.
    pub const BIT_DEPTH_MAX: u32 = 16;
    /// Smallest span of a measured phase response \[rad\]. A modulator with a smaller span cannot show holograms.
    pub const SPAN_RAD_MIN: f64 = PI;

    /// Linear response with steps of 2π / 2^`bit_depth`.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] unless `bit_depth` is between 1 and [`Self::BIT_DEPTH_MAX`].
    pub fn linear(bit_depth: u32) -> Result<Self> {
        if !(1..=Self::BIT_DEPTH_MAX).contains(&bit_depth) {
            return Err(Error::OutOfRange { name: "bit_depth", value: f64::from(bit_depth), allowed: "1 to 16" });
        }
        Ok(Self { bit_depth, curve: Curve::Linear })
    }

    /// Measured response, with the phase \[rad\] of each level: 2^b values for b bits.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] when the number of values is not 2, 4, 8 … 65536, when one is not finite, or when they
    /// span less than [`Self::SPAN_RAD_MIN`].
    pub fn measured(phase_rad: Vec<f64>) -> Result<Self> {
        let count = phase_rad.len();
        if !count.is_power_of_two() || !(2..=1 << Self::BIT_DEPTH_MAX).contains(&count) {
            let allowed = "2, 4, 8 … 65536, one phase for each grey level";
            return Err(Error::OutOfRange { name: "number of phase_rad values", value: count as f64, allowed });
        }
        if let Some(&value) = phase_rad.iter().find(|phase| !phase.is_finite()) {
            return Err(Error::OutOfRange { name: "phase_rad", value, allowed: "finite" });
        }
        let (low, high) = phase_rad.iter().fold((f64::MAX, f64::MIN), |(low, high), &p| (low.min(p), high.max(p)));
        if high - low < Self::SPAN_RAD_MIN {
            return Err(Error::OutOfRange { name: "span of phase_rad", value: high - low, allowed: "at least π rad" });
        }
        let mut ascending: Vec<_> = (0..=u16::MAX).zip(&phase_rad).map(|(level, &p)| (wrap(p), level)).collect();
        ascending.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        ascending.dedup_by_key(|entry| entry.0);
        Ok(Self { bit_depth: count.ilog2(), curve: Curve::Measured { phase_rad, ascending } })
    }

    /// Number of bits of a level. Levels are 0 to 2^bit_depth − 1.
    #[must_use]
    pub fn bit_depth(&self) -> u32 {
        self.bit_depth
    }

    /// Number of levels, 2^bit_depth.
    #[must_use]
    pub fn levels(&self) -> usize {
        1 << self.bit_depth
    }

    /// Phase \[rad\] of `level`: in [0, 2π) for a linear response, otherwise as measured.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a level above the highest level.
    pub fn phase_rad(&self, level: u16) -> Result<f64> {
        if usize::from(level) >= self.levels() {
            return Err(Error::OutOfRange { name: "level", value: f64::from(level), allowed: "below 2^bit_depth" });
        }
        Ok(match &self.curve {
            Curve::Linear => f64::from(level) * TAU / self.levels() as f64,
            Curve::Measured { phase_rad, .. } => phase_rad[usize::from(level)],
        })
    }

    /// Level whose phase is nearest to a finite phase \[rad\], modulo 2π. Halfway between two levels, a linear response
    /// gives the upper level, and a measured response the level with the smaller number.
    #[must_use]
    pub fn nearest_level(&self, phase_rad: f64) -> u16 {
        match &self.curve {
            Curve::Linear => {
                let levels = self.levels() as f64;
                (phase_rad / TAU * levels).round().rem_euclid(levels) as u16
            }
            Curve::Measured { ascending, .. } => nearest(ascending, wrap(phase_rad)),
        }
    }

    /// Converts every phase \[rad\] to its nearest level.
    ///
    /// # Errors
    ///
    /// [`Error::NotFinite`] for the first phase that is not finite.
    pub fn quantize(&self, phase: &Plane<f32>) -> Result<Plane<u16>> {
        phase.expect_finite("phase")?;
        let levels = phase.values().par_iter().map(|&phase| self.nearest_level(f64::from(phase))).collect();
        Plane::try_from_vec(phase.height_px(), phase.width_px(), levels)
    }

    /// Converts every level to its phase \[rad\].
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for the first value above the highest level.
    pub fn dequantize(&self, levels: &Plane<u16>) -> Result<Plane<f32>> {
        let phases = levels.values().iter().map(|&level| self.phase_rad(level).map(|phase| phase as f32));
        Plane::try_from_vec(levels.height_px(), levels.width_px(), phases.collect::<Result<_>>()?)
    }
}

/// Wraps a finite phase \[rad\] to [0, 2π).
///
/// ```
/// use lightpath_optics::display::phase_response::wrap;
/// assert_eq!(wrap(std::f64::consts::TAU), 0.0);
/// assert_eq!(wrap(-1e-300), 0.0);
/// assert_eq!(wrap(1.0), 1.0);
/// ```
#[must_use]
pub fn wrap(phase_rad: f64) -> f64 {
    let wrapped = phase_rad.rem_euclid(TAU);
    // For a tiny negative phase the remainder rounds up to 2π.
    if wrapped < TAU { wrapped } else { 0.0 }
}

/// Wraps a finite phase \[rad\] to [0, 2π) like [`wrap`] and rounds it to f32, the precision of holograms. The rounded
/// phase is also less than 2π.
#[must_use]
pub fn wrap_f32(phase_rad: f64) -> f32 {
    let wrapped = wrap(phase_rad) as f32;
    if f64::from(wrapped) < TAU { wrapped } else { 0.0 }
}

fn nearest(ascending: &[(f64, u16)], wrapped_rad: f64) -> u16 {
    let above = ascending.partition_point(|entry| entry.0 < wrapped_rad);
    let (first, last) = (ascending[0], ascending[ascending.len() - 1]);
    let upper = ascending.get(above).copied().unwrap_or((first.0 + TAU, first.1));
    let lower = if above == 0 { (last.0 - TAU, last.1) } else { ascending[above - 1] };
    let (up, down) = (upper.0 - wrapped_rad, wrapped_rad - lower.0);
    match up.total_cmp(&down) {
        std::cmp::Ordering::Less => upper.1,
        std::cmp::Ordering::Greater => lower.1,
        std::cmp::Ordering::Equal => upper.1.min(lower.1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Distance between two phases modulo 2π.
    fn apart(a: f64, b: f64) -> f64 {
        let difference = wrap(a - b);
        difference.min(TAU - difference)
    }

    #[test]
    fn full_turn_is_level_0() {
        let response = PhaseResponse::linear(8).unwrap();
        let phase = Plane::try_from_vec(1, 5, vec![0.0, TAU as f32, PI as f32, -0.01, 6.27]).unwrap();
        assert_eq!(response.quantize(&phase).unwrap().values(), [0, 0, 128, 0, 255]);
    }

    #[test]
    fn measured_levels_are_found_across_the_wrap() {
        let response = PhaseResponse::measured(vec![0.5, 2.0, 4.0, 6.0]).unwrap();
        let found = [0.4, 1.2, 1.3, 5.1, 6.2, 0.05, 0.2, -3.0].map(|phase| response.nearest_level(phase));
        assert_eq!(found, [0, 0, 1, 3, 3, 3, 0, 2]);
    }

    #[test]
    fn ties_go_to_lower_level() {
        let response = PhaseResponse::measured(vec![3.0, 2.0, 1.0, 5.0]).unwrap();
        assert_eq!([1.5, 2.5, 4.0].map(|phase| response.nearest_level(phase)), [1, 0, 0]);
    }

    #[test]
    fn invalid_responses_are_refused() {
        assert!(PhaseResponse::linear(0).is_err() && PhaseResponse::linear(17).is_err());
        for bad in [vec![], vec![0.0], vec![0.0, 2.0, 4.0], vec![0.0, f64::NAN], vec![0.0, 3.1]] {
            assert!(PhaseResponse::measured(bad.clone()).is_err(), "{bad:?}");
        }
        assert_eq!(
            PhaseResponse::measured(vec![0.0; 1 << 17]).unwrap_err().to_string().split(' ').next(),
            Some("number")
        );
    }

    #[test]
    fn levels_and_phases_out_of_range_are_refused() {
        let response = PhaseResponse::linear(4).unwrap();
        assert!(response.dequantize(&Plane::filled(1, 1, 15)).is_ok());
        let error = response.dequantize(&Plane::filled(1, 1, 16)).unwrap_err();
        assert_eq!(error.to_string(), "level is 16, but must be below 2^bit_depth");
        assert!(response.quantize(&Plane::filled(1, 1, f32::NAN)).is_err());
    }

    proptest! {
        #[test]
        fn linear_levels_survive_a_round_trip(bit_depth in 1u32..=16, level: u16) {
            let response = PhaseResponse::linear(bit_depth).unwrap();
            let levels = Plane::filled(1, 1, level >> (16 - bit_depth));
            prop_assert_eq!(response.quantize(&response.dequantize(&levels).unwrap()).unwrap(), levels);
        }

        #[test]
        fn linear_phases_change_by_at_most_half_a_level(bit_depth in 1u32..=16, phase in -20.0f64..20.0) {
            let response = PhaseResponse::linear(bit_depth).unwrap();
            let back = response.phase_rad(response.nearest_level(phase)).unwrap();
            prop_assert!(apart(back, phase) <= PI / response.levels() as f64 + 1e-12);
        }

        #[test]
        fn nearest_measured_level_is_found(
            phases in proptest::collection::vec(-7.0f64..7.0, 16),
            phase in -20.0f64..20.0,
        ) {
            let phases: Vec<f64> = [0.0, 3.2].into_iter().chain(phases).take(16).collect();
            let response = PhaseResponse::measured(phases.clone()).unwrap();
            let found = apart(response.phase_rad(response.nearest_level(phase)).unwrap(), phase);
            let best = phases.iter().map(|&p| apart(p, phase)).fold(f64::MAX, f64::min);
            prop_assert!(found <= best + 1e-12);
        }

        #[test]
        fn measured_levels_survive_a_round_trip(step in 0.02f64..0.024, level in 0u16..256) {
            let response = PhaseResponse::measured((0..256).map(|i| f64::from(i) * step).collect()).unwrap();
            let levels = Plane::filled(2, 3, level);
            prop_assert_eq!(response.quantize(&response.dequantize(&levels).unwrap()).unwrap(), levels);
        }

        #[test]
        fn wrapped_phases_lie_in_one_turn(phase in -1e6f64..1e6) {
            prop_assert!((0.0..TAU).contains(&wrap(phase)));
            prop_assert!((0.0..TAU).contains(&f64::from(wrap_f32(phase))));
        }
    }
}
