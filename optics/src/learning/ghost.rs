//! Derivatives by a ghost's numbers.
//!
//! With H = S · (1 + g e^{iθ}), θ = π(x s_x + y s_y) + d(x² + y²):
//!
//! ```text
//! ∂H/∂Re g = E,   ∂H/∂Im g = iE,   ∂H/∂s_x = iπ x g E,   ∂H/∂s_y = iπ y g E,   ∂H/∂d = i(x² + y²) g E,   E = S e^{iθ}
//! ```

use super::smooth_transfer::SmoothTransfer;
use crate::display::Ghost;
use crate::engine::Real;
use crate::engine::convolution::Transfer;
use num_complex::{Complex, Complex64};
use std::f64::consts::PI;

/// Σ along a column of u · g* · E · (1, y, y²), and the column's x.
pub(super) type GhostSums = ([Complex64; 3], f64);

pub(super) const NO_GHOST_SUMS: GhostSums = ([Complex64::ZERO; 3], 0.0);

/// ∂L by the numbers of the ghost, from the sums of all columns.
pub(super) fn ghost_gradient<'a>(ghost: &Ghost, columns: impl Iterator<Item = &'a GhostSums>) -> [f64; 5] {
    let mut sums = [Complex64::ZERO; 4];
    for ([one, along_y, squared], x) in columns {
        let of_column = [*one, one * x, *along_y, one * x * x + squared];
        sums.iter_mut().zip(of_column).for_each(|(sum, value)| *sum += value);
    }
    let [one, along_x, along_y, squared] = sums;
    // ∂L = 2 Re Σ u g* ∂H.
    let turned = |sum: Complex64| -2.0 * (ghost.amplitude * sum).im;
    [2.0 * one.re, -2.0 * one.im, PI * turned(along_x), PI * turned(along_y), turned(squared)]
}

impl<T: Real> SmoothTransfer<T> {
    /// Multiplies a transfer function by the factor of a ghost.
    pub(super) fn add_ghost(&self, ghost: &Ghost, transfer: &mut Transfer<T>) {
        if !ghost.is_none() {
            let image = transfer.clone();
            self.multiply(&image, transfer, |x, y| ghost.factor(x, y));
        }
    }

    /// Writes the derivative of a transfer function with a ghost by one of the ghost's numbers: by the real part of the
    /// amplitude for 0; for 2 to 4 by a shift or the defocus, without the factor i.
    pub(super) fn differentiate_ghost(&self, ghost: &Ghost, number: usize, of: &Transfer<T>, out: &mut Transfer<T>) {
        self.multiply(of, out, |x, y| {
            let beside = beside_image(ghost, x, y);
            match number {
                2 => PI * x * ghost.amplitude * beside,
                3 => PI * y * ghost.amplitude * beside,
                4 => (x * x + y * y) * ghost.amplitude * beside,
                _ => beside,
            }
        });
    }

    fn multiply(&self, of: &Transfer<T>, out: &mut Transfer<T>, factor: impl Fn(f64, f64) -> Complex64 + Sync) {
        out.write_columns(|i, column| {
            of.read_column(i, column);
            for (h, &y) in column.iter_mut().zip(&self.rows) {
                let factor = factor(self.columns[i], y);
                *h = *h * Complex::new(T::of(factor.re), T::of(factor.im));
            }
        });
    }

    /// Sums over one column of the spectra, for [`ghost_gradient`].
    pub(super) fn ghost_sums(&self, ghost: &Ghost, column: usize, [h, u, g]: [&[Complex<T>]; 3]) -> GhostSums {
        let (x, mut sums) = (self.columns[column], [Complex64::ZERO; 3]);
        for (((h, u), g), &y) in h.iter().zip(u).zip(g).zip(&self.rows) {
            let product = *h * *u * g.conj();
            let value = Complex64::new(product.re.wide(), product.im.wide()) * beside_image(ghost, x, y);
            sums.iter_mut().zip([1.0, y, y * y]).for_each(|(sum, power)| *sum += value * power);
        }
        (sums, x)
    }
}

/// E/H: the ghost's transfer function for an amplitude of 1, relative to that of the image with its ghost.
fn beside_image(ghost: &Ghost, x: f64, y: f64) -> Complex64 {
    Complex64::cis(ghost.phase_rad(x, y)) / ghost.factor(x, y)
}
