//! Fingerprints: pictures at very low resolution, as means over some hundred cells. They are fine enough to distinguish
//! pictures, and coarse enough to be insensitive to a few pixels of misalignment.

use lightpath_optics::{Plane, RegionOfInterest};
use std::fmt::Write;

/// Cells along the longer side of the region.
const CELLS: usize = 32;

/// Fingerprint of a picture: the means over the region's cells, scaled to 0 … 255, as hexadecimal digits.
pub(super) fn of(plane: &Plane<f32>, region: RegionOfInterest) -> String {
    let means = cells(plane, region);
    let (low, high) = means.iter().fold((f64::MAX, f64::MIN), |(low, high), &v| (low.min(v), high.max(v)));
    let scale = if high - low > 1e-9 { 255.0 / (high - low) } else { 0.0 };
    means.iter().fold(String::with_capacity(2 * means.len()), |mut text, mean| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{:02x}", ((mean - low) * scale).round() as u8);
        text
    })
}

/// Correlation of two fingerprints of the same region; `None` if a picture is uniform or the cells differ.
pub(super) fn correlation(a: &str, b: &str) -> Option<f64> {
    Normalized::new(a)?.correlation(&Normalized::new(b)?)
}

/// A fingerprint with mean 0 and norm 1, to be correlated with many others.
#[derive(Clone, Debug)]
pub(super) struct Normalized(Vec<f32>);

impl Normalized {
    /// Normalizes a fingerprint; `None` for that of a uniform picture.
    pub(super) fn new(hex: &str) -> Option<Self> {
        Self::of(&values(hex)?)
    }

    fn of(values: &[f64]) -> Option<Self> {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let norm = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>().sqrt();
        (norm > 1e-9).then(|| Self(values.iter().map(|value| ((value - mean) / norm) as f32).collect()))
    }

    pub(super) fn correlation(&self, other: &Self) -> Option<f64> {
        (self.0.len() == other.0.len()).then(|| self.0.iter().zip(&other.0).map(|(a, b)| f64::from(a * b)).sum())
    }
}

/// Normalizes fingerprints and, if there are at least `common_min`, subtracts their mean. `None` for uniform pictures.
pub(super) fn without_common<'a>(all: impl Iterator<Item = &'a str>, common_min: usize) -> Vec<Option<Normalized>> {
    let unit: Vec<Option<Normalized>> = all.map(Normalized::new).collect();
    let cells = unit.iter().flatten().map(|one| one.0.len()).max().unwrap_or(0);
    let whole = || unit.iter().flatten().filter(move |one| one.0.len() == cells);
    let count = whole().count();
    if count < common_min {
        return unit;
    }
    let mut mean = vec![0.0; cells];
    for one in whole() {
        mean.iter_mut().zip(&one.0).for_each(|(mean, value)| *mean += f64::from(*value) / count as f64);
    }
    let without_mean = |one: &Normalized| {
        let values: Vec<f64> = one.0.iter().zip(&mean).map(|(value, mean)| f64::from(*value) - mean).collect();
        Normalized::of(&values)
    };
    unit.iter().map(|one| one.as_ref().filter(|one| one.0.len() == cells).and_then(without_mean)).collect()
}

/// Vignetting: the loss of light from the middle to the corners, relative to the expected light.
///
/// Fits seen ≈ expected · (a + b r²), with r = 1 in the corners, and returns −b/a. `None`: the fit is not determined.
pub(super) fn vignetting(seen: &Plane<f32>, expected: &Plane<f32>, region: RegionOfInterest) -> Option<f64> {
    let (seen, expected) = (cells(seen, region), cells(expected, region));
    let (rows, columns) = grid(region);
    let [mut ee, mut eer, mut eerr, mut es, mut ers] = [0.0; 5];
    for (i, (s, e)) in seen.iter().zip(&expected).enumerate() {
        let along = |i: usize, n: usize| (2 * i + 1) as f64 / n as f64 - 1.0;
        let r = (along(i / columns, rows).powi(2) + along(i % columns, columns).powi(2)) / 2.0;
        ee += e * e;
        eer += e * e * r;
        eerr += e * e * r * r;
        es += e * s;
        ers += e * r * s;
    }
    let determinant = ee * eerr - eer * eer;
    let a = (es * eerr - ers * eer) / determinant;
    let b = (ee * ers - eer * es) / determinant;
    (determinant > 1e-12 * ee * eerr && a > 0.0).then(|| -b / a)
}

fn grid(region: RegionOfInterest) -> (usize, usize) {
    let longer = region.height_px().max(region.width_px());
    let count = |side: usize| (side * CELLS).div_ceil(longer).min(side);
    (count(region.height_px()), count(region.width_px()))
}

fn cells(plane: &Plane<f32>, region: RegionOfInterest) -> Vec<f64> {
    let (rows, columns) = grid(region);
    let edge = |i: usize, count: usize, side: usize| i * side / count;
    let mut means = Vec::with_capacity(rows * columns);
    for j in 0..rows {
        for i in 0..columns {
            let y = edge(j, rows, region.height_px())..edge(j + 1, rows, region.height_px());
            let x = edge(i, columns, region.width_px())..edge(i + 1, columns, region.width_px());
            let count = (y.len() * x.len()) as f64;
            let row = |y: usize| {
                plane.row(region.y_px() + y)[region.x_px() + x.start..region.x_px() + x.end]
                    .iter()
                    .map(|&v| f64::from(v))
                    .sum::<f64>()
            };
            means.push(y.map(row).sum::<f64>() / count);
        }
    }
    means
}

fn values(hex: &str) -> Option<Vec<f64>> {
    let digits = hex.as_bytes();
    let pairs = digits.as_chunks::<2>().0.iter();
    pairs.map(|pair| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok().map(f64::from)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_bench::TestCard;
    use lightpath_optics::Grid;

    #[test]
    fn picture_correlates_with_itself_shifted_and_dimmed_but_not_with_others() {
        let region = RegionOfInterest::middle(&Grid::try_new(180, 320, 8e-6).unwrap());
        let card = |i: usize| TestCard::ALL[i].render(180, 320, 1).unwrap();
        let portrait = card(0);
        let shifted = Plane::from_fn(180, 320, |y, x| 0.1 + 0.3 * portrait.at(y, x.saturating_sub(2)));
        let a = of(&portrait, region);
        assert!(correlation(&a, &of(&shifted, region)).unwrap() > 0.97);
        for other in 1..8 {
            let c = correlation(&a, &of(&card(other), region)).unwrap();
            assert!(c < 0.8, "{other}: {c}");
        }
        assert_eq!(correlation(&a, &of(&Plane::filled(180, 320, 0.5), region)), None);
    }

    #[test]
    fn vignetting_is_the_loss_of_light_in_the_corners() {
        let region = RegionOfInterest::full(&Grid::try_new(180, 320, 8e-6).unwrap());
        let card = TestCard::Clouds.render(180, 320, 1).unwrap();
        let seen = Plane::from_fn(180, 320, |y, x| {
            let along = |i: usize, n: usize| (2 * i + 1) as f32 / n as f32 - 1.0;
            card.at(y, x) * 0.7 * (1.0 - 0.4 * (along(y, 180).powi(2) + along(x, 320).powi(2)) / 2.0)
        });
        let found = vignetting(&seen, &card, region).unwrap();
        assert!((found - 0.4).abs() < 0.02, "{found}");
    }
}
