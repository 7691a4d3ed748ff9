//! Holograms and their photographs.

use crate::engine::{Engine, Fields};
use crate::photometry::{Comparison, Sums};
use crate::real::Real;
use crate::{Error, Plane, RegionOfInterest};

/// Photographs at or above this are taken to be saturated: the camera's highest level of 255, less a quarter.
const SATURATION: f32 = 254.75 / 255.0;

/// A hologram and its photograph.
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// The hologram's phase \[rad\], before the carrier.
    pub phase: Plane<f32>,
    /// The photograph, intensity in linear light, 1 at the camera's full scale.
    pub photo: Plane<f32>,
}

/// Where pairs come from: memory, or files that are read when they are needed.
pub trait PairSource: Sync {
    /// What can go wrong while reading.
    type Error: From<Error>;

    /// Number of pairs.
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The pair `index`.
    ///
    /// # Errors
    ///
    /// When it cannot be read.
    fn pair(&self, index: usize) -> Result<Pair, Self::Error>;
}

impl PairSource for [Pair] {
    type Error = Error;

    fn len(&self) -> usize {
        <[Pair]>::len(self)
    }

    fn pair(&self, index: usize) -> Result<Pair, Error> {
        Ok(self[index].clone())
    }
}

impl PairSource for Vec<Pair> {
    type Error = Error;

    fn len(&self) -> usize {
        self.as_slice().len()
    }

    fn pair(&self, index: usize) -> Result<Pair, Error> {
        self.as_slice().pair(index)
    }
}

/// A pair in the precision of an engine, with what counts of it.
#[derive(Debug)]
pub(super) struct Example<T> {
    pub(super) phase: Plane<T>,
    pub(super) photo: Plane<T>,
    weight: Plane<T>,
    weight_sum: f64,
    region: RegionOfInterest,
}

impl<T: Real> Example<T> {
    pub(super) fn new(pair: &Pair, engine: &Engine<T>, region: RegionOfInterest) -> Result<Self, Error> {
        for (name, plane) in [("phase", &pair.phase), ("photo", &pair.photo)] {
            plane.expect_size(name, engine.height_px(), engine.width_px())?;
            plane.expect_finite(name)?;
        }
        let weight = pair.photo.map(|value| if value < SATURATION { T::one() } else { T::zero() });
        let in_region =
            |y| region.columns(y).map_or(0.0, |columns| weight.row(y)[columns].iter().map(|w| w.wide()).sum());
        let weight_sum: f64 = (0..weight.height_px()).map(in_region).sum();
        if weight_sum == 0.0 {
            let needed = "a photograph needs pixels in the region of interest that are not saturated";
            return Err(Error::Empty { name: "photo", needed });
        }
        let widen = |plane: &Plane<f32>| plane.map(|value| T::of(f64::from(value)));
        Ok(Self { phase: widen(&pair.phase), photo: widen(&pair.photo), weight, weight_sum, region })
    }

    pub(super) fn comparison(&self, engine: &Engine<T>, gain: f64, offset: f64) -> Comparison<'_, T> {
        Comparison {
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

/// The sums over all examples at gain 1 and offset 0, from which the gain and offset that fit best follow.
pub(super) fn measure_all<T: Real, S: PairSource>(
    engine: &Engine<T>,
    fields: &mut Fields<T>,
    pairs: &S,
    region: RegionOfInterest,
) -> Result<Sums, S::Error> {
    let mut sums = Sums::default();
    for index in 0..pairs.len() {
        let example = Example::new(&pairs.pair(index)?, engine, region)?;
        engine.send(example.phase.values(), fields);
        sums.add(&engine.convolver.measure(&fields.tiles, &example.comparison(engine, 1.0, 0.0)));
    }
    Ok(sums)
}

/// Compares what an engine predicts for a pair with its photograph, every pixel of the region counted, at gain 1 and
/// offset 0.
///
/// # Errors
///
/// [`Error`] for a pair of another size or with values that are not finite.
pub fn compare(engine: &Engine, pair: &Pair, region: RegionOfInterest) -> Result<Sums, Error> {
    for (name, plane) in [("phase", &pair.phase), ("photo", &pair.photo)] {
        plane.expect_size(name, engine.height_px(), engine.width_px())?;
        plane.expect_finite(name)?;
    }
    let mut fields = Fields::new(&engine.convolver);
    engine.send(pair.phase.values(), &mut fields);
    let comparison = Comparison {
        picture: &pair.photo,
        weight: None,
        region,
        detector: engine.detector,
        gain: 1.0,
        offset: 0.0,
        weight_sum: region.pixels() as f64,
    };
    Ok(engine.convolver.measure(&fields.tiles, &comparison))
}
