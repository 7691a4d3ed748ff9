//! Where the light of a display's dots is, before any camera sees it.

use crate::display::{FINE, Geometry, Light};

/// The affine map from where dots should be to where a display's own light puts them \[px of the display\]. No
/// photograph of dots can tell it from the camera's map.
pub(crate) fn displacement(geometry: Geometry, light: &Light) -> [f64; 9] {
    let Dots { all, spacing } = dots(geometry);
    let middle = [(geometry.width_px as f64 - 1.0) / 2.0, (geometry.height_px as f64 - 1.0) / 2.0];
    let (mut normal, mut sums) = ([[0.0; 3]; 3], [[0.0; 3]; 2]);
    for place in all {
        let seen = middle_of_light(light, place, 0.35 * spacing);
        let row = [place[0] - middle[0], place[1] - middle[1], 1.0];
        for i in 0..3 {
            (0..3).for_each(|j| normal[i][j] += row[i] * row[j]);
            (0..2).for_each(|axis| sums[axis][i] += row[i] * (seen[axis] - place[axis]));
        }
    }
    let mut map = [0.0; 9];
    map[8] = 1.0;
    for axis in 0..2 {
        let [a, b, c] = solved(normal, sums[axis]);
        let (one_x, one_y) = (f64::from(u8::from(axis == 0)), f64::from(u8::from(axis == 1)));
        map[3 * axis..3 * axis + 3].copy_from_slice(&[a + one_x, b + one_y, c - a * middle[0] - b * middle[1]]);
    }
    map
}

pub(crate) struct Dots {
    pub(crate) all: Vec<[f64; 2]>,
    pub(crate) spacing: f64,
}

/// Twelve squares along the shorter side, and dots in the middle 80 % of each side.
pub(crate) fn dots(Geometry { height_px, width_px, .. }: Geometry) -> Dots {
    let (h, w) = (height_px as f64, width_px as f64);
    let spacing = h.min(w) / 12.0;
    let along = |side: f64| {
        let count = (0.8 * side / spacing).floor();
        (0..count as usize).map(move |i| (side - 1.0) / 2.0 + (i as f64 - (count - 1.0) / 2.0) * spacing)
    };
    Dots { all: along(h).flat_map(|y| along(w).map(move |x| [x, y])).collect(), spacing }
}

fn middle_of_light(light: &Light, place: [f64; 2], radius_px: f64) -> [f64; 2] {
    let fine = FINE as f64;
    let sample = |px: f64, n: usize| (px + 0.5) * fine - 0.5 + (n / 4) as f64;
    let start = [sample(place[0], light.width), sample(place[1], light.height)];
    let (mut at, reach) = (start, fine * radius_px);
    for _ in 0..6 {
        let (mut sum, mut weights) = ([0.0; 2], 0.0);
        let range = |middle: f64| (middle - reach).ceil() as usize..=(middle + reach).floor() as usize;
        for (y, x) in range(at[1]).flat_map(|y| range(at[0]).map(move |x| (y, x))) {
            if (x as f64 - at[0]).hypot(y as f64 - at[1]) <= reach {
                let value = light.diffracted[y * light.width + x];
                weights += value;
                sum = [sum[0] + value * x as f64, sum[1] + value * y as f64];
            }
        }
        at = sum.map(|value| value / weights);
    }
    [place[0] + (at[0] - start[0]) / fine, place[1] + (at[1] - start[1]) / fine]
}

/// Solves three equations by Cramer's rule.
fn solved(m: [[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    let determinant = |m: [[f64; 3]; 3]| {
        m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0])
            + m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0])
    };
    std::array::from_fn(|column| {
        let mut with = m;
        (0..3).for_each(|row| with[row][column] = v[row]);
        determinant(with) / determinant(m)
    })
}
