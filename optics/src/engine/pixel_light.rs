//! Light integrated over the pixels of the image, for displays that show all orders.
//!
//! The field of all orders has details finer than a pixel, so a few fixed sub-samples do not hold its light. A pixel is
//! integrated by the quadrature of Gauss and Legendre along each axis. Light reaches a point of the image from directions
//! up to the display's sides, and the intensity's finest detail there has
//!
//! ```text
//! ν = N Δ²/(λz) = z_c/2z cycles per pixel
//! ```
//!
//! N pixels along the axis, Δ pixel pitch \[m\], λ wavelength \[m\], z distance \[m\], z_c the critical distance.

use super::core::{EngineCore, Fields};
use crate::convolution::{Convolver, Real};
use crate::propagation::passes::{for_each_order_transfer, gauss_legendre};
use crate::{OpticalSetup, Plane, Result};
use rayon::prelude::*;
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// Fewest nodes along an axis.
const NODES_MIN: usize = 2;
/// Most nodes along an axis. They integrate details of up to four cycles per pixel.
const NODES_MAX: usize = 8;

/// Numbers of nodes along x and y.
fn nodes(setup: &OpticalSetup) -> [usize; 2] {
    [setup.critical_distance_x_m(), setup.critical_distance_y_m()].map(|critical_m| {
        let cycles = 0.5 * critical_m / setup.distance_m().abs();
        ((FRAC_PI_2 * cycles).ceil() as usize).saturating_add(1).clamp(NODES_MIN, NODES_MAX)
    })
}

/// Places of the nodes in a pixel (x, y) \[px\], with their weights.
fn places([nodes_x, nodes_y]: [usize; 2]) -> Vec<([f64; 2], f64)> {
    let along = |nodes| gauss_legendre(nodes).into_iter().map(|(node, weight)| (0.5 * node, 0.5 * weight));
    along(nodes_y)
        .flat_map(|(y, weight_y)| along(nodes_x).map(move |(x, weight_x)| ([x, y], weight_x * weight_y)))
        .collect()
}

impl<T: Real> EngineCore<T> {
    /// Mean over `phases` of the light of all orders, integrated over each pixel. The engine's detector does not matter.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub(crate) fn light_of_all_orders(&self, phases: &[Plane<T>]) -> Result<Plane<T>> {
        self.light_at(&places(nodes(&self.setup)), phases)
    }

    /// Mean over `phases` of the weighted sum of the light of all orders at some places in each pixel. The places are computed
    /// one after the other, so the memory does not depend on their number.
    ///
    /// # Errors
    ///
    /// [`Error::SizeMismatch`](crate::Error::SizeMismatch) for a phase of another size.
    pub(crate) fn light_at(&self, places: &[([f64; 2], f64)], phases: &[Plane<T>]) -> Result<Plane<T>> {
        let (height_px, width_px) = (self.height_px(), self.width_px());
        phases.iter().try_for_each(|phase| phase.expect_size("phase", height_px, width_px))?;
        let mut light = Plane::filled(height_px, width_px, T::zero());
        let mut part = vec![T::zero(); height_px * width_px];
        let places_px: Vec<[f64; 2]> = places.iter().map(|(place, _)| *place).collect();
        for_each_order_transfer(&self.setup, &places_px, |i, transfer| {
            let convolver = Convolver::with_transfers(height_px, width_px, vec![transfer]);
            let engine = Self { convolver: Arc::new(convolver), ..self.clone() };
            let mut fields = Fields::for_light(&engine);
            let share = T::of(places[i].1 / phases.len() as f64);
            for phase in phases {
                engine.send(phase.values(), &mut fields);
                engine.convolver.light(&fields.tiles, &mut part);
                light.values_mut().par_iter_mut().zip(&part).for_each(|(sum, &light)| *sum = *sum + light * share);
            }
        });
        Ok(light)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hologram::initial_phase;
    use crate::{Detector, DisplayModel, Grid, Orders};

    #[test]
    fn pixel_light_matches_many_samples_of_each_pixel() {
        // The critical distances are 2 mm along y and 3 mm along x: details of up to 3, 1.5 and 0.4 cycles per pixel.
        for (distance_m, within) in [(0.5e-3, 0.02), (1e-3, 0.01), (4e-3, 0.01)] {
            let setup = OpticalSetup::try_new(Grid::try_new(8, 12, 8e-6).unwrap(), 515e-9, distance_m).unwrap();
            let setup = setup.with_orders(Orders::SQUARE).unwrap();
            let engine = EngineCore::<f64>::new(&DisplayModel::ideal(setup), Detector::Point, None).unwrap();
            let phases = [3, 4].map(|seed| initial_phase(8, 12, 6.0, seed).unwrap().map(f64::from));
            let found = engine.light_of_all_orders(&phases).unwrap();
            let along = |i: usize| (i as f64 + 0.5) / 16.0 - 0.5;
            let many: Vec<_> =
                (0..16).flat_map(|j| (0..16).map(move |i| ([along(i), along(j)], 1.0 / 256.0))).collect();
            let expected = engine.light_at(&many, &phases).unwrap();
            for (found, expected) in found.values().iter().zip(expected.values()) {
                assert!((found - expected).abs() < within, "{distance_m}: {found} {expected}");
            }
        }
    }
}
