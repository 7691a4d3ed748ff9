//! Frequencies and weights with which the independent model integrates over the spectrum.
//!
//! The band of one order, 1 cycle per pixel, is cut into panels. Each is integrated by a quadrature:
//!
//! ```text
//! ν = (p + τ)/L − ½ cycles per pixel,   p = 0 … L−1 panel, τ from 0 to 1 node
//! ```
//!
//! The same node of all panels lies on a regular grid, so that a short Fourier transform computes it. There is no
//! padded frame: light that leaves the image cannot come back into it. The integrand turns by c = N + S cycles over the
//! band,
//!
//! ```text
//! S = z/Δ · λf/√(1 − λ²(f_x² + f_y²)) pixels,   f = 1/2Δ for the first order
//! ```
//!
//! the pixels over which the light of a pixel spreads to each side, at least N for a kernel with a value for each bin of
//! the engine's padded frame. The band of the first order ends sharply;
//! Gauss–Legendre quadrature is exact to rounding if a panel has some nodes more than π/2 per cycle. λ wavelength
//! \[m\], z distance \[m\], Δ pixel pitch \[m\], N side of the display \[px\].
//!
//! With all orders the frequencies ν + m of every order m count from which light reaches the image. The frequency of
//! light that moves by x on its way is x/(λ√(x² + z²)); beyond that of the display's side the orders fade out smoothly,
//! so that the end has no effect in the image. Their sum is periodic and smooth: equally spaced nodes, one per cycle,
//! are exact.

use crate::display::{OpticalSetup, Orders};
use crate::numerics::quadrature::gauss_legendre;
use std::f64::consts::{FRAC_PI_2, PI};

/// Panels along an axis.
pub(super) const PANELS: usize = 64;
/// Nodes of a panel besides those that the turns of the integrand need.
const SPARE_NODES: usize = 8;
/// Smallest cosine of the angle between light and axis that is taken into account. Light nearer to the plane is spread
/// thinly.
const COSINE_MIN: f64 = 0.2;

/// Frequencies along both axes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Frequencies {
    pub(super) along_x: Axis,
    pub(super) along_y: Axis,
}

/// Frequencies along an axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    /// Number of nodes of a panel.
    nodes: usize,
    /// Whether the integrand is periodic, so that the nodes are equally spaced.
    is_periodic: bool,
    /// Orders to each side of the first one in which frequencies count.
    pub(super) orders: i32,
    /// Frequencies at which the orders begin and end to fade out \[cycles per pixel\].
    fades: [f64; 2],
}

impl Frequencies {
    /// `has_bins`: the kernel has a value for each frequency, and a response that is as long as the padded frame.
    pub(super) fn of(setup: &OpticalSetup, has_bins: bool) -> Self {
        let (grid, pitch_m, window) = (setup.grid(), setup.grid().pixel_pitch_m(), setup.window());
        let ways_px = [
            grid.width_px() as f64 + window.centre_x_m().abs() / pitch_m,
            grid.height_px() as f64 + window.centre_y_m().abs() / pitch_m,
        ];
        let fades = ways_px.map(|way_px| fades(setup, way_px));
        let ends = match setup.orders() {
            Orders::First | Orders::Filtered(_) => [0.5; 2],
            Orders::All { .. } => fades.map(|[_, end]| end),
        };
        let sines = ends.map(|end| (end * setup.wavelength_m() / pitch_m).min(1.0));
        let cosine = (1.0 - sines[0] * sines[0] - sines[1] * sines[1]).max(COSINE_MIN * COSINE_MIN).sqrt();
        let axis = |i: usize| {
            let spread_px = setup.distance_m().abs() / pitch_m * sines[i] / cosine;
            let spread_px = if has_bins { spread_px.max(ways_px[i]) } else { spread_px };
            let cycles = ((ways_px[i] + spread_px) / PANELS as f64).min(1e6);
            let (is_periodic, nodes, orders) = match setup.orders() {
                Orders::First | Orders::Filtered(_) => (false, (FRAC_PI_2 * cycles) as usize + SPARE_NODES, 0),
                Orders::All { .. } => (true, cycles as usize + 2, (ends[i] - 0.5).ceil().max(0.0) as i32),
            };
            Axis { nodes, is_periodic, orders, fades: fades[i] }
        };
        Self { along_x: axis(0), along_y: axis(1) }
    }

    /// Number of values of the transfer function.
    pub(super) fn values(&self) -> u64 {
        let along = |axis: &Axis| {
            let orders = (2.0 * axis.fades[1] + 1.0).min(f64::from(2 * axis.orders + 1));
            (PANELS * axis.nodes) as f64 * orders
        };
        (along(&self.along_x) * along(&self.along_y)) as u64
    }
}

/// Where the orders begin and end to fade out [cycles per pixel]. `way_px` is the longest way of light along the axis
/// that ends in the image.
fn fades(setup: &OpticalSetup, way_px: f64) -> [f64; 2] {
    let (pitch_m, z, wavelength_m) = (setup.grid().pixel_pitch_m(), setup.distance_m().abs(), setup.wavelength_m());
    let way_m = way_px * pitch_m;
    let reached = way_m / (wavelength_m * way_m.hypot(z)) * pitch_m;
    // Width of a Fresnel zone in the spectrum: over several of them the fading is smooth.
    let zone = pitch_m / (wavelength_m * z).sqrt();
    let begin = reached + 2.0 * zone;
    // Waves do not travel beyond 1/λ.
    let limit = pitch_m / wavelength_m;
    [begin, (begin + (0.25 * reached).max(4.0 * zone)).min(limit.max(1.01 * begin))]
}

impl Axis {
    /// The nodes τ of a panel, with the weights of their frequencies. Takes O(nodes²), so ask only for what is
    /// affordable.
    pub(super) fn nodes(&self) -> Vec<(f64, f64)> {
        let on_unit = |(node, weight): (f64, f64)| (0.5 + 0.5 * node, 0.5 * weight / PANELS as f64);
        match self.is_periodic {
            true => {
                let even = |i| ((i as f64 + 0.5) / self.nodes as f64, 1.0 / (self.nodes * PANELS) as f64);
                (0..self.nodes).map(even).collect()
            }
            false => gauss_legendre(self.nodes).into_iter().map(on_unit).collect(),
        }
    }

    /// Part of a frequency \[cycles per pixel\] that counts, from 0 to 1.
    pub(super) fn share(&self, frequency: f64) -> f64 {
        let [begin, end] = self.fades;
        let t = ((frequency.abs() - begin) / (end - begin)).clamp(0.0, 1.0);
        (0.5 * PI * t).cos().powi(2)
    }
}

/// Frequency of a node in a panel [cycles per pixel].
pub(super) fn frequency(panel: usize, node: f64) -> f64 {
    (panel as f64 + node) / PANELS as f64 - 0.5
}
