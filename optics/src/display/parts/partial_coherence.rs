//! Partial coherence: light of several modes that do not interfere.
//!
//! ```text
//! I = Σ_m w_m | F⁻¹[ H_m F c ] |²,   H_0 = H,   H_m = H · exp( α_m + iψ_m ),   Σ_m w_m = 1
//! ```
//!
//! A source with an extent lights the SLM from several directions: each moves the image by direction times distance,
//! which is a tilt of ψ. A source of several wavelengths focuses each at another distance, which is a parabola. So
//! smooth fields of second order hold both. Any source is a sum of coherent modes (E. Wolf, J. Opt. Soc. Am. 72, 343
//! (1982)), and a few of them describe a display with a partially coherent source (S. Choi et al., Nature 629, 791
//! (2024)).

use super::layout::{Layout, field, of_field};
use super::measures::{Measures, Scale, Unit};
use super::stored::{Entry, Restored, Stored, StoredError, StoredParts};
use super::terms::{Dear, Terms, Turn};
use super::{Block, InBins, Part};
use crate::display::DisplayModel;
use crate::error::Result;
use crate::numerics::SmoothField;
use crate::numerics::chebyshev::ChebyshevBasis;
use crate::numerics::smooth_field::out_of_range;
use std::f64::consts::PI;

/// Limits of the logarithm of a mode's light relative to that of the first mode.
const LOG_LIGHT: (f64, f64) = (-7.0, 3.0);
/// Least relative decrease of the validation loss by which learning keeps further modes, which make every hologram three
/// times as expensive.
const GAIN_MIN: f64 = 0.3;
/// Names of the stored arrays.
const LIGHT: &str = "mode.light";
const ERRORS: [&str; 2] = ["mode.log_amplitude", "mode.phase"];

/// Light of a display that does not interfere with that of its first mode.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PartialCoherence {
    modes: Vec<FurtherMode>,
}

/// A further mode of a display's light.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FurtherMode {
    /// Its light relative to that of the first mode.
    pub light: f64,
    /// Its transfer function relative to the kernel, over the band.
    pub errors: SmoothField,
}

impl PartialCoherence {
    /// Most further modes.
    pub const MODES_MAX: usize = 5;

    /// No further mode: coherent light.
    #[must_use]
    pub fn none() -> Self {
        Self::default()
    }

    /// Light with further modes.
    #[must_use]
    pub fn new(modes: Vec<FurtherMode>) -> Self {
        Self { modes }
    }

    /// Whether all light interferes.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.modes.is_empty()
    }

    /// The further modes.
    #[must_use]
    pub fn modes(&self) -> &[FurtherMode] {
        &self.modes
    }

    /// Part w of the light of each mode, the first mode included.
    #[must_use]
    pub fn shares(&self) -> Vec<f64> {
        let lights = || std::iter::once(1.0).chain(self.modes.iter().map(|mode| mode.light));
        let total: f64 = lights().sum();
        lights().map(|light| light / total).collect()
    }

    /// Mean of the logarithms of the modes' transfer functions relative to the kernel, weighted by their light.
    #[must_use]
    pub fn mean_errors(&self) -> SmoothField {
        let order = self.modes.iter().map(|mode| mode.errors.order).max().unwrap_or(0);
        let mut mean = SmoothField::flat(order);
        self.modes.iter().zip(&self.shares()[1..]).for_each(|(mode, &share)| mean.add(share, &mode.errors));
        mean
    }

    /// Standard deviation of the places of the modes' images along x and along y \[px\].
    #[must_use]
    pub fn spread_px(&self) -> [f64; 2] {
        let shares = self.shares();
        [(1, 0), (0, 1)].map(|wanted| {
            let shift_px = |FurtherMode { errors, .. }: &FurtherMode| {
                let term = errors.basis().degrees().position(|degrees| degrees == wanted);
                term.map_or(0.0, |term| errors.phase[term] / PI)
            };
            let shifts: Vec<f64> = std::iter::once(0.0).chain(self.modes.iter().map(shift_px)).collect();
            let mean: f64 = shares.iter().zip(&shifts).map(|(share, shift)| share * shift).sum();
            shares.iter().zip(&shifts).map(|(share, shift)| share * (shift - mean).powi(2)).sum::<f64>().sqrt()
        })
    }

    pub(crate) fn validate(&self) -> Result<()> {
        if self.modes.len() > Self::MODES_MAX {
            return Err(out_of_range("modes of light", self.modes.len() as f64 + 1.0, "at most 6"));
        }
        for FurtherMode { light, errors } in &self.modes {
            if !(light.is_finite() && *light >= 0.0) {
                return Err(out_of_range("light of a mode", *light, "0 or above"));
            }
            errors.validate()?;
        }
        Ok(())
    }
}

/// Its numbers are, for each further mode, ln(w_m/w_0), α_m and ψ_m.
pub(super) struct Row;

impl Part for Row {
    fn name(&self) -> &'static str {
        "partial_coherence"
    }

    fn title(&self) -> &'static str {
        "further modes of the light, which do not interfere"
    }

    fn is_in(&self, model: &DisplayModel) -> bool {
        !model.coherence.is_none()
    }

    fn remove(&self, model: &mut DisplayModel) {
        *model = model.in_one_mode();
    }

    fn store(&self, model: &DisplayModel, to: &mut Stored) {
        let modes = model.coherence.modes();
        if !modes.is_empty() {
            to.sometimes("mode_orders", Entry::Orders(modes.iter().map(|mode| mode.errors.order).collect()));
            to.list(LIGHT, &modes.iter().map(|mode| mode.light).collect::<Vec<_>>());
            to.fields(ERRORS, &[], modes.iter().map(|mode| &mode.errors));
        }
    }

    fn restore(&self, from: &dyn StoredParts, model: &mut DisplayModel) -> Restored {
        let orders = from.orders("mode_orders")?;
        if orders.is_empty() {
            return Ok(());
        }
        let refused =
            |name| Err(StoredError::Array { name, expected: "f64 with the numbers of all modes in `mode_orders`" });
        // Coefficients of such an order would be made before the field is refused.
        if orders.iter().any(|&order| order > ChebyshevBasis::ORDER_MAX) {
            return refused(ERRORS[1]);
        }
        let lights = from.f64s(LIGHT)?;
        // The header may list more modes than the file has, and each would take time and memory below.
        if lights.len() != orders.len() {
            return refused(LIGHT);
        }
        let SmoothField { log_amplitude, phase, .. } = from.field(0, ERRORS)?;
        let terms = orders.iter().map(|&order| ChebyshevBasis::new(order).terms());
        let all: usize = terms.clone().sum();
        let found = [(ERRORS[0], log_amplitude.len(), all), (ERRORS[1], phase.len(), all)];
        if let Some((name, ..)) = found.into_iter().find(|(_, found, expected)| found != expected) {
            return refused(name);
        }
        let mut start = 0;
        let errors = orders.iter().zip(terms).map(|(&order, terms)| {
            let range = start..start + terms;
            start = range.end;
            SmoothField { order, log_amplitude: log_amplitude[range.clone()].to_vec(), phase: phase[range].to_vec() }
        });
        let modes = lights.into_iter().zip(errors).map(|(light, errors)| FurtherMode { light, errors });
        model.coherence = PartialCoherence::new(modes.collect());
        Ok(())
    }

    fn in_bins(&self) -> InBins {
        InBins::Lost
    }

    fn count(&self, layout: &Layout) -> usize {
        layout.modes * (1 + 2 * layout.mode.terms())
    }

    fn numbers(&self, layout: &Layout, model: &DisplayModel) -> Vec<f64> {
        let of_mode = |m| {
            let mode: Option<&FurtherMode> = model.coherence.modes().get(m);
            let light = mode.map_or(LOG_LIGHT.0, |mode| mode.light.ln().clamp(LOG_LIGHT.0, LOG_LIGHT.1));
            std::iter::once(light).chain(of_field(layout.mode, mode.map(|mode| &mode.errors)))
        };
        (0..layout.modes).flat_map(of_mode).collect()
    }

    fn set(&self, layout: &Layout, numbers: &[f64], model: &mut DisplayModel) {
        let modes = numbers.chunks_exact(1 + 2 * layout.mode.terms());
        let mode = |mode: &[f64]| FurtherMode { light: mode[0].exp(), errors: field(layout.mode, &mode[1..]) };
        model.coherence = PartialCoherence::new(modes.map(mode).collect());
    }

    fn has_form_of(&self, layout: &Layout, model: &DisplayModel) -> bool {
        let modes = model.coherence.modes();
        modes.len() == layout.modes && modes.iter().all(|mode| mode.errors.order == layout.mode.order())
    }

    fn limited(&self, layout: &Layout, position: usize, value: f64) -> f64 {
        let is_light = position.is_multiple_of(1 + 2 * layout.mode.terms());
        if is_light { value.clamp(LOG_LIGHT.0, LOG_LIGHT.1) } else { value }
    }

    fn terms(&self) -> Option<Terms> {
        Some(Terms {
            dear: Some(Dear { hopeful: 1.0 / 3.0, replaces: Block::LightBlur, loss_max: 1.25 }),
            ..Terms::new(Turn::First, GAIN_MIN, GAIN_MIN)
        })
    }

    fn measures(&self) -> &'static Measures {
        &Measures {
            phrase: "the places of their images spread by σ {} along x, {} along y",
            scales: &[
                Scale { name: "spread_x", unit: Unit::Pixels, digits: 2 },
                Scale { name: "spread_y", unit: Unit::Pixels, digits: 2 },
            ],
            note: "Pictures of the kernel show its first mode.",
        }
    }

    fn strengths(&self, model: &DisplayModel) -> Vec<f64> {
        model.coherence.spread_px().to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mode with a light and a shift along x \[px\].
    fn mode(light: f64, shift_px: f64) -> FurtherMode {
        let mut errors = SmoothField::flat(2);
        let along_x = errors.basis().degrees().position(|degrees| degrees == (1, 0)).unwrap();
        errors.phase[along_x] = PI * shift_px;
        FurtherMode { light, errors }
    }

    #[test]
    fn shares_and_spread_are_those_of_the_modes() {
        let light = PartialCoherence::new(vec![mode(0.5, 2.0), mode(0.5, -2.0)]);
        assert_eq!(light.shares(), [0.5, 0.25, 0.25]);
        let [x, y] = light.spread_px();
        assert!((x - 2f64.sqrt()).abs() < 1e-12 && y == 0.0, "{x} {y}");
        assert_eq!((PartialCoherence::none().shares(), PartialCoherence::none().spread_px()), (vec![1.0], [0.0; 2]));
    }

    #[test]
    fn impossible_modes_are_refused() {
        assert!(PartialCoherence::new(vec![mode(0.5, 2.0); 5]).validate().is_ok());
        assert!(PartialCoherence::new(vec![mode(0.5, 2.0); 6]).validate().is_err());
        assert!(PartialCoherence::new(vec![mode(-0.1, 2.0)]).validate().is_err());
        assert!(PartialCoherence::new(vec![mode(f64::NAN, 2.0)]).validate().is_err());
        assert!(PartialCoherence::new(vec![mode(0.5, f64::INFINITY)]).validate().is_err());
    }
}
