//! Derivatives of the light by the errors of all orders.
//!
//! Below, at and above the first order along an axis, T_i is (−1)^i, T_i(2f) and 1. So the orders make three groups along
//! each axis, and a group takes a transform along y for each T_j in the band, and one at its ends. A term of the errors
//! beyond the band takes one transform, and so does each tilt, which goes on there.

use super::fit::Fit;
use super::jacobian::Jacobian;
use super::order_fit::OrderFit;
use crate::engine::{EngineCore, Real};

impl<T: Real> Fit<T> {
    /// Adds the derivatives by the errors of a kernel that differ from order to order: in the band, where those of the
    /// orders beside the first are the values at its ends, and beyond it.
    pub(super) fn order_derivatives(
        &mut self,
        engine: &EngineCore<T>,
        orders: &OrderFit<T>,
        jacobian: &mut Jacobian<T>,
    ) {
        let (convolver, kernels, layout) = (&engine.convolver, &engine.kernels, self.layout);
        let field = &self.out.spectrum[..kernels.half_spectrum_len(convolver)];
        convolver.weigh_spectra(field, kernels, &vec![T::one(); kernels.transfers.len()], &mut self.spectra);
        let polynomials_x = self.smooth.polynomials_x();
        for group in (-1..=1).flat_map(|y| (-1..=1).map(move |x| [x, y])).filter(|group| orders.has(*group)) {
            let selected = orders.convolver(&orders.group(group));
            let at_end = |end: i32, degree: usize| if end < 0 && degree % 2 == 1 { -1.0 } else { 1.0 };
            // In the band along y, a transform for each T_j; at its ends T_j is a number.
            let lines = if group[1] == 0 { layout.kernel.order() } else { 0 };
            for line in 0..=lines {
                let tiles = &mut self.out.tiles[..engine.image_len()];
                selected.return_weighed(&self.spectra, self.smooth.polynomial_y(line), tiles);
                let columns = if group[0] == 0 { &polynomials_x } else { &polynomials_x[..1] };
                for (column, along_x) in columns.iter().enumerate() {
                    let of = |(slot, (i, j)): (usize, (usize, usize))| {
                        let is_here = (group[0] != 0 || i == column) && (group[1] != 0 || j == line);
                        let sign = if group[0] == 0 { 1.0 } else { at_end(group[0], i) }
                            * if group[1] == 0 { 1.0 } else { at_end(group[1], j) };
                        is_here.then_some(([Some(slot), Some(layout.kernel.terms() + slot)], T::of(sign)))
                    };
                    let slots: Vec<_> = layout.kernel.degrees().enumerate().filter_map(of).collect();
                    if slots.is_empty() {
                        continue;
                    }
                    let weights = (group[0] == 0).then_some(along_x.as_slice());
                    jacobian.add_to_slots(self, weights, &slots);
                }
            }
        }
        for (slot, degrees) in layout.beyond.degrees().enumerate() {
            let selected = orders.convolver(&orders.beyond(degrees));
            let tiles = &mut self.out.tiles[..engine.image_len()];
            selected.return_weighed(&self.spectra, self.smooth.polynomial_y(0), tiles);
            let real = layout.beyond() + slot;
            jacobian.add_derivatives(self, None, Some(real), Some(real + layout.beyond.terms()));
        }
        for (axis, tilt) in layout.tilts().enumerate() {
            let selected = orders.convolver(&orders.tilt(axis));
            let tiles = &mut self.out.tiles[..engine.image_len()];
            selected.return_weighed(&self.spectra, self.smooth.polynomial_y(0), tiles);
            jacobian.add_derivatives(self, None, None, Some(tilt));
        }
    }
}
