//! Pairs of a hologram and its photograph.

use crate::engine::Real;
use crate::engine::photometry::{Comparison, Quantity, Sums};
use crate::engine::{Engine, EngineCore, Fields};
use crate::error::Error;
use crate::numerics::buffers::zeros;
use crate::numerics::{Plane, RegionOfInterest};

/// Values of a photograph from which on a pixel counts as saturated: the camera's highest level 255, less a quarter
/// level.
pub(super) const SATURATION: f32 = 254.75 / 255.0;

/// A hologram and its photograph.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// The hologram's phase \[rad\], before the carrier.
    pub phase: Plane<f32>,
    /// The photograph: intensity in linear light, 1 at the camera's full scale.
    pub photo: Plane<f32>,
}

/// Any error while pairs are read or learned from: an error of this crate or of the pair source.
pub type BoxError = Box<dyn std::error::Error + Send + Sync>;

/// A source of pairs: memory, or files that are read on demand.
pub trait PairSource: Sync {
    /// Number of pairs.
    fn len(&self) -> usize;

    /// Whether the source has no pairs.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Index of the learner's setup with which the pair `index` was photographed. Pairs of one setup must be
    /// consecutive.
    fn plane(&self, _index: usize) -> usize {
        0
    }

    /// The pair `index`.
    ///
    /// # Errors
    ///
    /// When the pair cannot be read.
    fn pair(&self, index: usize) -> Result<Pair, BoxError>;
}

impl PairSource for [Pair] {
    fn len(&self) -> usize {
        <[Pair]>::len(self)
    }

    fn pair(&self, index: usize) -> Result<Pair, BoxError> {
        Ok(self[index].clone())
    }
}

impl PairSource for Vec<Pair> {
    fn len(&self) -> usize {
        self.as_slice().len()
    }

    fn pair(&self, index: usize) -> Result<Pair, BoxError> {
        self.as_slice().pair(index)
    }
}

/// A pair in the precision of an engine, with the weights of its pixels.
#[derive(Debug)]
pub(super) struct Example<T> {
    pub(super) phase: Plane<T>,
    pub(super) photo: Plane<T>,
    pub(super) weight: Plane<T>,
    weight_sum: f64,
    pub(super) region: RegionOfInterest,
}

impl<T: Real> Example<T> {
    pub(super) fn new(pair: &Pair, engine: &EngineCore<T>, region: RegionOfInterest) -> Result<Self, Error> {
        for (name, plane) in [("phase", &pair.phase), ("photo", &pair.photo)] {
            plane.expect_size(name, engine.height_px(), engine.width_px())?;
            plane.expect_finite(name)?;
        }
        let weight = pair.photo.map(|value| if is_saturated(value) { T::zero() } else { T::one() });
        let weight_sum = unsaturated_px(&pair.photo, region) as f64;
        if weight_sum == 0.0 {
            return Err(Error::Saturated);
        }
        let widen = |plane: &Plane<f32>| plane.map(|value| T::of(f64::from(value)));
        Ok(Self { phase: widen(&pair.phase), photo: widen(&pair.photo), weight, weight_sum, region })
    }

    pub(super) fn comparison(&self, engine: &EngineCore<T>, gain: f64, offset: f64) -> Comparison<'_, T> {
        Comparison {
            quantity: Quantity::Intensity,
            picture: &self.photo,
            weight: Some(&self.weight),
            region: self.region,
            detector: engine.detector,
            gain,
            offset,
            weight_sum: self.weight_sum,
        }
    }
}

/// Photometric sums of each pair at gain 1 and offset 0.
pub(super) fn measure_each<T: Real>(
    engine: &EngineCore<T>,
    fields: &mut Fields<T>,
    pairs: &dyn PairSource,
    region: RegionOfInterest,
) -> Result<Vec<Sums>, BoxError> {
    (0..pairs.len()).map(|index| Ok(measure(engine, fields, &pairs.pair(index)?, region)?)).collect()
}

/// Photometric sums of one pair at gain 1 and offset 0.
pub(super) fn measure<T: Real>(
    engine: &EngineCore<T>,
    fields: &mut Fields<T>,
    pair: &Pair,
    region: RegionOfInterest,
) -> Result<Sums, Error> {
    let example = Example::new(pair, engine, region)?;
    let comparison = example.comparison(engine, 1.0, 0.0);
    if !engine.needs_all_light() {
        engine.send(example.phase.values(), fields);
        return Ok(engine.convolver.measure(&fields.tiles, &comparison));
    }
    let mut lights = zeros(engine.detector.light_planes() * engine.height_px() * engine.width_px());
    for (m, mode) in engine.modes().enumerate() {
        mode.send(example.phase.values(), fields);
        mode.convolver.add_light(&fields.tiles, mode.share, m == 0, None, &mut lights);
    }
    engine.blur_lights(&mut lights, &mut Vec::new());
    Ok(engine.convolver.measure_lights(&comparison, &lights))
}

/// Adds up the sums of several pairs; the result gives the gain and offset that fit all of them best.
pub(super) fn total<'a>(each: impl IntoIterator<Item = &'a Sums>) -> Sums {
    each.into_iter().fold(Sums::default(), |mut total, sums| {
        total.add(sums);
        total
    })
}

/// Compares the light that an engine predicts for a pair with its photograph, at gain 1 and offset 0. As in learning,
/// only pixels of the region where the photograph is not saturated count.
///
/// # Errors
///
/// [`Error`] for a pair of another size, with values that are not finite, or without an unsaturated pixel in the
/// region.
pub fn compare(engine: &Engine, pair: &Pair, region: RegionOfInterest) -> Result<Sums, Error> {
    measure(&engine.core, &mut Fields::new(&engine.core), pair, region)
}

/// Number of pixels of the region where the photograph is not saturated. Only these count in learning and in
/// [`compare`].
#[must_use]
pub fn unsaturated_px(photo: &Plane<f32>, region: RegionOfInterest) -> usize {
    let in_row = |y: usize| {
        let columns = region.columns(y).unwrap_or_default();
        photo.row(y)[columns].iter().filter(|&&value| !is_saturated(value)).count()
    };
    (0..photo.height_px()).map(in_row).sum()
}

fn is_saturated(value: f32) -> bool {
    value >= SATURATION
}

/// The training pairs and the validation pairs.
#[derive(Clone, Copy)]
pub struct LearningPairs<'a> {
    /// Pairs that the model is fitted to.
    pub training: &'a dyn PairSource,
    /// Pairs that choose the degree and decide when learning ends; may be empty. Only parametric models use them.
    pub validation: &'a dyn PairSource,
}

impl std::fmt::Debug for LearningPairs<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "LearningPairs({} training, {} validation)", self.training.len(), self.validation.len())
    }
}

impl<'a> LearningPairs<'a> {
    /// Training pairs without validation pairs.
    #[must_use]
    pub fn training_only(training: &'a dyn PairSource) -> Self {
        Self { training, validation: &NO_PAIRS }
    }
}

/// An empty set of pairs.
static NO_PAIRS: Vec<Pair> = Vec::new();

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::{Detector, DisplayModel, OpticalSetup};
    use crate::hologram::initial_phase;
    use crate::numerics::Grid;

    fn engine() -> Engine {
        let setup = OpticalSetup::try_new(Grid::try_new(40, 56, 8e-6).unwrap(), 515e-9, 2e-3).unwrap();
        Engine::new(&DisplayModel::ideal(setup), Detector::Pixel, None).unwrap()
    }

    /// A hologram and the photograph of its light by a camera that clips at 1, with the brightest light at `peak`.
    fn clipped(engine: &Engine, peak: f32) -> Pair {
        let phase = initial_phase(40, 56, 6.0, 5).unwrap();
        let light = engine.light(&phase).unwrap();
        let brightest = light.values().iter().copied().fold(0.0, f32::max);
        Pair { phase, photo: light.map(|value| (peak / brightest * value).min(1.0)) }
    }

    #[test]
    fn saturated_pixels_do_not_count_against_true_model() {
        let engine = engine();
        let region = RegionOfInterest::try_new(&Grid::try_new(40, 56, 8e-6).unwrap(), 3, 2, 50, 36).unwrap();
        let pair = clipped(&engine, 2.0);
        let sums = compare(&engine, &pair, region).unwrap();
        let saturated = region.pixels() - unsaturated_px(&pair.photo, region);
        assert!(saturated > 10, "{saturated} of {} pixels are saturated", region.pixels());
        assert_eq!(sums.w, (region.pixels() - saturated) as f64);
        // Only rounding errors remain: f32 light and photographs of at most 1.
        assert!(sums.best_loss() < 1e-12, "{}", sums.best_loss());
    }

    #[test]
    fn photograph_saturated_in_whole_region_is_refused() {
        let engine = engine();
        let region = RegionOfInterest::try_new(&Grid::try_new(40, 56, 8e-6).unwrap(), 3, 2, 50, 36).unwrap();
        let mut pair = clipped(&engine, 1.0);
        pair.photo = Plane::filled(40, 56, 1.0);
        pair.photo.values_mut()[0] = 0.5;
        assert_eq!(compare(&engine, &pair, region), Err(Error::Saturated));
    }
}
