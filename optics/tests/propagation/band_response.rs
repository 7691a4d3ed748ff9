//! The band response against the direct integral, at distances from contact to the far field.

use super::fields::{WAVELENGTH_M, noise, relative_l2};
use crate::engine::PropagatorCore;
use crate::propagation::PropagationMethod;
use crate::reference::first_order_onto;
use crate::{Grid, OpticalSetup};

#[test]
fn planned_field_matches_the_integral_at_every_distance() {
    for (height_px, width_px, pitch_m) in [(40, 72, 8e-6), (60, 33, 3.74e-6), (3, 60, 8e-6), (9, 7, 0.4e-6)] {
        let grid = Grid::try_new(height_px, width_px, pitch_m).unwrap();
        let at = |distance_m: f64| OpticalSetup::try_new(grid, WAVELENGTH_M, distance_m).unwrap();
        let [x_m, y_m] = [at(1.0).critical_distance_x_m(), at(1.0).critical_distance_y_m()];
        // From contact to the far field, and between the critical distances of the two axes.
        for (distance_m, bound) in [
            (0.01 * y_m, 1e-5),
            (0.9 * x_m.min(y_m), 1e-5),
            ((x_m * y_m).sqrt(), 1e-4),
            (-1.3 * x_m.max(y_m), 1e-4),
            (5.0 * x_m.max(y_m), 5e-4),
        ] {
            let setup = at(distance_m);
            let field = noise(height_px, width_px, 3);
            let expected = first_order_onto(&setup, &field, &setup.window()).unwrap();
            let found = PropagatorCore::<f64>::regardless(&setup, PropagationMethod::BandResponse).unwrap();
            let found = found.forward(&field).unwrap();
            let error = relative_l2(&found, &expected);
            assert!(error < bound, "{width_px}×{height_px} px of {pitch_m} m, {distance_m} m: {error:e}");
        }
    }
}
