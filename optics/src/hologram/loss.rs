//! What an optimization minimizes.

use super::roughness::{Extent, SpeckleBlocks};
use crate::convolution::Real;
use crate::engine::EngineCore;
use crate::photometry::{Quantity, Sums};
use crate::{Engine, Error, Plane, RegionOfInterest, Result};
use serde::{Deserialize, Serialize};

/// What is minimized: the mean over the planes of
///
/// ```text
/// Σ w (s q − t)² / Σ w  +  total_variation · V  +  speckle · S
/// ```
///
/// with q the light or its square root ([`Quantity`]), t the target likewise, s the gain, and V and S the roughness of the
/// light relative to its own mean.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Loss {
    /// What is compared with the target.
    pub quantity: Quantity,
    /// Factor of the total variation; 0 leaves it out.
    pub total_variation: f64,
    /// Factor of the speckle; 0 leaves it out.
    pub speckle: f64,
    /// Side of the blocks in which speckle is measured \[px\].
    pub speckle_block_px: usize,
}

impl Default for Loss {
    fn default() -> Self {
        Self { quantity: Quantity::Intensity, total_variation: 0.0, speckle: 0.0, speckle_block_px: 8 }
    }
}

impl Loss {
    /// Largest factor of a term: beyond it the picture would not count.
    pub const FACTOR_MAX: f64 = 1e3;
    /// Smallest side of a speckle block \[px\]: fewer pixels have no contrast to speak of.
    pub const SPECKLE_BLOCK_PX_MIN: usize = 2;

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

    /// Whether neighbouring pixels are looked at.
    pub(super) fn has_roughness(&self) -> bool {
        self.total_variation > 0.0 || self.speckle > 0.0
    }
}

/// One picture that a hologram is to show.
#[derive(Clone, Debug)]
pub struct ImagePlane {
    /// The display, at the picture's distance.
    pub engine: Engine,
    /// Intensity in linear light, of the engine's size.
    pub target: Plane<f32>,
    /// How much each pixel counts, 0 or above; `None`: all the same.
    pub weight: Option<Plane<f32>>,
    /// How much this plane counts among several, above 0.
    pub share: f64,
}

impl ImagePlane {
    /// A plane that counts everywhere.
    #[must_use]
    pub fn new(engine: Engine, target: Plane<f32>) -> Self {
        Self { engine, target, weight: None, share: 1.0 }
    }
}

/// An [`ImagePlane`] in the precision of an engine.
#[derive(Debug)]
pub(super) struct Asked<T> {
    pub(super) engine: EngineCore<T>,
    pub(super) target: Plane<T>,
    pub(super) weight: Option<Plane<T>>,
    pub(super) share: f64,
}

impl From<ImagePlane> for Asked<f32> {
    fn from(ImagePlane { engine, target, weight, share }: ImagePlane) -> Self {
        Self { engine: engine.core, target, weight, share }
    }
}

/// An image plane, checked, with what its loss needs.
#[derive(Debug)]
pub(super) struct Wanted<T> {
    pub(super) engine: EngineCore<T>,
    /// What q is compared with: t or √t.
    pub(super) picture: Plane<T>,
    pub(super) weight: Option<Plane<T>>,
    /// The picture holds √t.
    pub(super) compares_amplitudes: bool,
    /// Σ w
    pub(super) weight_sum: f64,
    /// The plane's part of the loss; all of them sum to 1.
    pub(super) share: f64,
    pub(super) blocks: Option<SpeckleBlocks>,
}

impl<T: Real> Wanted<T> {
    pub(super) fn new(plane: Asked<T>, region: RegionOfInterest, loss: &Loss, shares: f64) -> Result<Self> {
        let Asked { engine, target, weight, share } = plane;
        expect_light("target_intensity", &target, &engine)?;
        if let Some(weight) = &weight {
            expect_light("weight", weight, &engine)?;
        }
        let counts = |y: usize, x: usize| weight.as_ref().map_or(T::one(), |weight| weight.at(y, x));
        let pixels = || {
            (region.y_px()..region.y_px() + region.height_px())
                .flat_map(|y| (region.x_px()..region.x_px() + region.width_px()).map(move |x| (y, x)))
        };
        let weight_sum = match &weight {
            None => region.pixels() as f64,
            Some(_) => pixels().map(|(y, x)| counts(y, x).wide()).sum(),
        };
        if weight_sum <= 0.0 {
            return Err(Error::Empty { name: "weight", needed: "some pixel of the region of interest must count" });
        }
        if !(share > 0.0 && share.is_finite()) {
            return Err(Error::OutOfRange { name: "share", value: share, allowed: "above 0" });
        }
        let blocks = (loss.speckle > 0.0).then(|| {
            let extent = Extent { region, weight: weight.as_ref(), weight_sum };
            SpeckleBlocks::new(&extent, &target, loss.speckle_block_px)
        });
        let picture = match loss.quantity {
            Quantity::Intensity => target,
            Quantity::Amplitude => target.map(T::sqrt),
        };
        let compares_amplitudes = loss.quantity == Quantity::Amplitude;
        Ok(Self { engine, picture, weight, compares_amplitudes, weight_sum, share: share / shares, blocks })
    }

    /// Whether there is light that counts.
    pub(super) fn is_lit(&self, region: RegionOfInterest) -> bool {
        let lit = |y: usize, x: usize| {
            self.picture.at(y, x) > T::zero() && self.weight.as_ref().is_none_or(|weight| weight.at(y, x) > T::zero())
        };
        (0..self.picture.height_px()).any(|y| region.columns(y).is_some_and(|mut columns| columns.any(|x| lit(y, x))))
    }

    pub(super) fn extent(&self, region: RegionOfInterest) -> Extent<'_, T> {
        Extent { region, weight: self.weight.as_ref(), weight_sum: self.weight_sum }
    }
}

/// A plane of the engine's size, finite, nowhere negative.
fn expect_light<T: Real>(name: &'static str, plane: &Plane<T>, engine: &EngineCore<T>) -> Result<()> {
    plane.expect_size(name, engine.height_px(), engine.width_px())?;
    plane.map(|t| t.wide() as f32).expect_finite(name)?;
    match plane.values().iter().find(|value| **value < T::zero()) {
        None => Ok(()),
        Some(&value) => Err(Error::OutOfRange { name, value: value.wide(), allowed: "0 or above" }),
    }
}

/// The sums of several planes as one: each counts by its share of the loss.
pub(super) fn weighted_sums(planes: usize, mut sums_of: impl FnMut(usize) -> (Sums, f64)) -> Sums {
    let mut all = Sums::default();
    for p in 0..planes {
        let (mut sums, share) = sums_of(p);
        // One plane's sums stay as they are, to the last bit.
        if planes > 1 {
            sums.divide(sums.w / share);
        }
        all.add(&sums);
    }
    all
}
