//! The row of a part that is a blur. Its numbers in θ are q along x and along y, and its strength is σ.

use super::blur_ratios::BlurRatios;
use super::layout::Layout;
use super::measures::{Deviation, Hidden, Measures, Scale, Unit};
use super::stored::{Entry, Restored, Stored, StoredParts};
use super::terms::Terms;
use super::{Block, Part};
use crate::display::DisplayModel;
use crate::numerics::gaussian_blur::sigma_px_of_ratio;

pub(super) struct BlurRow<const TAPS: usize> {
    pub(super) block: Block,
    /// Name as it is stored, also that of the array with q.
    pub(super) name: &'static str,
    pub(super) title: &'static str,
    /// Entry of the header that says that a display has the part.
    pub(super) entry: &'static str,
    pub(super) ratio_max: f64,
    pub(super) of: fn(&DisplayModel) -> BlurRatios<TAPS>,
    pub(super) of_mut: fn(&mut DisplayModel) -> &mut BlurRatios<TAPS>,
    pub(super) terms: Terms,
    pub(super) measures: &'static Measures,
    pub(super) hidden: Option<Hidden>,
}

impl<const TAPS: usize> Part for BlurRow<TAPS> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn title(&self) -> &'static str {
        self.title
    }

    fn is_in(&self, model: &DisplayModel) -> bool {
        !(self.of)(model).is_none()
    }

    fn remove(&self, model: &mut DisplayModel) {
        *(self.of_mut)(model) = BlurRatios::NONE;
    }

    fn store(&self, model: &DisplayModel, to: &mut Stored) {
        if self.is_in(model) {
            to.sometimes(self.entry, Entry::Flag(true));
            to.list(self.name, &(self.of)(model).ratios());
        }
    }

    fn restore(&self, from: &dyn StoredParts, model: &mut DisplayModel) -> Restored {
        if from.flag(self.entry)? {
            *(self.of_mut)(model) = BlurRatios::of_ratios(from.exactly(self.name, "two f64")?);
        }
        Ok(())
    }

    fn count(&self, layout: &Layout) -> usize {
        if layout.blocks.contains(self.block) { 2 } else { 0 }
    }

    fn numbers(&self, layout: &Layout, model: &DisplayModel) -> Vec<f64> {
        (self.of)(model).ratios().into_iter().take(self.count(layout)).collect()
    }

    fn set(&self, _layout: &Layout, numbers: &[f64], model: &mut DisplayModel) {
        *(self.of_mut)(model) = numbers.first_chunk().map_or(BlurRatios::NONE, |&ratios| BlurRatios::of_ratios(ratios));
    }

    fn limited(&self, _layout: &Layout, _position: usize, value: f64) -> f64 {
        value.clamp(0.0, self.ratio_max)
    }

    fn terms(&self) -> Option<Terms> {
        Some(self.terms)
    }

    fn measures(&self) -> &'static Measures {
        self.measures
    }

    fn strengths(&self, model: &DisplayModel) -> Vec<f64> {
        (self.of)(model).sigma_px().to_vec()
    }

    fn deviations(&self, _layout: &Layout, model: &DisplayModel, deviation: Deviation<'_>) -> Option<Vec<f64>> {
        Some(deviations_px((self.of)(model).ratios(), deviation))
    }

    fn hidden(&self) -> Option<Hidden> {
        self.hidden
    }
}

/// Largest q of any blur.
pub(super) const RATIO_MAX: f64 = 0.88;
/// σ along x and along y.
const SCALES: &[Scale] = &[
    Scale { name: "sigma_x", unit: Unit::Pixels, digits: 2 },
    Scale { name: "sigma_y", unit: Unit::Pixels, digits: 2 },
];
/// The measures of a blur.
pub(super) const MEASURES: Measures = Measures { phrase: "σ {} along x, {} along y", scales: SCALES, note: "" };

/// Standard deviation of the σ of a blur along x and along y \[px\] with these q: half the distance between the σ of
/// the limits of q, because σ changes infinitely fast at q = 0.
fn deviations_px(ratios: [f64; 2], deviation: Deviation<'_>) -> Vec<f64> {
    let deviations = ratio_deviations(deviation);
    let moved = |by: f64| sigma_px(std::array::from_fn(|axis| ratios[axis] + by * deviations[axis]));
    let (most, least) = (moved(1.0), moved(-1.0));
    (0..2).map(|axis| (most[axis] - least[axis]) / 2.0).collect()
}

/// σ of the strongest blur that could be hidden along x and along y \[px\].
pub(super) fn hidden_px(most: Deviation<'_>) -> Vec<f64> {
    sigma_px(ratio_deviations(most)).to_vec()
}

/// Standard deviation of q along x and along y.
fn ratio_deviations(deviation: Deviation<'_>) -> [f64; 2] {
    [&[1.0, 0.0], &[0.0, 1.0]].map(|slopes| deviation(slopes))
}

/// σ along x and along y \[px\] of a blur with these q, moved into the limits of a blur.
fn sigma_px(ratios: [f64; 2]) -> [f64; 2] {
    ratios.map(|q| sigma_px_of_ratio(q.clamp(0.0, RATIO_MAX)))
}
