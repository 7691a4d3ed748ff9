//! Transfer functions to the sub-samples of a display that shows all orders, behind errors that differ from order to
//! order.
//!
//! ```text
//! H_o(f) = E(f) · (T_o(f) − Σ_m A(f + m) e^{i2π(f + m)·o}) + Σ_m E(f + m) A(f + m) e^{i2π(f + m)·o},   m ≠ 0
//! A(ν) = √(ab) sinc(aν_x) sinc(bν_y) H(ν)
//! ```
//!
//! f frequency of the padded frame \[cycles per pixel\], m the orders, o the place of the sub-sample \[px\], T_o its
//! exact [transfer function](super::sample_transfers) without errors, H the angular spectrum of
//! free space, a and b the sides of a pixel's bright area in pixel pitches, E the [errors](crate::display::parts::order_errors). Without
//! errors H_o is T_o. The bracket is the light of the first order.
//!
//! Light that moves by more than the display's side never reaches the image. Its frequencies fade out around the one
//! that moves by this side, so that what the padded frame would bring back falls outside the image's middle.

use super::convolution::{Real, Transfer, frequencies, frequency_per_px, split_bin};
use crate::display::OpticalSetup;
use crate::display::parts::order_errors::OrderErrors;
use crate::interrupt;
use crate::numerics::SmoothField;
use crate::numerics::buffers::zeros;
use crate::numerics::real::unit_of;
use crate::propagation::transfer_function::angular_spectrum;
use num_complex::{Complex, Complex64};
use rayon::prelude::*;
use std::f64::consts::{PI, TAU};

/// Half of the width of the fading, in sides of the display.
const FADE_SIDES: f64 = 0.1;
/// Half of its least width, in Fresnel zones.
const FADE_ZONES: f64 = 2.0;

/// The orders along one axis from which light reaches the image.
#[derive(Clone, Debug)]
pub(crate) struct OrderAxis {
    side_px: usize,
    fill_factor: f64,
    /// Frequencies at which the orders begin and end to fade out [cycles per pixel].
    fade: [f64; 2],
    /// Orders to each side of the first one.
    beside: i32,
}

impl OrderAxis {
    /// The axes x and y of a display.
    pub(crate) fn of(setup: &OpticalSetup) -> [Self; 2] {
        let (pitch_m, z_m) = (setup.grid().pixel_pitch_m(), setup.distance_m().abs());
        // Waves do not travel beyond 1/λ.
        let limit = pitch_m / setup.wavelength_m();
        let zone_px = (setup.wavelength_m() * z_m).sqrt() / pitch_m;
        let reaching = |way_px: f64| limit * way_px.max(0.0) * pitch_m / (way_px * pitch_m).hypot(z_m);
        let sides_px = [setup.grid().width_px(), setup.grid().height_px()];
        [0, 1].map(|axis| {
            let side_px = sides_px[axis] as f64;
            let half_px = (FADE_SIDES * side_px).max(FADE_ZONES * zone_px);
            let fade = [reaching(side_px - half_px), reaching(side_px + half_px)];
            let beside = (fade[1] - 0.5).ceil().max(0.0) as i32;
            Self { side_px: sides_px[axis], fill_factor: setup.fill_factor()[axis], fade, beside }
        })
    }

    /// The orders, from the lowest.
    pub(crate) fn orders(&self) -> impl ExactSizeIterator<Item = i32> + Clone + use<> {
        -self.beside..self.beside + 1
    }

    /// √a sinc(aν) times the part of the frequency that counts.
    fn factor(&self, nu: f64) -> f64 {
        let [begin, end] = self.fade;
        let faded = ((nu.abs() - begin) / (end - begin)).clamp(0.0, 1.0);
        let share = if faded < 1.0 { 0.5 + 0.5 * (PI * faded).cos() } else { 0.0 };
        let angle = PI * self.fill_factor * nu;
        share * self.fill_factor.sqrt() * if angle == 0.0 { 1.0 } else { angle.sin() / angle }
    }

    /// Frequency of an index of the padded frame in an order [cycles per pixel].
    pub(crate) fn frequency(&self, index: usize, order: i32) -> f64 {
        frequency_per_px(split_bin(index, self.side_px), self.side_px) + f64::from(order)
    }
}

/// Number of values of an [`OrderProducts`].
pub(crate) fn order_products(setup: &OpticalSetup) -> u64 {
    let [x, y] = OrderAxis::of(setup);
    4 * (x.side_px * y.side_px * x.orders().len() * y.orders().len()) as u64
}

/// For each column of the padded frame the products of all orders: order by order along x, then along y, all rows.
#[derive(Clone, Debug)]
pub(crate) struct OrderProducts<T> {
    pub(crate) axes: [OrderAxis; 2],
    values: Vec<Complex<T>>,
}

/// Numbers by which the products of each order are multiplied: for each order along an axis those at all indices of the
/// padded frame.
pub(crate) type OrderWeights<T> = [Vec<Vec<T>>; 2];

impl<T: Real> OrderProducts<T> {
    /// E in the first order and E·A in the others.
    pub(crate) fn behind(setup: &OpticalSetup, errors: &OrderErrors) -> Self {
        Self::of(setup, errors, |free, [own, _]| free * own)
    }

    /// E in the first order and (E − E(f))·A in the others, which [fold](Self::fold) with T_o to H_o.
    pub(crate) fn beside_exact(setup: &OpticalSetup, errors: &OrderErrors) -> Self {
        Self::of(setup, errors, |free, [own, first]| free * (own - first))
    }

    /// 1 in the first order and −A in the others, which [fold](Self::fold) with T_o to the light of the first order.
    pub(crate) fn taken_away(setup: &OpticalSetup) -> Self {
        let flat = OrderErrors::new(&SmoothField::flat(0), &SmoothField::flat(0));
        Self::of(setup, &flat, |free, _| -free)
    }

    /// `product(A, [E, E(f)])` is that of an order other than the first.
    fn of(
        setup: &OpticalSetup,
        errors: &OrderErrors,
        product: impl Fn(Complex64, [Complex64; 2]) -> Complex64 + Sync,
    ) -> Self {
        let axes @ [x, y] = &OrderAxis::of(setup);
        let (rows, columns, orders) = (2 * y.side_px, 2 * x.side_px, x.orders().len() * y.orders().len());
        let (pitch_m, wavelength_m, z_m) = (setup.grid().pixel_pitch_m(), setup.wavelength_m(), setup.distance_m());
        let along_y: Vec<Vec<f64>> =
            y.orders().map(|my| (0..rows).map(|row| y.factor(y.frequency(row, my))).collect()).collect();
        let mut values: Vec<Complex<T>> = zeros(columns * orders * rows);
        values.par_chunks_mut(orders * rows).enumerate().for_each(|(column, values)| {
            interrupt::check();
            let of_first = errors.along_y(x.frequency(column, 0));
            let first: Vec<Complex64> = (0..rows).map(|row| of_first.at(y.frequency(row, 0))).collect();
            for (mx, values) in x.orders().zip(values.chunks_exact_mut(y.orders().len() * rows)) {
                let nu_x = x.frequency(column, mx);
                let (along_x, errors) = (x.factor(nu_x), errors.along_y(nu_x));
                for ((my, values), along_y) in y.orders().zip(values.chunks_exact_mut(rows)).zip(&along_y) {
                    if (mx, my) == (0, 0) {
                        values.iter_mut().zip(&first).for_each(|(value, &e)| *value = narrowed(e));
                        continue;
                    }
                    if along_x == 0.0 {
                        continue;
                    }
                    for (row, (value, along_y)) in values.iter_mut().zip(along_y).enumerate() {
                        if *along_y == 0.0 {
                            continue;
                        }
                        let nu_y = y.frequency(row, my);
                        let free = angular_spectrum(nu_x / pitch_m, nu_y / pitch_m, wavelength_m, z_m);
                        *value = narrowed(product(free * (along_x * along_y), [errors.at(nu_y), first[row]]));
                    }
                }
            }
        });
        Self { axes: axes.clone(), values }
    }

    /// The products of one column.
    pub(crate) fn column(&self, column: usize) -> &[Complex<T>] {
        let [x, y] = &self.axes;
        let len = x.orders().len() * y.orders().len() * 2 * y.side_px;
        &self.values[column * len..][..len]
    }

    /// Weights that are 1.
    pub(crate) fn ones(&self) -> OrderWeights<T> {
        self.axes.each_ref().map(|axis| axis.orders().map(|_| vec![T::one(); 2 * axis.side_px]).collect())
    }

    /// Σ_m weight · product · e^{i2π(f + m)·o} · `factor`, where the first order has the values of `first` instead of
    /// the turn and the factor.
    pub(crate) fn fold(
        &self,
        first: &Transfer<T>,
        (place_px, factor): ([f64; 2], f64),
        [along_x, along_y]: &OrderWeights<T>,
    ) -> Transfer<T> {
        let [x, y] = &self.axes;
        let rows = 2 * y.side_px;
        let turns_y: Vec<Vec<Complex<T>>> = turns(y, place_px[1]);
        let turns_x: Vec<Vec<Complex<T>>> = turns(x, place_px[0]);
        let mut folded = Transfer::zeros(y.side_px, x.side_px);
        folded.write_columns(|column, out| {
            first.read_column(column, out);
            let values = self.column(column);
            let at = |i: usize, j: usize| &values[(i * y.orders().len() + j) * rows..][..rows];
            let (i, j) = (x.beside as usize, y.beside as usize);
            for ((out, p), w) in out.iter_mut().zip(at(i, j)).zip(&along_y[j]) {
                *out = *out * p.scale(*w * along_x[i][column]);
            }
            for (i, turns_x) in turns_x.iter().enumerate() {
                let turn_x = turns_x[column].scale(T::of(factor) * along_x[i][column]);
                if turn_x == Complex::new(T::zero(), T::zero()) {
                    continue;
                }
                for (j, turns_y) in turns_y.iter().enumerate() {
                    if (i, j) == (x.beside as usize, y.beside as usize) {
                        continue;
                    }
                    for (((out, p), &turn_y), &w) in out.iter_mut().zip(at(i, j)).zip(turns_y).zip(&along_y[j]) {
                        let turn: Complex<T> = turn_y * turn_x;
                        *out = *out + *p * turn.scale(w);
                    }
                }
            }
        });
        folded
    }
}

/// e^{i2π(f + m)·o} along an axis: for each order all indices of the padded frame.
pub(crate) fn turns<T: Real>(axis: &OrderAxis, place_px: f64) -> Vec<Vec<Complex<T>>> {
    let fs = frequencies(axis.side_px);
    axis.orders().map(|m| fs.iter().map(|f| unit_of(TAU * (f + f64::from(m)) * place_px)).collect()).collect()
}

fn narrowed<T: Real>(value: Complex64) -> Complex<T> {
    Complex::new(T::of(value.re), T::of(value.im))
}

/// Part of the light of each frequency of a column that passes the errors: the mean over the orders that reach the
/// image, weighted by their light. The others are taken to lose as much.
pub(crate) fn passed(setup: &OpticalSetup, errors: &OrderErrors, column: usize, passed: &mut [f64]) {
    let [x, y] = &OrderAxis::of(setup);
    let light =
        |axis: &OrderAxis, nu: f64| OrderAxis { fade: [f64::MAX, f64::INFINITY], ..axis.clone() }.factor(nu).powi(2);
    let mut total = vec![0.0; passed.len()];
    passed.fill(0.0);
    for mx in x.orders() {
        let nu_x = x.frequency(column, mx);
        let (along_x, errors) = (light(x, nu_x), errors.along_y(nu_x));
        for my in y.orders() {
            for (row, (passed, total)) in passed.iter_mut().zip(&mut total).enumerate() {
                let nu_y = y.frequency(row, my);
                let light = along_x * light(y, nu_y);
                *passed += light * errors.at(nu_y).norm_sqr();
                *total += light;
            }
        }
    }
    passed.iter_mut().zip(total).for_each(|(passed, total)| *passed /= total);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::{Detector, DisplayModel, KernelShape, Orders};
    use crate::engine::core::EngineCore;
    use crate::hologram::initial_phase;
    use crate::numerics::{Grid, Plane};

    const SIDES_PX: [usize; 2] = [36, 24];

    fn setup(distance_m: f64) -> OpticalSetup {
        let grid = Grid::try_new(SIDES_PX[1], SIDES_PX[0], 8e-6).unwrap();
        let setup = OpticalSetup::try_new(grid, 515e-9, distance_m).unwrap();
        setup.with_orders(Orders::All { fill_factor_x: 0.9, fill_factor_y: 0.7 }).unwrap()
    }

    fn wavy(order: usize, size: f64) -> SmoothField {
        let mut field = SmoothField::flat(order);
        field.log_amplitude.iter_mut().enumerate().for_each(|(i, c)| *c = 0.3 * size * (1.7 * i as f64).sin());
        field.phase.iter_mut().enumerate().for_each(|(i, c)| *c = size * (1.3 * i as f64).cos());
        field
    }

    fn display(distance_m: f64) -> DisplayModel {
        let (kernel, beyond) = (KernelShape::Smooth(wavy(4, 0.4)), wavy(2, 0.8));
        DisplayModel { kernel, beyond, ..DisplayModel::ideal(setup(distance_m)) }
    }

    /// E from its definition.
    fn errors(model: &DisplayModel, nu: [f64; 2]) -> Complex64 {
        let KernelShape::Smooth(kernel) = &model.kernel else { panic!("smooth by construction") };
        let [x, y] = nu.map(|nu| (2.0 * nu).clamp(-1.0, 1.0));
        let [s, t] = [2.0 * nu[0] - x, 2.0 * nu[1] - y];
        let [u, v] = [s, t].map(|beyond| (beyond / 4.0).clamp(-1.0, 1.0));
        let tilt = |wanted| kernel.phase[kernel.basis().degrees().position(|degrees| degrees == wanted).unwrap()];
        let shifted = Complex64::cis(tilt((1, 0)) * s + tilt((0, 1)) * t);
        kernel.value(x, y) * model.beyond.value(u, v) * shifted
    }

    /// The field at the pixels' centres: a sum over all orders on a frame that is so large that nothing comes back.
    fn summed(model: &DisplayModel, field: &Plane<Complex64>) -> Plane<Complex64> {
        // Light of 5.5 cycles per pixel moves by 177 px at 4 mm.
        const BINS: usize = 216;
        const ORDERS: usize = 11;
        let (wavelength_m, distance_m) = (model.setup.wavelength_m(), model.setup.distance_m());
        let [fill_x, fill_y] = model.setup.fill_factor();
        let nu = |fine: usize| (fine as f64 + 0.5) / BINS as f64 - 0.5 * ORDERS as f64;
        let turns = |nu: f64, side_px: usize| -> Vec<Complex64> {
            (0..side_px).map(|x| Complex64::cis(TAU * nu * x as f64)).collect()
        };
        let sinc = |x: f64| (PI * x).sin() / (PI * x);
        // Light beyond 4 cycles per pixel moves by more than twice the display's side.
        let share = |nu: f64| 0.5 + 0.5 * (PI * (nu.abs() - 4.0).clamp(0.0, 1.5) / 1.5).cos();
        let [width_px, height_px] = SIDES_PX;
        let along_y: Vec<Vec<Complex64>> = (0..ORDERS * BINS).map(|fine| turns(nu(fine), height_px)).collect();
        let columns: Vec<Vec<Complex64>> = (0..ORDERS * BINS)
            .into_par_iter()
            .map(|fine_x| {
                let (nu_x, mut column) = (nu(fine_x), vec![Complex64::ZERO; height_px]);
                let turns_x = turns(nu_x, width_px);
                let row = |y: usize| field.row(y).iter().zip(&turns_x).map(|(c, t)| c * t.conj()).sum::<Complex64>();
                let rows: Vec<Complex64> = (0..height_px).map(row).collect();
                for (fine_y, turns_y) in along_y.iter().enumerate() {
                    let nu_y = nu(fine_y);
                    let spectrum: Complex64 = rows.iter().zip(turns_y).map(|(c, t)| c * t.conj()).sum();
                    let free = angular_spectrum(nu_x / 8e-6, nu_y / 8e-6, wavelength_m, distance_m);
                    let pixel = share(nu_x) * share(nu_y) * sinc(fill_x * nu_x) * sinc(fill_y * nu_y);
                    let value = spectrum * free * errors(model, [nu_x, nu_y]) * (pixel * (fill_x * fill_y).sqrt());
                    column.iter_mut().zip(turns_y).for_each(|(sum, turn)| *sum += value * turn);
                }
                column
            })
            .collect();
        let along_x: Vec<Vec<Complex64>> = (0..ORDERS * BINS).map(|fine| turns(nu(fine), width_px)).collect();
        Plane::from_fn(height_px, width_px, |y, x| {
            let sum: Complex64 = columns.iter().zip(&along_x).map(|(column, turns)| column[y] * turns[x]).sum();
            sum / (BINS * BINS) as f64
        })
    }

    #[test]
    fn field_behind_errors_of_each_order_is_a_sum_over_all_orders() {
        // The display's side of 36 px is that of light of 2.2 and 1.1 cycles per pixel.
        for (distance_m, within) in [(2e-3, 5e-2), (4e-3, 5e-2)] {
            let model = display(distance_m);
            let field =
                initial_phase(SIDES_PX[1], SIDES_PX[0], 6.0, 3).unwrap().map(|phase| Complex64::cis(phase.into()));
            let engine = EngineCore::<f64>::new(&model, Detector::Point, None).unwrap();
            let (found, expected) = (engine.propagate(&field).unwrap(), summed(&model, &field));
            let sum = |of: &dyn Fn(usize, usize) -> f64| {
                (3..21).flat_map(|y| (8..28).map(move |x| (y, x))).map(|(y, x)| of(y, x)).sum::<f64>()
            };
            let wrong = sum(&|y, x| (found.at(y, x) - expected.at(y, x)).norm_sqr());
            let difference = (wrong / sum(&|y, x| expected.at(y, x).norm_sqr())).sqrt();
            assert!(difference < within, "{distance_m} m: {difference:e}");
        }
    }

    #[test]
    fn without_errors_the_transfer_functions_are_exact() {
        let phase = initial_phase(SIDES_PX[1], SIDES_PX[0], 6.0, 3).unwrap();
        let ideal = DisplayModel::ideal(setup(2e-3));
        let flat = DisplayModel { kernel: KernelShape::Smooth(SmoothField::flat(3)), ..ideal.clone() };
        let [ideal, flat] = [ideal, flat].map(|model| EngineCore::<f32>::new(&model, Detector::Pixel, None).unwrap());
        assert_eq!(ideal.light(&phase).unwrap(), flat.light(&phase).unwrap());
        let passed = [ideal, flat].map(|engine| engine.light_passed(&phase).unwrap());
        assert!((passed[1] / passed[0] - 1.0).abs() < 1e-6, "{passed:?}");
    }

    #[test]
    fn light_that_one_order_loses_has_passed_less() {
        let phase = initial_phase(SIDES_PX[1], SIDES_PX[0], 6.0, 3).unwrap();
        let passed = |model: &DisplayModel| {
            EngineCore::<f64>::new(model, Detector::Point, None).unwrap().light_passed(&phase.map(f64::from)).unwrap()
        };
        let mut model = DisplayModel { kernel: KernelShape::Smooth(SmoothField::flat(1)), ..display(2e-3) };
        model.beyond = SmoothField::flat(2);
        let all = passed(&model);
        // T_2(v) is −1 in the band.
        model.beyond.log_amplitude[1] = -4.0;
        let less = passed(&model) * (-8.0_f64).exp();
        assert!(less < 0.99 * all && less > 0.5 * all, "{less} of {all}");
    }

    #[test]
    fn errors_beyond_the_band_need_orders_beyond_it() {
        let model = display(2e-3);
        assert!(model.validate().is_ok());
        let first = OpticalSetup::try_new(model.setup.grid(), 515e-9, 2e-3).unwrap();
        assert!(DisplayModel { setup: first, ..model }.validate().is_err());
    }
}
