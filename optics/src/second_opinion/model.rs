//! The independent model: light on rows of the image, from the definition of the angular spectrum.
//!
//! ```text
//! light = Σ_x′ Σ_y′ g_x(x′ − x) g_y(y′ − y) Σ_l w_l |u_l(x′, y′)|²
//! u_l(x, y) = ∫∫ A(ν) E(ν) E_l(ν) Σ_m Σ_n P(f) H(f) e^{i2π(f_x·x + f_y·y)} dν_x dν_y,   f = (ν_x + m, ν_y + n)
//! A(ν) = Σ_x Σ_y k(x, y) a(x, y) (e^{ir(ψ)} + z₀) e^{−i2π(ν_x·x + ν_y·y)},   ψ = K wrap(φ + grating)
//! H(f) = e^{i2πz(√(1/λ² − f²/Δ²) − 1/λ)},   P(f) = sinc(w_x f_x) sinc(w_y f_y)
//! ```
//!
//! Places x, y in pixels, frequencies in cycles per pixel, ν from −½ to ½. A display that shows the first order has m =
//! n = 0 and P = 1, or what its filter passes; one that shows all orders has every order that reaches the image, and E of a
//! smooth kernel at f: in the band, and beyond it that of the nearest frequency of the band times a series. w_x
//! and w_y are the sides of a pixel's bright area in pixel pitches, E the errors of a learned kernel, E_l those of mode
//! l of the light relative to it, w_l the mode's part of the light, a the source profile with its dust, r the phase
//! response, z₀ undiffracted light, λ wavelength \[m\], z distance \[m\], Δ pixel pitch \[m\], g the Gaussians of the
//! blur of the light. Kernels that vary over the SLM, and those with a value for each frequency, are in
//! [`super::kernels`].
//!
//! The integral along x is summed node by node of its panels, so that the whole spectrum is never held.

use super::free_space::{free_space, free_space_along_y, turn};
use super::frequencies::{Axis, Frequencies, PANELS, frequency};
use super::kernels::{Parts, Residual};
use super::modulator::on_modulator;
use super::vectors::{Components, dots, fold_products};
use crate::display::{Carrier, DisplayModel, KernelShape};
use crate::hologram::Wanted;
use crate::interrupt;
use crate::numerics::buffers::zeros;
use crate::numerics::smooth_field::SeriesAlongY;
use crate::numerics::{Plane, SmoothField};
use lightpath_fft::{Fft, FftPlanner};
use num_complex::Complex64;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::sync::Arc;

/// Places in each pixel, from its centre \[px\]: all pairs of these along x and y.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Places {
    pub(super) along_x: Vec<f64>,
    pub(super) along_y: Vec<f64>,
}

impl Places {
    pub(super) fn count(&self) -> usize {
        self.along_x.len() * self.along_y.len()
    }

    fn moved(&self, centre_x_px: f64, centre_y_px: f64) -> Self {
        let add = |places: &[f64], centre: f64| places.iter().map(|place| place + centre).collect();
        Self { along_x: add(&self.along_x, centre_x_px), along_y: add(&self.along_y, centre_y_px) }
    }
}

/// At most `rows_max` rows of a region, evenly distributed over those in which a pixel counts.
pub(super) fn rows(wanted: &Wanted<'_>, rows_max: usize) -> Vec<usize> {
    let all = wanted.region.y_px()..wanted.region.y_px() + wanted.region.height_px();
    let counts = |y: usize| wanted.region.columns(y).is_some_and(|mut columns| columns.any(|x| wanted.counts(y, x)));
    let counting: Vec<usize> = all.filter(|&y| counts(y)).collect();
    let count = counting.len().min(rows_max);
    (0..count).map(|i| counting[(2 * i + 1) * counting.len() / (2 * count)]).collect()
}

/// Mean over `phases` of the light on the rows: for each place, ordered by y, then by x, a plane of the rows.
pub(super) fn light(
    display: (&DisplayModel, Option<Carrier>),
    phases: &[Plane<f32>],
    places: &Places,
    rows: &[usize],
    frequencies: &Frequencies,
) -> Vec<Plane<f64>> {
    let [along_x, along_y] = display.0.light_blur.sigma_px().map(gaussian);
    let reach = along_y.len() as i64 - 1;
    let last_y = display.0.setup.grid().height_px() as i64 - 1;
    let on_frame = |y: usize, away: i64| (y as i64 + away).clamp(0, last_y) as usize;
    let near: BTreeSet<usize> =
        rows.iter().flat_map(|&y| (-reach..=reach).map(move |away| on_frame(y, away))).collect();
    let near: Vec<usize> = near.into_iter().collect();
    let blurred = |sharp: Plane<f64>| {
        let last_x = sharp.width_px() as i64 - 1;
        let of_row = |y: usize| near.binary_search(&y).unwrap_or_else(|_| unreachable!("all rows nearby are there"));
        Plane::from_fn(rows.len(), sharp.width_px(), |row, x| {
            let column = |x: i64| {
                let rows = (-reach..=reach).map(|away| (away, of_row(on_frame(rows[row], away))));
                rows.map(|(away, y)| along_y[away.unsigned_abs() as usize] * sharp.at(y, x as usize)).sum::<f64>()
            };
            let reach = along_x.len() as i64 - 1;
            (-reach..=reach)
                .map(|away| along_x[away.unsigned_abs() as usize] * column((x as i64 + away).clamp(0, last_x)))
                .sum()
        })
    };
    let sharp = sharp_light(display, phases, places, &near, frequencies);
    if display.0.light_blur.is_none() { sharp } else { sharp.into_iter().map(blurred).collect() }
}

/// Rows whose light blurs into that of one row.
pub(super) fn rows_for_each(model: &DisplayModel) -> usize {
    let [_, along_y] = model.light_blur.sigma_px().map(gaussian);
    2 * along_y.len() - 1
}

/// Weights of a Gaussian of standard deviation `sigma_px` at its middle and at the pixels on one side, as far as they
/// count: at most six.
fn gaussian(sigma_px: f64) -> Vec<f64> {
    /// Weight relative to the middle's, below which a pixel does not count.
    const LEAST: f64 = 1e-9;
    let weight = |away: i32| match away {
        0 => 1.0,
        _ => (-0.5 * (f64::from(away) / sigma_px).powi(2)).exp(),
    };
    let side: Vec<f64> = (0..=6).map(weight).take_while(|&weight| weight > LEAST).collect();
    let total = side[0] + 2.0 * side[1..].iter().sum::<f64>();
    side.into_iter().map(|weight| weight / total).collect()
}

/// [`light`] before its blur.
fn sharp_light(
    (model, carrier): (&DisplayModel, Option<Carrier>),
    phases: &[Plane<f32>],
    places: &Places,
    rows: &[usize],
    frequencies: &Frequencies,
) -> Vec<Plane<f64>> {
    let (window, pitch_m) = (model.setup.window(), model.setup.grid().pixel_pitch_m());
    let places = places.moved(window.centre_x_m() / pitch_m, window.centre_y_m() / pitch_m);
    let mut tables = Tables::new(model, &places, rows, frequencies);
    let width_px = model.setup.grid().width_px();
    let mut lights = vec![Plane::filled(rows.len(), width_px, 0.0); places.count()];
    let all_light: f64 = 1.0 + model.coherence.modes().iter().map(|mode| mode.light).sum::<f64>();
    for mode in std::iter::once(None).chain(model.coherence.modes().iter().map(Some)) {
        tables.mode = mode.map(|mode| &mode.errors);
        let share = mode.map_or(1.0, |mode| mode.light) / (all_light * phases.len() as f64);
        for phase in phases {
            let image = tables.image(&on_modulator(model, carrier, phase));
            for (line, field) in image.chunks_exact(width_px).enumerate() {
                let (row, place) = (line / places.count(), line % places.count());
                let light = &mut lights[place].values_mut()[row * width_px..][..width_px];
                light.iter_mut().zip(field).for_each(|(sum, u)| *sum += share * u.norm_sqr());
            }
        }
    }
    lights
}

fn tilts(model: &DisplayModel) -> [f64; 2] {
    let KernelShape::Smooth(kernel) = &model.kernel else { return [0.0; 2] };
    let term = |wanted| kernel.basis().degrees().zip(&kernel.phase).find(|(degrees, _)| *degrees == wanted);
    [(1, 0), (0, 1)].map(|wanted| term(wanted).map_or(0.0, |(_, phase)| *phase))
}

/// The nearest place in the band to a frequency [cycles per pixel], and how far beyond it the frequency is, in half
/// bands.
fn in_band_and_beyond(frequency: f64) -> (f64, f64) {
    match 2.0 * frequency {
        below if below < -1.0 => (-1.0, below + 1.0),
        above if above > 1.0 => (1.0, above - 1.0),
        within => (within, 0.0),
    }
}

fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) }
}

/// Frequencies along x whose fields on the rows are computed together.
const TOGETHER: usize = 4;

/// Tables and transforms for all frequencies.
struct Tables<'a> {
    model: &'a DisplayModel,
    /// Errors of the mode of light relative to the kernel; `None`: the first mode.
    mode: Option<&'a SmoothField>,
    /// Parts of the modulator, each with errors of its own.
    parts: Parts,
    /// Terms T_1 along x and y of the kernel's phase.
    tilts: [f64; 2],
    /// What a kernel with a value for each frequency adds to free space.
    residual: Option<Residual>,
    places: &'a Places,
    x: &'a Axis,
    y: &'a Axis,
    /// Transform of the panels, from places to frequencies and back.
    to_panels: Arc<dyn Fft<f64>>,
    from_panels: Arc<dyn Fft<f64>>,
    /// Nodes along x with their weights.
    nodes_x: Vec<(f64, f64)>,
    /// Frequencies along y with their weights: all panels of the first node, then of the next one.
    frequencies_y: Vec<(f64, f64)>,
    /// For each node along y, e^{−i2πν₀y} on the rows of the display and of the residual, ν₀ its lowest frequency.
    lowest_y: Vec<Vec<Complex64>>,
    /// For each wanted row each place along y: e^{i2πν(y + place)} at all frequencies along y.
    waves_y: Vec<Components>,
}

impl<'a> Tables<'a> {
    fn new(model: &'a DisplayModel, places: &'a Places, rows: &[usize], frequencies: &'a Frequencies) -> Self {
        let Frequencies { along_x: x, along_y: y } = frequencies;
        let (mut planner, nodes_y) = (FftPlanner::new(), y.nodes());
        let panels = |&(node, weight): &(f64, f64)| (0..PANELS).map(move |panel| (frequency(panel, node), weight));
        let frequencies_y: Vec<(f64, f64)> = nodes_y.iter().flat_map(panels).collect();
        let residual = Residual::of(model);
        let rows_max = model.setup.grid().height_px().max(residual.as_ref().map_or(0, |r| r.response.height_px()));
        let lowest = |&(node, _): &(f64, f64)| (0..rows_max).map(|y| turn(-frequency(0, node) * y as f64)).collect();
        let at: Vec<f64> =
            rows.iter().flat_map(|&row| places.along_y.iter().map(move |place| row as f64 + place)).collect();
        let waves = |at: &f64| Components::of(frequencies_y.iter().map(|(frequency, _)| turn(frequency * at)));
        Self {
            model,
            mode: None,
            parts: Parts::of(model),
            tilts: tilts(model),
            residual,
            places,
            x,
            y,
            to_panels: planner.plan_fft_forward(PANELS),
            from_panels: planner.plan_fft_inverse(PANELS),
            nodes_x: x.nodes(),
            lowest_y: nodes_y.iter().map(lowest).collect(),
            waves_y: at.par_iter().map(waves).collect(),
            frequencies_y,
        }
    }

    /// Whether each place has a transfer function of its own.
    fn has_orders(&self) -> bool {
        self.model.setup.orders().are_all()
    }

    /// Field in the image: for each wanted row and each place a line.
    fn image(&self, field: &Plane<Complex64>) -> Vec<Complex64> {
        let lines = self.waves_y.len() * self.places.along_x.len();
        let mut image: Vec<Complex64> = zeros(lines * field.width_px());
        for &(node, weight) in &self.nodes_x {
            let of_part = |window: &Option<Vec<f64>>| self.spectra_of_rows(field, window.as_deref(), node);
            let spectra: Vec<_> = self.parts.along_x.iter().map(of_part).collect();
            let residual = self.residual.as_ref().map(|residual| self.spectra_of_rows(&residual.response, None, node));
            let behind = |panel| self.behind(&spectra, residual.as_ref(), panel, frequency(panel, node));
            // The spectra behind all orders take much memory, one for each place.
            let columns = match self.has_orders() {
                true => self.columns::<1>(behind),
                false => self.columns::<TOGETHER>(behind),
            };
            self.add(&columns, node, weight, &mut image);
        }
        image
    }

    /// Field on the wanted rows at one node of all panels along x, from the spectra `behind` the optics in each panel.
    fn columns<const COUNT: usize>(
        &self,
        behind: impl Fn(usize) -> Vec<Components> + Sync + Send,
    ) -> Vec<Vec<Complex64>> {
        let groups = (0..PANELS / COUNT).into_par_iter().flat_map_iter(|group| {
            interrupt::check();
            self.on_rows::<COUNT>(&std::array::from_fn(|i| behind(group * COUNT + i)))
        });
        groups.collect()
    }

    /// Spectra of the rows times a window along x, at one node of all panels along x: for each panel all rows.
    fn spectra_of_rows(&self, field: &Plane<Complex64>, window: Option<&[f64]>, node: f64) -> Vec<Vec<Complex64>> {
        let factor = |x: usize| window.map_or(1.0, |window| window[x]);
        let wave: Vec<Complex64> =
            (0..field.width_px()).map(|x| turn(-frequency(0, node) * x as f64) * factor(x)).collect();
        let mut spectra: Vec<Complex64> = zeros(field.height_px() * PANELS);
        spectra.par_chunks_exact_mut(PANELS).enumerate().for_each(|(y, spectrum)| {
            interrupt::check();
            fold_products(field.row(y), &wave, spectrum);
            self.to_panels.process(spectrum);
        });
        let of_panel = |panel: usize| spectra[panel..].iter().step_by(PANELS).copied().collect();
        (0..PANELS).into_par_iter().map(of_panel).collect()
    }

    /// Spectrum of one panel's rows times a window along y, at all frequencies along y.
    fn spectrum_along_y(&self, rows: &[Complex64], window: Option<&[f64]>) -> Vec<Complex64> {
        let windowed = window.map(|window| rows.iter().zip(window).map(|(u, window)| u * window).collect::<Vec<_>>());
        let rows = windowed.as_deref().unwrap_or(rows);
        let mut spectrum = vec![Complex64::ZERO; self.frequencies_y.len()];
        for (spectrum, lowest) in spectrum.chunks_exact_mut(PANELS).zip(&self.lowest_y) {
            fold_products(rows, lowest, spectrum);
            self.to_panels.process(spectrum);
        }
        spectrum
    }

    /// Field on the wanted rows at some frequencies along x: for each row and place along y (and x, where the places have
    /// transfer functions of their own). `behind` are the spectra at these frequencies; they share what is read of each
    /// wave.
    fn on_rows<const COUNT: usize>(&self, behind: &[Vec<Components>; COUNT]) -> [Vec<Complex64>; COUNT] {
        let across = behind[0].len() / if self.has_orders() { self.places.along_y.len() } else { 1 };
        let mut columns = std::array::from_fn(|_| Vec::with_capacity(self.waves_y.len() * across));
        for (i, wave) in self.waves_y.iter().enumerate() {
            let first = if self.has_orders() { i % self.places.along_y.len() * across } else { 0 };
            for place in first..first + across {
                let fields = dots(behind.each_ref().map(|spectra| &spectra[place]), wave);
                columns.iter_mut().zip(fields).for_each(|(column, field)| column.push(field));
            }
        }
        columns
    }

    /// Spectra of the field at one frequency along x, behind the optics and times the weights of the integral: for each
    /// place that has a transfer function of its own.
    fn behind(
        &self,
        spectra: &[Vec<Vec<Complex64>>],
        residual: Option<&Vec<Vec<Complex64>>>,
        panel: usize,
        along_x: f64,
    ) -> Vec<Components> {
        let mut sum = vec![Complex64::ZERO; self.frequencies_y.len()];
        for (part_y, window) in self.parts.along_y.iter().enumerate() {
            for (part_x, spectra) in spectra.iter().enumerate() {
                let spectrum = self.spectrum_along_y(&spectra[panel], window.as_deref());
                let errors = self.parts.errors(part_x, part_y).map(|errors| SeriesAlongY::new(errors, 2.0 * along_x));
                for ((sum, u), (frequency, _)) in sum.iter_mut().zip(spectrum).zip(&self.frequencies_y) {
                    *sum += errors.as_ref().map_or(u, |errors| u * errors.at(2.0 * frequency));
                }
            }
        }
        for (u, &(frequency, weight)) in sum.iter_mut().zip(&self.frequencies_y) {
            let of_mode = self.mode.map_or(Complex64::ONE, |mode| mode.value(2.0 * along_x, 2.0 * frequency));
            *u *= weight * of_mode * self.ghost(along_x, frequency);
        }
        if self.has_orders() {
            return self.behind_orders(&sum, along_x);
        }
        let residual = residual.zip(self.residual.as_ref()).map(|(spectra, residual)| {
            let mut spectrum = self.spectrum_along_y(&spectra[panel], None);
            let [lag_x, lag_y] = residual.first_lags();
            for (value, (frequency, _)) in spectrum.iter_mut().zip(&self.frequencies_y) {
                *value *= turn(-along_x * lag_x) * turn(-frequency * lag_y);
            }
            spectrum
        });
        vec![self.behind_first(sum, residual.as_deref(), along_x)]
    }

    /// Factor of the kernel's ghost at a frequency \[cycles per pixel\].
    fn ghost(&self, fx: f64, fy: f64) -> Complex64 {
        let ghost = &self.model.ghost;
        if ghost.amplitude == Complex64::ZERO {
            return Complex64::ONE;
        }
        let defocus_rad = ghost.defocus_rad * 4.0 * (fx * fx + fy * fy);
        let shift = fx * ghost.shift_px[0] + fy * ghost.shift_px[1];
        1.0 + ghost.amplitude * Complex64::cis(defocus_rad) * turn(shift)
    }

    fn behind_first(&self, mut spectrum: Vec<Complex64>, residual: Option<&[Complex64]>, along_x: f64) -> Components {
        let (setup, filter) = (&self.model.setup, self.model.setup.orders().filter());
        let pitch_m = setup.grid().pixel_pitch_m();
        let free_space =
            free_space_along_y(setup, along_x / pitch_m, || self.frequencies_y.iter().map(|(y, _)| y / pitch_m));
        for (i, ((u, (frequency, _)), free_space)) in
            spectrum.iter_mut().zip(&self.frequencies_y).zip(free_space).enumerate()
        {
            let passed = filter.map_or(1.0, |filter| filter.passed(along_x, *frequency));
            let beside = residual.map_or(Complex64::ZERO, |residual| residual[i]);
            *u *= free_space * passed + beside;
        }
        Components::of(spectrum.into_iter())
    }

    fn behind_orders(&self, spectrum: &[Complex64], along_x: f64) -> Vec<Components> {
        let across = self.places.along_x.len();
        // For each place the spectrum behind its transfer function.
        let mut behind = vec![vec![Complex64::ZERO; spectrum.len()]; self.places.count()];
        let turns = |order: i32, places: &[f64]| -> Vec<Complex64> {
            places.iter().map(|place| turn(f64::from(order) * place)).collect()
        };
        let orders = |axis: &Axis, places: &[f64]| -> Vec<(f64, Vec<Complex64>)> {
            (-axis.orders..=axis.orders).map(|order| (f64::from(order), turns(order, places))).collect()
        };
        let (orders_x, orders_y) = (orders(self.x, &self.places.along_x), orders(self.y, &self.places.along_y));
        let errors_x: Vec<_> = orders_x.iter().map(|(order_x, _)| self.errors_of_orders(along_x + order_x)).collect();
        let mut transfers = vec![Complex64::ZERO; self.places.count()];
        for (l, (u, &(along_y, _))) in spectrum.iter().zip(&self.frequencies_y).enumerate() {
            transfers.fill(Complex64::ZERO);
            for (order_y, turns_y) in &orders_y {
                for ((order_x, turns_x), errors) in orders_x.iter().zip(&errors_x) {
                    let mut h = self.transfer(along_x + order_x, along_y + order_y);
                    if let Some([kernel, beyond]) = errors.as_ref().filter(|_| h != Complex64::ZERO) {
                        let (y, beside) = in_band_and_beyond(along_y + order_y);
                        h *= kernel.at(y) * beyond.at((beside / 4.0).clamp(-1.0, 1.0));
                        h *= self.shift_beyond(along_x + order_x, along_y + order_y);
                    }
                    for (sums, turn_y) in transfers.chunks_exact_mut(across).zip(turns_y) {
                        sums.iter_mut().zip(turns_x).for_each(|(sum, turn_x)| *sum += h * turn_y * turn_x);
                    }
                }
            }
            behind.iter_mut().zip(&transfers).for_each(|(behind, transfer)| behind[l] = u * transfer);
        }
        behind.into_iter().map(|behind| Components::of(behind.into_iter())).collect()
    }

    /// Errors along y of a kernel of a display that shows all orders: at frequencies of the band, and of what exceeds it.
    fn errors_of_orders(&self, fx: f64) -> Option<[SeriesAlongY; 2]> {
        let KernelShape::Smooth(kernel) = &self.model.kernel else { return None };
        let (x, beside) = in_band_and_beyond(fx);
        let u = (beside / 4.0).clamp(-1.0, 1.0);
        Some([SeriesAlongY::new(kernel, x), SeriesAlongY::new(&self.model.beyond, u)])
    }

    /// What the kernel's terms T_1(x) and T_1(y), which move the image, add beyond the band.
    fn shift_beyond(&self, fx: f64, fy: f64) -> Complex64 {
        Complex64::cis(self.tilts[0] * in_band_and_beyond(fx).1 + self.tilts[1] * in_band_and_beyond(fy).1)
    }

    /// P·H at a frequency [cycles per pixel] of any order.
    fn transfer(&self, fx: f64, fy: f64) -> Complex64 {
        let share = self.x.share(fx) * self.y.share(fy);
        if share == 0.0 {
            return Complex64::ZERO;
        }
        let (setup, [fill_x, fill_y]) = (&self.model.setup, self.model.setup.fill_factor());
        let pitch_m = setup.grid().pixel_pitch_m();
        free_space(setup, fx / pitch_m, fy / pitch_m) * (share * sinc(fill_x * fx) * sinc(fill_y * fy))
    }

    /// Adds the light of one node of all panels along x to the image.
    fn add(&self, columns: &[Vec<Complex64>], node: f64, weight: f64, image: &mut [Complex64]) {
        let (width_px, across) = (self.model.setup.grid().width_px(), self.places.along_x.len());
        let wave: Vec<Complex64> = (0..width_px).map(|x| weight * turn(frequency(0, node) * x as f64)).collect();
        let between = |place: &f64| (0..PANELS).map(|panel| turn(frequency(panel, node) * place)).collect();
        let between: Vec<Vec<Complex64>> = self.places.along_x.iter().map(between).collect();
        image.par_chunks_exact_mut(width_px).enumerate().for_each(|(line, row)| {
            interrupt::check();
            let entry = if self.has_orders() { line } else { line / across };
            let mut values: Vec<Complex64> =
                columns.iter().zip(&between[line % across]).map(|(column, between)| column[entry] * between).collect();
            self.from_panels.process(&mut values);
            for (row, wave) in row.chunks_mut(PANELS).zip(wave.chunks(PANELS)) {
                row.iter_mut().zip(&values).zip(wave).for_each(|((u, value), wave)| *u += value * wave);
            }
        });
    }
}
