//! Light of the image at exact places, for the quality that is reported.
//!
//! Each place in the pixels has a [transfer function of its own](super::sample_transfers).
//! Optimizations on a display that shows the first order move the samples by a linear phase instead, which takes fewer
//! transforms; its error is some −50 dB of the light.
//!
//! The field of all orders has details finer than a pixel, which is integrated at [more places](super::sub_samples).

use super::convolution::Real;
use super::core::{EngineCore, Fields, Transmission};
use super::order_products::OrderProducts;
use super::sample_transfers::for_each_sample_transfer;
use super::sub_samples::{WeightedPlace, reported_places};
use crate::display::Detector;
use crate::error::Result;
use crate::numerics::Plane;
use rayon::prelude::*;

impl<T: Real> EngineCore<T> {
    /// Light at the sub-samples of [`Detector::Supersampled`], 2×2 values per pixel, by the exact transfer function of
    /// each sub-sample: for each set of phases their mean. `None`: the engine has no such transfer functions.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub(crate) fn exact_samples(&self, sets: &[&[Plane<T>]]) -> Result<Option<Vec<Plane<T>>>> {
        if !self.has_exact_places() {
            return Ok(None);
        }
        let (height_px, width_px) = (self.height_px(), self.width_px());
        let mut samples = vec![Plane::filled(2 * height_px, 2 * width_px, T::zero()); sets.len()];
        self.for_each_place(&Detector::Supersampled.places_px(), sets, |place, set, light| {
            // The places are ordered by y, then by x.
            let (below, right) = (place / 2, place % 2);
            let rows =
                samples[set].values_mut().par_chunks_exact_mut(4 * width_px).zip(light.par_chunks_exact(width_px));
            rows.for_each(|(out, light)| {
                let out = &mut out[below * 2 * width_px..][..2 * width_px];
                out.iter_mut().skip(right).step_by(2).zip(light).for_each(|(out, &light)| *out = *out + light);
            });
        })?;
        Ok(Some(samples.into_iter().map(|light| self.blurred(light)).collect()))
    }

    /// Light at the pixels' centres: for each set of phases their mean. `None`: the engine has no exact transfer
    /// function behind the errors of its kernel, or has no errors, so that its own is exact.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub(crate) fn exact_points(&self, sets: &[&[Plane<T>]]) -> Result<Option<Vec<Plane<T>>>> {
        let has_errors = matches!(self.transmission, Transmission::Smooth(_));
        if self.shows_all_orders() || !has_errors || !self.has_exact_places() {
            return Ok(None);
        }
        self.light_at(&[([0.0, 0.0], 1.0)], sets).map(Some)
    }

    /// Light integrated over the part of each pixel that the camera sees: for each set of phases the mean. `None` where
    /// samples at a quarter of a pixel hold the integral, or there are no exact transfer functions. The engine's detector
    /// does not matter.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub(crate) fn light_over_pixels(&self, sets: &[&[Plane<T>]]) -> Result<Option<Vec<Plane<T>>>> {
        let needs_places = self.shows_all_orders() || self.camera_fill_factor() < 1.0;
        if !needs_places || !self.has_exact_places() {
            return Ok(None);
        }
        self.light_at(&reported_places(&self.setup), sets).map(Some)
    }

    /// Weighted sum of the light at some places in each pixel: for each set of phases the mean.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub(crate) fn light_at(&self, places: &[WeightedPlace], sets: &[&[Plane<T>]]) -> Result<Vec<Plane<T>>> {
        let mut sums = vec![Plane::filled(self.height_px(), self.width_px(), T::zero()); sets.len()];
        let places_px: Vec<[f64; 2]> = places.iter().map(|(place, _)| *place).collect();
        self.for_each_place(&places_px, sets, |place, set, light| {
            let weight = T::of(places[place].1);
            sums[set].values_mut().par_iter_mut().zip(light).for_each(|(sum, &light)| *sum = *sum + light * weight);
        })?;
        Ok(sums.into_iter().map(|light| self.blurred(light)).collect())
    }

    /// Calls `add_light(place, set, light)` with the mean light of each set of phases at each of the places, for each
    /// mode of the light. The places are computed one after the other, so the memory does not depend on their number.
    /// The engine [has exact places](Self::has_exact_places).
    fn for_each_place(
        &self,
        places_px: &[[f64; 2]],
        sets: &[&[Plane<T>]],
        mut add_light: impl FnMut(usize, usize, &[T]),
    ) -> Result<()> {
        let (height_px, width_px) = (self.height_px(), self.width_px());
        sets.iter().copied().flatten().try_for_each(|phase| phase.expect_size("phase", height_px, width_px))?;
        self.modes().for_each(|mode| mode.for_each_place_in_mode(places_px, sets, &mut add_light));
        Ok(())
    }

    fn for_each_place_in_mode(
        &self,
        places_px: &[[f64; 2]],
        sets: &[&[Plane<T>]],
        add_light: &mut impl FnMut(usize, usize, &[T]),
    ) {
        let (height_px, width_px) = (self.height_px(), self.width_px());
        let (mut mean, mut part) = (vec![T::zero(); height_px * width_px], vec![T::zero(); height_px * width_px]);
        let errors = match &self.transmission {
            Transmission::Smooth(errors) if !self.shows_all_orders() => Some(&**errors),
            _ => None,
        };
        let products = self.order_errors.as_ref().map(|errors| OrderProducts::beside_exact(&self.setup, errors));
        let kept = self.kept.as_deref();
        for_each_sample_transfer((&self.setup, errors), kept, places_px, |place, exact| {
            let transfer = match &products {
                Some(products) => products.fold(&exact, (places_px[place], 1.0), &products.ones()),
                None => exact,
            };
            let engine = self.at_place(transfer);
            let mut fields = Fields::for_light(&engine);
            for (set, phases) in sets.iter().enumerate() {
                let share = T::of(self.share / phases.len() as f64);
                mean.fill(T::zero());
                for phase in *phases {
                    engine.send(phase.values(), &mut fields);
                    engine.convolver.light(&fields.tiles, &mut part);
                    mean.par_iter_mut().zip(&part).for_each(|(sum, &light)| *sum = *sum + light * share);
                }
                add_light(place, set, &mean);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::{DisplayModel, FurtherMode, KernelShape, OpticalSetup, Orders, PartialCoherence};
    use crate::hologram::initial_phase;
    use crate::numerics::{Grid, SmoothField};

    #[test]
    fn pixel_light_matches_many_samples_of_each_pixel() {
        // The critical distances are 2 mm along y and 3 mm along x: details of up to 3, 1.5 and 0.4 cycles per pixel.
        for (distance_m, within) in [(0.5e-3, 0.02), (1e-3, 0.01), (4e-3, 0.01)] {
            let setup = OpticalSetup::try_new(Grid::try_new(8, 12, 8e-6).unwrap(), 515e-9, distance_m).unwrap();
            let setup = setup.with_orders(Orders::SQUARE).unwrap();
            let engine = EngineCore::<f64>::new(&DisplayModel::ideal(setup), Detector::Point, None).unwrap();
            let phases = [3, 4].map(|seed| initial_phase(8, 12, 6.0, seed).unwrap().map(f64::from));
            let found = &engine.light_over_pixels(&[&phases]).unwrap().unwrap()[0];
            let along = |i: usize| (i as f64 + 0.5) / 16.0 - 0.5;
            let many: Vec<_> =
                (0..16).flat_map(|j| (0..16).map(move |i| ([along(i), along(j)], 1.0 / 256.0))).collect();
            let expected = &engine.light_at(&many, &[&phases]).unwrap()[0];
            for (found, expected) in found.values().iter().zip(expected.values()) {
                assert!((found - expected).abs() < within, "{distance_m}: {found} {expected}");
            }
        }
    }

    #[test]
    fn light_in_the_middles_of_pixels_is_that_of_the_point_detector() {
        let setup = OpticalSetup::try_new(Grid::try_new(8, 12, 8e-6).unwrap(), 515e-9, 4e-3).unwrap();
        let setup = setup.with_orders(Orders::SQUARE).unwrap();
        let wavy = SmoothField { order: 1, log_amplitude: vec![0.1, 0.0], phase: vec![0.3, -0.5] };
        let coherence = PartialCoherence::new(vec![FurtherMode { light: 0.5, errors: wavy.clone() }]);
        let kernel = KernelShape::Smooth(wavy);
        let model = DisplayModel { kernel, coherence, ..DisplayModel::ideal(setup) };
        let engine = EngineCore::<f64>::new(&model, Detector::Point, None).unwrap();
        let phases = [3, 4].map(|seed| initial_phase(8, 12, 6.0, seed).unwrap().map(f64::from));
        let found = &engine.light_at(&[([0.0, 0.0], 1.0)], &[&phases]).unwrap()[0];
        let expected = phases.each_ref().map(|phase| engine.light(phase).unwrap());
        for (at, found) in found.values().iter().enumerate() {
            let expected = expected.iter().map(|light| light.values()[at]).sum::<f64>() / 2.0;
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
    }
}
