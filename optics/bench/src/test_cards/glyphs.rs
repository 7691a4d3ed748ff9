//! An eye chart: lines of letters that get smaller, drawn with strokes.

use super::noise::Noise;
use super::scene::{Frame, Scene};
use super::vector::{mix, step};

/// A stroke \[x₁, y₁, x₂, y₂\] from (x₁, y₁) to (x₂, y₂) on a raster of 4 × 6 units, y down.
type Stroke = [u8; 4];

const LETTERS: [&[Stroke]; 20] = [
    &[[0, 6, 2, 0], [2, 0, 4, 6], [1, 4, 3, 4]],
    &[[0, 0, 0, 6], [0, 0, 3, 0], [3, 0, 4, 1], [4, 1, 3, 3], [0, 3, 3, 3], [3, 3, 4, 5], [4, 5, 3, 6], [0, 6, 3, 6]],
    &[[4, 1, 3, 0], [3, 0, 1, 0], [1, 0, 0, 2], [0, 2, 0, 4], [0, 4, 1, 6], [1, 6, 3, 6], [3, 6, 4, 5]],
    &[[0, 0, 0, 6], [0, 0, 3, 0], [3, 0, 4, 2], [4, 2, 4, 4], [4, 4, 3, 6], [0, 6, 3, 6]],
    &[[0, 0, 0, 6], [0, 0, 4, 0], [0, 3, 3, 3], [0, 6, 4, 6]],
    &[[0, 0, 0, 6], [0, 0, 4, 0], [0, 3, 3, 3]],
    &[[4, 1, 3, 0], [3, 0, 1, 0], [1, 0, 0, 2], [0, 2, 0, 4], [0, 4, 1, 6], [1, 6, 4, 6], [4, 6, 4, 3], [4, 3, 2, 3]],
    &[[0, 0, 0, 6], [4, 0, 4, 6], [0, 3, 4, 3]],
    &[[0, 0, 0, 6], [4, 0, 0, 3], [1, 2, 4, 6]],
    &[[0, 0, 0, 6], [0, 6, 4, 6]],
    &[[0, 6, 0, 0], [0, 0, 2, 3], [2, 3, 4, 0], [4, 0, 4, 6]],
    &[[0, 6, 0, 0], [0, 0, 4, 6], [4, 6, 4, 0]],
    &[[1, 0, 3, 0], [3, 0, 4, 2], [4, 2, 4, 4], [4, 4, 3, 6], [3, 6, 1, 6], [1, 6, 0, 4], [0, 4, 0, 2], [0, 2, 1, 0]],
    &[[0, 6, 0, 0], [0, 0, 3, 0], [3, 0, 4, 1], [4, 1, 4, 2], [4, 2, 3, 3], [3, 3, 0, 3]],
    &[[0, 6, 0, 0], [0, 0, 3, 0], [3, 0, 4, 1], [4, 1, 4, 2], [4, 2, 3, 3], [3, 3, 0, 3], [2, 3, 4, 6]],
    &[
        [4, 1, 3, 0],
        [3, 0, 1, 0],
        [1, 0, 0, 1],
        [0, 1, 0, 2],
        [0, 2, 4, 4],
        [4, 4, 4, 5],
        [4, 5, 3, 6],
        [3, 6, 1, 6],
        [1, 6, 0, 5],
    ],
    &[[0, 0, 4, 0], [2, 0, 2, 6]],
    &[[0, 0, 2, 6], [2, 6, 4, 0]],
    &[[0, 0, 4, 6], [4, 0, 0, 6]],
    &[[0, 0, 4, 0], [4, 0, 0, 6], [0, 6, 4, 6]],
];

/// A line of letters of the chart.
struct Line {
    top: f32,
    height: f32,
    letters: Vec<usize>,
}

pub(super) fn eye_chart(frame: Frame, seed: u64) -> Scene {
    let noise = Noise::new(seed, 900);
    let inverted = noise.uniform(1, 1) < 0.5;
    let lines = lines(frame, &noise);
    let lamp = (noise.between(2, -1.0, 1.0), noise.between(3, -0.6, 0.6));
    Box::new(move |x, y| {
        let ink = lines.iter().map(|line| ink(line, x, y)).fold(0.0, f32::max);
        let paper = 0.93 - 0.16 * ((x - lamp.0).powi(2) + (y - lamp.1).powi(2));
        let tone = mix(paper.max(0.35), 0.06, ink);
        if inverted { 0.98 - 0.92 * tone } else { tone }
    })
}

fn lines(frame: Frame, noise: &Noise) -> Vec<Line> {
    let (mut top, mut height, mut lines) = (-frame.half_height + 0.1, 0.5, Vec::new());
    while top + height < frame.half_height - 0.04 {
        let spacing = height * 1.1;
        let count = (2.0 * (frame.half_width - 0.08) / spacing).floor().max(1.0) as usize;
        let letter = |i: usize| noise.choice((lines.len() * 1000 + i) as i32, LETTERS.len());
        lines.push(Line { top, height, letters: (0..count).map(letter).collect() });
        top += height * 1.42;
        height *= 0.68;
        if height < 0.05 {
            break;
        }
    }
    lines
}

/// Cover of the point (x, y) by the letters of a line, 0 to 1.
fn ink(line: &Line, x: f32, y: f32) -> f32 {
    let margin = 0.12 * line.height;
    if !(line.top - margin..line.top + line.height + margin).contains(&y) {
        return 0.0;
    }
    let spacing = line.height * 1.1;
    let cell = x / spacing + line.letters.len() as f32 / 2.0;
    let Some(&letter) = line.letters.get(cell.floor() as isize as usize).filter(|_| cell >= 0.0) else {
        return 0.0;
    };
    let unit = line.height / 6.0;
    let (u, v) = ((cell.fract() - 0.5) * spacing / unit + 2.0, (y - line.top) / unit);
    let nearest = LETTERS[letter].iter().map(|stroke| distance(stroke, u, v)).fold(f32::INFINITY, f32::min);
    step(0.62, 0.5, nearest)
}

fn distance(stroke: &Stroke, u: f32, v: f32) -> f32 {
    let [x0, y0, x1, y1] = stroke.map(f32::from);
    let (dx, dy) = (x1 - x0, y1 - y0);
    let along = (((u - x0) * dx + (v - y0) * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
    (u - x0 - along * dx).hypot(v - y0 - along * dy)
}
