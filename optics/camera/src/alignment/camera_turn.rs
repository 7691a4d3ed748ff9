//! The turn of a camera, told from the bend of a modulator.
//!
//! ```text
//! d(p) = ∇P(p) + ω (−y, x)
//! ```
//!
//! A phase φ on the modulator displaces light by λz/2π ∇φ, so every displacement that an uneven modulator makes is the
//! gradient of a potential P, and has no curl. A turned camera displaces all points with the same curl 2ω. P is a
//! polynomial in the position p = (x, y) relative to the middle of the region; its linear terms are the shift, its
//! quadratic terms scale and shear. The higher terms matter also where only the turn is wanted: the affine map that
//! fits the gradient of x³y best is turned.

use super::homography::{Point, distance};
use lightpath_optics::numerics::least_squares::NormalEquations;

/// A rotation that was found in displacements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CameraTurn {
    /// Half of the displacements' curl, positive from x towards y \[rad\].
    pub(super) rad: f64,
    /// Uncertainty of `rad`.
    pub(super) uncertainty_rad: f64,
}

pub(super) const HUBER_PX: f64 = 0.3;
/// Largest distance of a tile's displacement from the fit \[px\]. Tiles beyond it are outliers.
pub(super) const OUTLIER_PX: f64 = 3.0;
/// Fewest displacements for a potential of degree 4 and 6.
const DISPLACEMENTS_MIN: [usize; 2] = [12, 40];
/// Weight of the wish that higher terms are 0, relative to that of a displacement: the square of a displacement's
/// uncertainty (0.1 px), relative to that of the bend (1 px).
const HIGHER_TERMS_WEIGHT: f64 = 0.01;
/// Factor from the standard deviation to the uncertainty. What the fit leaves over is not random where the surface
/// bends much. On simulated benches with 1.5 waves the errors are at most as large as the uncertainty.
const CAUTION: f64 = 1.5;
const ROUNDS: usize = 20;

impl CameraTurn {
    /// Fits the displacements \[px\] of points. `centre` is the middle of the region, `half_px` half of its longer
    /// side, and `repeats` the number of displacements that each pixel has a part in. `None`: the points do not
    /// determine a turn.
    pub(super) fn of(displacements: &[(Point, Point)], centre: Point, half_px: f64, repeats: f64) -> Option<Self> {
        let around: Vec<(Point, Point)> = displacements
            .iter()
            .map(|&(p, shift)| ([(p[0] - centre[0]) / half_px, (p[1] - centre[1]) / half_px], shift))
            .collect();
        let [few, many] = DISPLACEMENTS_MIN;
        // One unknown for each term of P except the constant one, and the turn.
        let edge_px = match around.len() {
            n if n >= many => fitted::<28>(&around, 6)?,
            n if n >= few => fitted::<15>(&around, 4)?,
            _ => fitted::<6>(&around, 2)?,
        };
        // Displacements that share their pixels share their errors.
        let uncertainty_px = CAUTION * repeats.max(1.0).sqrt() * edge_px.1;
        Some(Self { rad: edge_px.0 / half_px, uncertainty_rad: uncertainty_px / half_px })
    }
}

/// ω and its standard deviation with independent displacements, for positions relative to the longer half side \[px\].
fn fitted<const N: usize>(around: &[(Point, Point)], degree: i32) -> Option<(f64, f64)> {
    let rows: Vec<[[f64; N]; 2]> = around.iter().map(|&(p, _)| rows(degree, p)).collect();
    let predicted = |solution: &[f64; N], rows: &[[f64; N]; 2]| -> Point {
        rows.map(|row| row.iter().zip(solution).map(|(a, b)| a * b).sum())
    };
    let mut solution = [0.0; N];
    let mut equations = NormalEquations::<N>::none();
    let weight = |round: usize, off: f64| match round {
        0 => 1.0,
        _ if off <= HUBER_PX => 1.0,
        _ if round >= ROUNDS / 2 && off > OUTLIER_PX => 0.0,
        _ => HUBER_PX / off,
    };
    for round in 0..ROUNDS {
        equations = wishes(degree);
        for (rows, &(_, shift)) in rows.iter().zip(around) {
            let weight = weight(round, distance(predicted(&solution, rows), shift));
            equations.add(&rows[0], shift[0], weight);
            equations.add(&rows[1], shift[1], weight);
        }
        solution = equations.clone().solve()?;
    }
    let off = rows.iter().zip(around).map(|(rows, &(_, shift))| distance(predicted(&solution, rows), shift));
    let near: Vec<f64> = off.filter(|&off| off <= OUTLIER_PX).collect();
    let freedom = (2 * near.len()).saturating_sub(N).max(1);
    let variance = equations.inverse_at(N - 1)? * near.iter().map(|off| off * off).sum::<f64>() / freedom as f64;
    Some((solution[N - 1], variance.max(0.0).sqrt()))
}

/// Powers (i, j) of the terms xⁱyʲ of P.
fn powers(degree: i32) -> impl Iterator<Item = (i32, i32)> {
    (1..=degree).flat_map(|total| (0..=total).map(move |j| (total - j, j)))
}

/// The gradients of the terms of P, and the displacement of a turn by 1, at a point: their x, and their y.
fn rows<const N: usize>(degree: i32, [x, y]: Point) -> [[f64; N]; 2] {
    let mut rows = [[0.0; N]; 2];
    for (term, (i, j)) in powers(degree).enumerate() {
        let slope = |i: i32, x: f64| if i > 0 { f64::from(i) * x.powi(i - 1) } else { 0.0 };
        rows[0][term] = slope(i, x) * y.powi(j);
        rows[1][term] = x.powi(i) * slope(j, y);
    }
    rows[0][N - 1] = -y;
    rows[1][N - 1] = x;
    rows
}

/// Equations that keep terms of P above the second degree small, so that they never take what the points do not show.
fn wishes<const N: usize>(degree: i32) -> NormalEquations<N> {
    let mut equations = NormalEquations::none();
    for (term, _) in powers(degree).enumerate().filter(|(_, (i, j))| i + j > 2) {
        let mut row = [0.0; N];
        row[term] = 1.0;
        equations.add(&row, 0.0, HIGHER_TERMS_WEIGHT);
    }
    equations
}
