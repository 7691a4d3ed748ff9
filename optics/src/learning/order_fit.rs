//! Errors of all orders during a fit, and the gradient of a loss with respect to them.
//!
//! ```text
//! H_o(f) = E(f) R_o(f) + Σ_m E(f + m) A(f + m) e^{i2π(f + m)·o},   R_o = T_o − Σ_m A(f + m) e^{i2π(f + m)·o},   m ≠ 0
//! ∂L/∂c = 2 Re Σ_f Σ_o v(f) g_o*(f) ∂H_o(f)/∂c,   ∂E(ν)/∂c = E(ν) T_i(x) T_j(y)
//! ```
//!
//! The [products](OrderProducts) explain the symbols. v is the spectrum of the field in front of these transfer
//! functions, g_o the back-propagated gradient at the sub-sample o, c the coefficient of T_i T_j in the logarithm of E.

use super::adjoint::OrdersAdjoint;
use super::columns::project;
use crate::display::parts::layout::BEYOND_ORDER;
use crate::display::parts::order_errors::{OrderErrors, place};
use crate::display::{Detector, OpticalSetup};
use crate::engine::Real;
use crate::engine::convolution::{Convolver, Transfer};
use crate::engine::{OrderProducts, OrderWeights, sample_transfers, sub_samples, turns};
use crate::numerics::buffers::zeros;
use crate::numerics::chebyshev::{ChebyshevBasis, polynomials};
use num_complex::{Complex, Complex64};

/// Terms along an axis.
const TERMS: usize = ChebyshevBasis::ORDER_MAX + 1;
/// Terms along an axis of the errors beyond the band, and the tilt of the image there.
const TERMS_BEYOND: usize = BEYOND_ORDER + 2;
/// Position of the tilt.
const TILT: usize = BEYOND_ORDER + 1;

/// Errors of all orders at the planes of a fit.
#[derive(Debug)]
pub(super) struct OrderFit<T> {
    setups: Vec<OpticalSetup>,
    /// Sub-samples: places, and factors of their fields.
    places: Vec<([f64; 2], f64)>,
    /// R_o times the factor of the sub-sample, for each plane.
    first: Vec<Vec<Transfer<T>>>,
    /// Products of the plane that was set last, and the plane.
    products: OrderProducts<T>,
    plane: usize,
    /// Turns of each place along x and y: for each order all indices.
    turns: Vec<[Vec<Vec<Complex<T>>>; 2]>,
}

/// Sums of one column: those of the errors in the band, for the orders below, at and above it along x, and those of the
/// errors beyond the band.
#[derive(Clone, Copy, Debug)]
pub(super) struct OrderSums {
    band: [[Complex64; TERMS]; 3],
    beyond: [[Complex64; TERMS_BEYOND]; TERMS_BEYOND],
}

impl OrderSums {
    const NONE: Self =
        Self { band: [[Complex64::ZERO; TERMS]; 3], beyond: [[Complex64::ZERO; TERMS_BEYOND]; TERMS_BEYOND] };

    /// Adds those of another mode of the light.
    pub(super) fn add(&mut self, other: &Self) {
        let add = |(sum, value): (&mut Complex64, &Complex64)| *sum += value;
        self.band.as_flattened_mut().iter_mut().zip(other.band.as_flattened()).for_each(add);
        self.beyond.as_flattened_mut().iter_mut().zip(other.beyond.as_flattened()).for_each(add);
    }
}

impl<T: Real> OrderFit<T> {
    /// `None` for displays that show one order.
    pub(super) fn new(setups: &[OpticalSetup], detector: Detector) -> Option<Self> {
        let setup = setups.first().filter(|setup| setup.orders().are_all())?;
        let weighted = sub_samples(setup, detector);
        let count = weighted.len() as f64;
        let places: Vec<_> = weighted.into_iter().map(|(place, weight)| (place, (weight * count).sqrt())).collect();
        let first = |setup: &OpticalSetup| {
            let (taken, at) = (OrderProducts::taken_away(setup), places.iter().map(|(place, _)| *place));
            let exact = sample_transfers::<T>(setup, &at.collect::<Vec<_>>());
            let without = |(exact, &(place, factor)): (Transfer<T>, &([f64; 2], f64))| {
                taken.fold(&exact, (place, 1.0), &taken.ones()).times(T::of(factor))
            };
            exact.into_iter().zip(&places).map(without).collect()
        };
        let first = setups.iter().map(first).collect();
        let mut fit = Self {
            setups: setups.to_vec(),
            first,
            products: OrderProducts::taken_away(setup),
            plane: 0,
            turns: Vec::new(),
            places,
        };
        fit.turn();
        Some(fit)
    }

    fn turn(&mut self) {
        let [x, y] = &self.products.axes;
        self.turns = self.places.iter().map(|(place, _)| [turns(x, place[0]), turns(y, place[1])]).collect();
    }

    /// Sets the errors of a plane.
    pub(super) fn set(&mut self, plane: usize, errors: &OrderErrors) {
        self.products = OrderProducts::behind(&self.setups[plane], errors);
        if plane != self.plane {
            self.plane = plane;
            self.turn();
        }
    }

    /// Plans with the transfer functions to the sub-samples, multiplied order by order by weights.
    pub(super) fn convolver(&self, weights: &OrderWeights<T>) -> Convolver<T> {
        let fold = |(first, &at): (&Transfer<T>, &([f64; 2], f64))| self.products.fold(first, at, weights);
        let transfers: Vec<_> = self.first[self.plane].iter().zip(&self.places).map(fold).collect();
        let grid = self.setups[self.plane].grid();
        Convolver::with_transfers(grid.height_px(), grid.width_px(), transfers)
    }

    pub(super) fn ones(&self) -> OrderWeights<T> {
        self.products.ones()
    }

    /// Weights that choose the orders below, at or above the first along each axis, for −1, 0 and 1.
    pub(super) fn group(&self, group: [i32; 2]) -> OrderWeights<T> {
        self.weights(|axis, order, _| if order.signum() == group[axis] { 1.0 } else { 0.0 })
    }

    /// Whether there are orders in a [group](Self::group).
    pub(super) fn has(&self, group: [i32; 2]) -> bool {
        self.products.axes.iter().zip(group).all(|(axis, sign)| axis.orders().any(|order| order.signum() == sign))
    }

    /// Weights of the derivative by the kernel's tilt along x or y, beyond the band.
    pub(super) fn tilt(&self, axis: usize) -> OrderWeights<T> {
        self.beyond(if axis == 0 { (TILT, 0) } else { (0, TILT) })
    }

    /// Weights T_p(u) along x and T_q(v) along y of a term of the errors beyond the band.
    pub(super) fn beyond(&self, (p, q): (usize, usize)) -> OrderWeights<T> {
        self.weights(|axis, _, nu| beyond_terms(nu)[[p, q][axis]])
    }

    /// `weight(axis, order, frequency)`
    fn weights(&self, weight: impl Fn(usize, i32, f64) -> f64) -> OrderWeights<T> {
        let grid = self.setups[self.plane].grid();
        let sides_px = [grid.width_px(), grid.height_px()];
        [0, 1].map(|i| {
            let axis = &self.products.axes[i];
            let along =
                |order| (0..2 * sides_px[i]).map(|k| T::of(weight(i, order, axis.frequency(k, order)))).collect();
            axis.orders().map(along).collect()
        })
    }

    /// Sums over one column, from v and the gradients of all sub-samples. `polynomials_y`: T_j at each row.
    pub(super) fn sums(
        &self,
        column: usize,
        [v, gradients]: [&[Complex<T>]; 2],
        polynomials_y: &[Vec<T>],
        beyond_y: &[Vec<Vec<T>>],
    ) -> OrderSums {
        let [x, y] = &self.products.axes;
        let (rows, zero) = (v.len(), Complex::new(T::zero(), T::zero()));
        let values = self.products.column(column);
        let mut sums = OrderSums::NONE;
        let correlations: Vec<Complex<T>> =
            gradients.chunks_exact(rows).flat_map(|g| v.iter().zip(g).map(|(v, g)| *v * g.conj())).collect();
        let (mut order, mut first): (Vec<Complex<T>>, Vec<Complex<T>>) = (zeros(rows), zeros(rows));
        for (i, mx) in x.orders().enumerate() {
            let u = beyond_terms(x.frequency(column, mx));
            let band = &mut sums.band[(mx.signum() + 1) as usize];
            for (j, my) in y.orders().enumerate() {
                order.fill(zero);
                for (o, (correlation, &(_, factor))) in correlations.chunks_exact(rows).zip(&self.places).enumerate() {
                    if (mx, my) == (0, 0) {
                        self.first[self.plane][o].read_column(column, &mut first);
                        order.iter_mut().zip(correlation).zip(&first).for_each(|((sum, c), t)| *sum = *sum + *c * *t);
                        continue;
                    }
                    let turn_x = self.turns[o][0][i][column].scale(T::of(factor));
                    let turns_y = &self.turns[o][1][j];
                    order
                        .iter_mut()
                        .zip(correlation)
                        .zip(turns_y)
                        .for_each(|((sum, c), t)| *sum = *sum + *c * (*t * turn_x));
                }
                let products = &values[(i * y.orders().len() + j) * rows..][..rows];
                order.iter_mut().zip(products).for_each(|(value, p)| *value = *value * *p);
                let mut along_y = [Complex64::ZERO; TERMS];
                if my == 0 {
                    project(|k| order[k], polynomials_y, &mut along_y);
                } else {
                    let ones = &polynomials_y[..1];
                    project(|k| order[k], ones, &mut along_y[..1]);
                    let (sum, sign) = (along_y[0], f64::from(my.signum()));
                    along_y
                        .iter_mut()
                        .take(polynomials_y.len())
                        .enumerate()
                        .for_each(|(j, value)| *value = sum * sign.powi(j as i32));
                }
                band.iter_mut().zip(along_y).for_each(|(sum, value)| *sum += value);
                let mut along_v = [Complex64::ZERO; TERMS_BEYOND];
                project(|k| order[k], &beyond_y[j], &mut along_v);
                for (sums, u) in sums.beyond.iter_mut().zip(&u) {
                    sums.iter_mut().zip(along_v).for_each(|(sum, value)| *sum += value * u);
                }
            }
        }
        sums
    }

    /// T_q(v) at each row, for each order along y.
    pub(super) fn beyond_y(&self) -> Vec<Vec<Vec<T>>> {
        let y = &self.products.axes[1];
        let rows = 2 * self.setups[self.plane].grid().height_px();
        let of_order = |order| {
            let at: Vec<_> = (0..rows).map(|k| beyond_terms(y.frequency(k, order))).collect();
            (0..TERMS_BEYOND).map(|q| at.iter().map(|t| T::of(t[q])).collect()).collect()
        };
        y.orders().map(of_order).collect()
    }

    /// ∂L/∂α and ∂L/∂ψ of each coefficient of the errors in the band, and of those beyond it; and what the kernel's tilts
    /// along x and y add to the gradient by going on beyond the band.
    pub(super) fn gradient(
        &self,
        basis: ChebyshevBasis,
        beyond: ChebyshevBasis,
        columns: &[OrderSums],
    ) -> OrdersAdjoint {
        let x = &self.products.axes[0];
        let mut band = vec![[Complex64::ZERO; TERMS]; basis.order() + 1];
        let mut outside = [[Complex64::ZERO; TERMS_BEYOND]; TERMS_BEYOND];
        for (column, sums) in columns.iter().enumerate() {
            let fx = 2.0 * x.frequency(column, 0);
            for (at, sums) in [-1.0, fx, 1.0].into_iter().zip(&sums.band) {
                for (total, t) in band.iter_mut().zip(polynomials(basis.order(), at)) {
                    total.iter_mut().zip(sums).for_each(|(total, sum)| *total += sum * t);
                }
            }
            for (total, sums) in outside.iter_mut().zip(&sums.beyond) {
                total.iter_mut().zip(sums).for_each(|(total, sum)| *total += sum);
            }
        }
        let parts = |sum: Complex64| (2.0 * sum.re, -2.0 * sum.im);
        OrdersAdjoint {
            band: basis.degrees().map(|(i, j)| parts(band[i][j])).unzip(),
            beyond: beyond.degrees().map(|(p, q)| parts(outside[p][q])).unzip(),
            tilts_beyond: [parts(outside[TILT][0]).1, parts(outside[0][TILT]).1],
        }
    }
}

/// T_0(u) … of a frequency along an axis [cycles per pixel], and what a tilt of 1 adds to the phase beyond the band.
fn beyond_terms(nu: f64) -> [f64; TERMS_BEYOND] {
    let [_, s, u] = place(nu);
    let mut terms = [s; TERMS_BEYOND];
    terms.iter_mut().zip(polynomials(BEYOND_ORDER, u)).for_each(|(term, t)| *term = t);
    terms
}
