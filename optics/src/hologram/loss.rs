//! Loss functions of hologram optimization and the image planes they compare.

use super::roughness::{SpeckleBlocks, WeightedRegion};
use crate::display::Detector;
use crate::engine::EngineCore;
use crate::engine::photometry::{Quantity, Sums};
use crate::engine::{Engine, Real};
use crate::error::{Error, Result};
use crate::numerics::{Plane, RegionOfInterest};
use serde::{Deserialize, Serialize};

/// Loss function of an optimization: the weighted mean over the planes of
///
/// ```text
/// Σ w (s q − t)² / Σ w  +  total_variation · V  +  speckle · S
/// ```
///
/// with q the light or its square root ([`Quantity`]), t the target or its square root, w the weights, s the gain, V
/// the total variation and S the speckle of the light relative to its own mean.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Loss {
    /// Quantity that is compared with the target: intensity (default) or amplitude.
    pub quantity: Quantity,
    /// Factor of the total variation; 0 (default) omits the term.
    pub total_variation: f64,
    /// Factor of the speckle; 0 (default) omits the term.
    pub speckle: f64,
    /// Side of the square blocks in which speckle is measured \[px\]; 8 by default.
    pub speckle_block_px: usize,
}

impl Default for Loss {
    fn default() -> Self {
        Self { quantity: Quantity::Intensity, total_variation: 0.0, speckle: 0.0, speckle_block_px: 8 }
    }
}

impl Loss {
    /// Largest factor of a term. With a larger factor the difference from the target would hardly count.
    pub const FACTOR_MAX: f64 = 1e3;
    /// Smallest side of a speckle block \[px\]. A smaller block has no meaningful contrast.
    pub const SPECKLE_BLOCK_PX_MIN: usize = 2;

    /// Checks the factors and, when the speckle term is used, the block size.
    ///
    /// # Errors
    ///
    /// [`Error::OutOfRange`] for a factor that is not between 0 and [`Self::FACTOR_MAX`], or blocks that are smaller
    /// than [`Self::SPECKLE_BLOCK_PX_MIN`] or do not fit into the region.
    pub fn validate(&self, region: RegionOfInterest) -> Result<()> {
        for (name, value) in [("total_variation", self.total_variation), ("speckle", self.speckle)] {
            if !(0.0..=Self::FACTOR_MAX).contains(&value) {
                return Err(Error::OutOfRange { name, value, allowed: "0 to 1000" });
            }
        }
        let largest = region.height_px().min(region.width_px());
        if self.speckle > 0.0 && !(Self::SPECKLE_BLOCK_PX_MIN..=largest).contains(&self.speckle_block_px) {
            let allowed = "at least 2 px, and inside the region of interest";
            return Err(Error::OutOfRange { name: "speckle_block_px", value: self.speckle_block_px as f64, allowed });
        }
        Ok(())
    }

    /// Whether the loss contains a term that compares neighbouring pixels.
    pub(super) fn has_roughness(&self) -> bool {
        self.total_variation > 0.0 || self.speckle > 0.0
    }
}

/// Target picture of a hologram at one distance.
#[derive(Clone, Debug)]
pub struct ImagePlane {
    /// Engine that models the display at the picture's distance.
    pub engine: Engine,
    /// Target intensity in linear light, of the engine's size.
    pub target: Plane<f32>,
    /// Weight of each pixel in the loss, 0 or above; `None`: all pixels have the same weight.
    pub weight: Option<Plane<f32>>,
    /// Weight of this plane among several planes, above 0.
    pub share: f64,
}

impl ImagePlane {
    /// Image plane in which all pixels have the same weight, with a share of 1.
    #[must_use]
    pub fn new(engine: Engine, target: Plane<f32>) -> Self {
        Self { engine, target, weight: None, share: 1.0 }
    }
}

/// An [`ImagePlane`] in the precision `T` of an engine, not checked yet.
#[derive(Debug)]
pub(super) struct PlaneInput<T> {
    pub(super) engine: EngineCore<T>,
    pub(super) target: Plane<T>,
    pub(super) weight: Option<Plane<T>>,
    pub(super) share: f64,
}

impl<T: Real> PlaneInput<T> {
    pub(super) fn unchecked(&self) -> UncheckedPlane<'_, T> {
        UncheckedPlane {
            size_px: [self.engine.height_px(), self.engine.width_px()],
            detector: self.engine.detector(),
            target: &self.target,
            weight: self.weight.as_ref(),
            share: self.share,
        }
    }
}

impl From<ImagePlane> for PlaneInput<f32> {
    fn from(ImagePlane { engine, target, weight, share }: ImagePlane) -> Self {
        Self { engine: engine.core, target, weight, share }
    }
}

/// A checked image plane with the data that its loss needs.
#[derive(Debug)]
pub(super) struct TargetPlane<T> {
    pub(super) engine: EngineCore<T>,
    /// Engines of the display with each mode of its light alone.
    pub(super) modes: Vec<EngineCore<T>>,
    /// Target of q: t or √t.
    pub(super) picture: Plane<T>,
    pub(super) weight: Option<Plane<T>>,
    /// Whether the picture holds √t.
    pub(super) compares_amplitudes: bool,
    /// Sum of the weights over the region, Σ w.
    pub(super) weight_sum: f64,
    /// Share of the plane in the loss; the shares of all planes sum to 1.
    pub(super) share: f64,
    pub(super) blocks: Option<SpeckleBlocks>,
}

impl<T: Real> TargetPlane<T> {
    /// Takes a plane that [`check_planes`] has checked.
    pub(super) fn new(plane: PlaneInput<T>, region: RegionOfInterest, loss: &Loss, shares: f64) -> Self {
        let PlaneInput { engine, target, weight, share } = plane;
        let weight_sum = weight_sum(weight.as_ref(), region);
        let blocks = (loss.speckle > 0.0).then(|| {
            let extent = WeightedRegion { region, weight: weight.as_ref(), weight_sum };
            SpeckleBlocks::new(&extent, &target, loss.speckle_block_px)
        });
        let picture = match loss.quantity {
            Quantity::Intensity => target,
            Quantity::Amplitude => target.map(T::sqrt),
        };
        let compares_amplitudes = loss.quantity == Quantity::Amplitude;
        let modes = engine.modes().collect();
        Self { engine, modes, picture, weight, compares_amplitudes, weight_sum, share: share / shares, blocks }
    }

    pub(super) fn extent(&self, region: RegionOfInterest) -> WeightedRegion<'_, T> {
        WeightedRegion { region, weight: self.weight.as_ref(), weight_sum: self.weight_sum }
    }
}

/// What [`check_planes`] reads of an image plane.
#[derive(Clone, Copy, Debug)]
pub(super) struct UncheckedPlane<'a, T> {
    pub(super) size_px: [usize; 2],
    pub(super) detector: Detector,
    pub(super) target: &'a Plane<T>,
    pub(super) weight: Option<&'a Plane<T>>,
    pub(super) share: f64,
}

/// Checks a problem, see [`HologramProblem::with_planes`](super::HologramProblem::with_planes).
pub(super) fn check_planes<T: Real>(
    planes: &[UncheckedPlane<'_, T>],
    frames: usize,
    region: RegionOfInterest,
    loss: &Loss,
) -> Result<()> {
    loss.validate(region)?;
    let Some(first) = planes.first() else {
        return Err(Error::Empty { name: "planes", needed: "at least one picture is needed" });
    };
    if frames == 0 {
        return Err(Error::OutOfRange { name: "frames", value: 0.0, allowed: "at least 1" });
    }
    for plane in planes {
        plane.target.expect_size("target_intensity", first.size_px[0], first.size_px[1])?;
        if plane.detector != first.detector {
            return Err(Error::Incompatible { name: "planes", reason: "all planes must have the same detector" });
        }
    }
    planes.iter().try_for_each(|plane| plane.check(region))?;
    if !planes.iter().any(|plane| plane.is_lit(region)) {
        let needed = "some light is needed in the region of interest";
        return Err(Error::Empty { name: "target_intensity", needed });
    }
    Ok(())
}

impl<T: Real> UncheckedPlane<'_, T> {
    fn check(&self, region: RegionOfInterest) -> Result<()> {
        expect_light("target_intensity", self.target, self.size_px)?;
        if let Some(weight) = self.weight {
            expect_light("weight", weight, self.size_px)?;
        }
        if weight_sum(self.weight, region) <= 0.0 {
            return Err(Error::Empty {
                name: "weight",
                needed: "at least one pixel of the region of interest must have a positive weight",
            });
        }
        if !(self.share > 0.0 && self.share.is_finite()) {
            return Err(Error::OutOfRange { name: "share", value: self.share, allowed: "above 0" });
        }
        Ok(())
    }

    /// Whether the target has a bright pixel with a positive weight in the region.
    fn is_lit(&self, region: RegionOfInterest) -> bool {
        let lit = |y: usize, x: usize| {
            self.target.at(y, x) > T::zero() && self.weight.is_none_or(|weight| weight.at(y, x) > T::zero())
        };
        (0..self.target.height_px()).any(|y| region.columns(y).is_some_and(|mut columns| columns.any(|x| lit(y, x))))
    }
}

/// Sum of the weights over the region, Σ w.
fn weight_sum<T: Real>(weight: Option<&Plane<T>>, region: RegionOfInterest) -> f64 {
    let pixels = (region.y_px()..region.y_px() + region.height_px())
        .flat_map(|y| (region.x_px()..region.x_px() + region.width_px()).map(move |x| (y, x)));
    match weight {
        None => region.pixels() as f64,
        Some(weight) => pixels.map(|(y, x)| weight.at(y, x).wide()).sum(),
    }
}

/// Checks that a plane has the display's size and that its values are finite and not negative.
fn expect_light<T: Real>(name: &'static str, plane: &Plane<T>, [height_px, width_px]: [usize; 2]) -> Result<()> {
    plane.expect_size(name, height_px, width_px)?;
    plane.map(|t| t.wide() as f32).expect_finite(name)?;
    match plane.values().iter().find(|value| **value < T::zero()) {
        None => Ok(()),
        Some(&value) => Err(Error::OutOfRange { name, value: value.wide(), allowed: "0 or above" }),
    }
}

/// Adds the sums of several planes, each weighted by its share of the loss.
pub(super) fn weighted_sums(planes: usize, mut sums_of: impl FnMut(usize) -> (Sums, f64)) -> Sums {
    let mut all = Sums::default();
    for p in 0..planes {
        let (mut sums, share) = sums_of(p);
        // The sums of a single plane are not divided, so that they keep their exact bits.
        if planes > 1 {
            sums.divide(sums.w / share);
        }
        all.add(&sums);
    }
    all
}
