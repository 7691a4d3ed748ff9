//! A decoder of the compact form, written from `docs/compact-kernel.md` alone: plain sums in f64.

use num_complex::Complex64;
use std::f64::consts::{PI, TAU};

/// What the document's table names.
pub(crate) struct Kernel {
    order: usize,
    method: u8,
    rows: usize,
    columns: usize,
    pitch: f64,
    wavelength: f64,
    z: f64,
    alpha: Vec<f64>,
    psi: Vec<f64>,
}

/// Reads a kernel.
pub(crate) fn read(file: &[u8]) -> Kernel {
    let whole = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    let double = |at: usize| f64::from_le_bytes(file[at..at + 8].try_into().unwrap());
    let order = usize::from(file[6]);
    let terms = (order + 1) * (order + 2) / 2 - 1;
    let series = |start: usize| {
        let numbers = file[start..start + 4 * terms].chunks_exact(4);
        numbers.map(|bytes| f64::from(f32::from_le_bytes(bytes.try_into().unwrap()))).collect()
    };
    Kernel {
        order,
        method: file[9],
        rows: whole(12),
        columns: whole(16),
        pitch: double(20),
        wavelength: double(28),
        z: double(36),
        alpha: series(60),
        psi: series(60 + 4 * terms),
    }
}

fn cis(angle: f64) -> Complex64 {
    Complex64::new(angle.cos(), angle.sin())
}

/// s(x, y) = Σ c_ij T_i(x) T_j(y).
fn series(coefficients: &[f64], order: usize, x: f64, y: f64) -> f64 {
    fn chebyshev(i: usize, x: f64) -> f64 {
        match i {
            0 => 1.0,
            1 => x,
            _ => 2.0 * x * chebyshev(i - 1, x) - chebyshev(i - 2, x),
        }
    }
    let degrees = (0..=order).flat_map(|i| (0..=order - i).map(move |j| (i, j))).skip(1);
    coefficients.iter().zip(degrees).map(|(c, (i, j))| c * chebyshev(i, x) * chebyshev(j, y)).sum()
}

impl Kernel {
    /// A(fx, fy), the angular spectrum.
    fn angular_spectrum(&self, fx: f64, fy: f64) -> Complex64 {
        let (z, wavelength, f_squared) = (self.z, self.wavelength, fx * fx + fy * fy);
        let s = wavelength * wavelength * f_squared;
        if s <= 1.0 {
            cis(-TAU * z * wavelength * f_squared / (1.0 + (1.0 - s).sqrt()))
        } else if z > 0.0 {
            cis(-TAU * z / wavelength) * (-TAU * z * (s - 1.0).sqrt() / wavelength).exp()
        } else {
            Complex64::ZERO
        }
    }

    fn is_in_band_limit(&self, fx: f64, fy: f64) -> bool {
        let (x, y) = ((self.wavelength * fx).powi(2), (self.wavelength * fy).powi(2));
        let widened = |side: usize| (self.z / (side as f64 * self.pitch)).powi(2) + 1.0;
        x * widened(self.columns) + y <= 1.0 && y * widened(self.rows) + x <= 1.0
    }

    /// H_ideal at all padded frequencies, in the order of the discrete Fourier transform.
    fn ideal(&self) -> Vec<Complex64> {
        let at_frequencies = |of: &dyn Fn(f64, f64) -> Complex64| {
            let f = |i: usize, side: usize| {
                let n = if i < side { i as f64 } else { i as f64 - 2.0 * side as f64 };
                n / (2.0 * side as f64 * self.pitch)
            };
            let bins = (0..2 * self.rows).flat_map(|v| (0..2 * self.columns).map(move |u| (u, v)));
            bins.map(|(u, v)| of(f(u, self.columns), f(v, self.rows))).collect()
        };
        match self.method {
            0 => at_frequencies(&|fx, fy| {
                if self.is_in_band_limit(fx, fy) { self.angular_spectrum(fx, fy) } else { Complex64::ZERO }
            }),
            1 => at_frequencies(&|fx, fy| self.angular_spectrum(fx, fy)),
            4 => at_frequencies(&|fx, fy| cis(-PI * self.wavelength * self.z * (fx * fx + fy * fy))),
            2 => {
                let h = self.band_response();
                self.transformed(|m, n| h[n * (self.columns + 1) + m])
            }
            3 => self.transformed(|m, n| self.unless_a_whole_side(m, n, |x, y| self.rayleigh_sommerfeld(x, y))),
            5 => self.transformed(|m, n| self.unless_a_whole_side(m, n, |x, y| self.fresnel(x, y))),
            other => panic!("method {other}"),
        }
    }

    /// h at the place of a lag, and 0 at the lag of a whole side.
    fn unless_a_whole_side(&self, m: usize, n: usize, h: impl Fn(f64, f64) -> Complex64) -> Complex64 {
        if m == self.columns || n == self.rows {
            return Complex64::ZERO;
        }
        h(m as f64 * self.pitch, n as f64 * self.pitch)
    }

    fn rayleigh_sommerfeld(&self, x: f64, y: f64) -> Complex64 {
        let (z, k) = (self.z.abs(), TAU / self.wavelength);
        let r = (x * x + y * y + z * z).sqrt();
        let steepness = 2.0 * self.pitch / self.wavelength * x.max(y) / r;
        let weight = match steepness {
            s if s <= 1.0 => 1.0,
            s if s < 1.5 => (PI * (s - 1.0)).cos().powi(2),
            _ => 0.0,
        };
        let front = weight * self.pitch * self.pitch * z / (TAU * r * r);
        let h = front * Complex64::new(1.0 / r, -k) * cis(k * (r - z));
        if self.z < 0.0 { h.conj() } else { h }
    }

    fn fresnel(&self, x: f64, y: f64) -> Complex64 {
        let area = self.wavelength * self.z;
        cis(PI * (x * x + y * y) / area) * self.pitch * self.pitch / Complex64::new(0.0, area)
    }

    /// H(fx, fy) = Σ h(m, n) e^{−i2πΔ(m fx + n fy)} for an even h, first along x, then along y.
    fn transformed(&self, h: impl Fn(usize, usize) -> Complex64) -> Vec<Complex64> {
        let (rows, columns) = (2 * self.rows, 2 * self.columns);
        let sum = |bins: usize, f: usize, of: &dyn Fn(usize) -> Complex64| -> Complex64 {
            (0..bins).map(|lag| of(lag.min(bins - lag)) * cis(-TAU * (f * lag % bins) as f64 / bins as f64)).sum()
        };
        let along_x: Vec<Vec<Complex64>> =
            (0..=self.rows).map(|n| (0..columns).map(|u| sum(columns, u, &|m| h(m, n))).collect()).collect();
        let bins = (0..rows).flat_map(|v| (0..columns).map(move |u| (u, v)));
        bins.map(|(u, v)| sum(rows, v, &|n| along_x[n][u])).collect()
    }

    /// Numbers M of frequencies along x and y.
    fn sums(&self) -> [usize; 2] {
        let sine = self.wavelength / (2.0 * self.pitch);
        let spread = (2.0 * self.z.abs() * sine / (self.pitch * (1.0 - sine * sine).sqrt())).ceil() as usize;
        let fast = |least: usize| {
            let is_fast = |n: &usize| {
                let mut rest = *n;
                for factor in [2, 3, 5] {
                    while rest.is_multiple_of(factor) {
                        rest /= factor;
                    }
                }
                rest == 1
            };
            (least..).find(is_fast).unwrap()
        };
        let pairs = [(4, 2), (3, 1), (2, 1)].into_iter();
        let mut sums = pairs.map(|(a, b)| {
            [self.columns, self.rows].map(|side| 2 * fast((a * side + b * spread).max(1024).div_ceil(2)))
        });
        sums.find(|[x, y]| x / 2 * (y / 2) <= 1 << 27).unwrap()
    }

    /// D(f), the slope of A at the end of the band.
    fn slope(&self, f: f64) -> Complex64 {
        let end = 1.0 / (2.0 * self.pitch);
        let c = 1.0 - self.wavelength * self.wavelength * (end * end + f * f);
        if c <= 0.0 {
            return Complex64::ZERO;
        }
        let factor = -TAU * self.z * self.wavelength / (2.0 * self.pitch * self.pitch * c.sqrt());
        Complex64::new(0.0, factor) * self.angular_spectrum(end, f)
    }

    /// h(m, n) for n = 0 … rows, and for each of them m = 0 … columns.
    fn band_response(&self) -> Vec<Complex64> {
        let [sums_x, sums_y] = self.sums();
        let table = |sums: usize| -> Vec<f64> { (0..sums).map(|i| (TAU * i as f64 / sums as f64).cos()).collect() };
        let (cosines_x, cosines_y) = (table(sums_x), table(sums_y));
        // Σ over u = −M/2 … M/2 − 1 of g(u) e^{i2πu·lag/M} for an even g.
        let even_sum = |cosines: &[f64], lag: usize, g: &dyn Fn(usize) -> Complex64| -> Complex64 {
            let sums = cosines.len();
            let term = |u: usize| {
                let both = if u == 0 || u == sums / 2 { 1.0 } else { 2.0 };
                g(u) * both * cosines[u * lag % sums]
            };
            (0..=sums / 2).map(term).sum()
        };
        let f = |u: usize, sums: usize| u as f64 / (sums as f64 * self.pitch);
        let sign = |lag: usize| if lag.is_multiple_of(2) { 1.0 } else { -1.0 };
        let (columns, rows) = (0..=self.columns, 0..=self.rows);
        let slopes = |sums: usize| -> Vec<Complex64> { (0..=sums / 2).map(|u| self.slope(f(u, sums))).collect() };
        let (slopes_x, slopes_y) = (slopes(sums_x), slopes(sums_y));
        let error_x: Vec<Complex64> = rows.clone().map(|n| even_sum(&cosines_y, n, &|v| slopes_y[v])).collect();
        let error_y: Vec<Complex64> = columns.clone().map(|m| even_sum(&cosines_x, m, &|u| slopes_x[u])).collect();
        let along_y: Vec<Vec<Complex64>> = (0..=sums_x / 2)
            .map(|u| {
                let values: Vec<Complex64> =
                    (0..=sums_y / 2).map(|v| self.angular_spectrum(f(u, sums_x), f(v, sums_y))).collect();
                rows.clone().map(|n| even_sum(&cosines_y, n, &|v| values[v])).collect()
            })
            .collect();
        let all = (sums_x * sums_y) as f64;
        let at = |m: usize, n: usize| {
            let plain = even_sum(&cosines_x, m, &|u| along_y[u][n]);
            let along_x = error_x[n] * sign(m) / (6.0 * sums_x as f64);
            let along_y = error_y[m] * sign(n) / (6.0 * sums_y as f64);
            (plain - along_x - along_y) / all
        };
        rows.flat_map(|n| columns.clone().map(move |m| (m, n))).map(|(m, n)| at(m, n)).collect()
    }

    /// H = H_ideal · exp(α + iψ) at all padded frequencies.
    pub(crate) fn transfer(&self) -> Vec<Complex64> {
        let (rows, columns) = (2 * self.rows, 2 * self.columns);
        let signed = |i: usize, n: usize| (if i < n / 2 { i as f64 } else { i as f64 - n as f64 }) / n as f64;
        let error = |i: usize| {
            let (x, y) = (2.0 * signed(i % columns, columns), 2.0 * signed(i / columns, rows));
            series(&self.alpha, self.order, x, y).exp() * cis(series(&self.psi, self.order, x, y))
        };
        self.ideal().into_iter().enumerate().map(|(i, ideal)| ideal * error(i)).collect()
    }
}
