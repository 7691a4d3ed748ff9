//! A head with light from the side: a relief of smooth shapes, shaded by its slopes.

use super::noise::Noise;
use super::scene::Scene;
use super::vector::{Vector, dot, mirrored, mix, step, turned, unit};

struct Face {
    noise: Noise,
    light: Vector,
    turn: f32,
    lean: f32,
    centre_x: f32,
    hair_length: f32,
    hair_tone: f32,
    jaw: f32,
    skin: f32,
}

pub(super) fn portrait(seed: u64) -> Scene {
    let draws = Noise::new(seed, 1000);
    let side = if draws.uniform(1, 0) < 0.5 { -1.0 } else { 1.0 };
    let face = Face {
        noise: Noise::new(seed, 1001),
        light: unit([side * draws.between(2, 0.45, 0.85), draws.between(3, -0.6, -0.3), 0.75]),
        turn: side * draws.between(4, -0.03, 0.1),
        lean: draws.between(5, -0.1, 0.1),
        centre_x: draws.between(6, -0.35, 0.35),
        hair_length: draws.between(7, 0.25, 0.95),
        hair_tone: draws.between(8, 0.2, 0.75),
        jaw: draws.between(9, 0.85, 1.0),
        skin: draws.between(10, 0.72, 0.95),
    };
    Box::new(move |x, y| {
        let (u, v) = turned(x - face.centre_x, y + 0.02, face.lean);
        let tone = if head_mask(&face, u, v) > 0.0 {
            head(&face, u, v)
        } else {
            hair_behind(&face, u, v)
                .unwrap_or_else(|| bust(&face, x - face.centre_x, y).unwrap_or_else(|| backdrop(&face, x, y)))
        };
        match fringe(&face, u, v) {
            Some((hair, cover)) => mix(tone, hair, cover),
            None => tone,
        }
    })
}

/// Mask of the face: positive inside the face, negative outside.
fn head_mask(face: &Face, u: f32, v: f32) -> f32 {
    let half = if v > 0.1 { 0.43 * (1.0 - 0.38 / face.jaw * ((v - 0.1) / 0.55).powi(2)) } else { 0.43 };
    let (top, bottom) = (-0.66, 0.6);
    let centre = if v > 0.0 { v / bottom } else { v / top };
    1.0 - (u / half.max(0.05)).powi(2) - centre.powi(2)
}

/// Height of the face's relief towards the viewer.
fn relief(face: &Face, u: f32, v: f32) -> f32 {
    let bump = |cx: f32, cy: f32, rx: f32, ry: f32| (-((u - cx) / rx).powi(2) - ((v - cy) / ry).powi(2)).exp();
    let t = face.turn;
    let skull = 0.55 * head_mask(face, u, v).max(0.0).powf(0.55);
    let brow = 0.03 * bump(t, -0.2, 0.34, 0.06);
    let nose = 0.13 * bump(t * 1.5, 0.12, 0.055, 0.07)
        + 0.085 * bump(t * 1.2, -0.02, 0.04, 0.16)
        + 0.035 * (bump(t * 1.5 - 0.055, 0.145, 0.03, 0.03) + bump(t * 1.5 + 0.055, 0.145, 0.03, 0.03));
    let sockets = -0.075 * (bump(t - 0.17, -0.1, 0.105, 0.065) + bump(t + 0.17, -0.1, 0.105, 0.065));
    let lids = 0.035 * (bump(t - 0.17, -0.085, 0.07, 0.04) + bump(t + 0.17, -0.085, 0.07, 0.04));
    let cheeks = 0.04 * (bump(t - 0.24, 0.1, 0.12, 0.12) + bump(t + 0.24, 0.1, 0.12, 0.12));
    let lips =
        0.04 * bump(t, 0.265, 0.1, 0.022) + 0.045 * bump(t, 0.325, 0.085, 0.028) - 0.02 * bump(t, 0.295, 0.12, 0.01);
    let chin = 0.05 * bump(t, 0.48, 0.12, 0.07) - 0.02 * bump(t, 0.39, 0.12, 0.03);
    skull + brow + nose + sockets + lids + cheeks + lips + chin
}

fn head(face: &Face, u: f32, v: f32) -> f32 {
    let normal = normal(|u, v| relief(face, u, v), u, v);
    let lambert = dot(normal, face.light);
    let shine = mirrored([0.0, 0.0, -1.0], normal);
    let shine = dot(shine, face.light).max(0.0).powi(12);
    let pores = 0.02 * face.noise.fractal(u * 16.0, v * 16.0, 3);
    let fill = 0.14 * dot(normal, [-face.light[0], 0.1, 0.6]).max(0.0);
    let skin = face.skin * (0.1 + 0.82 * step(-0.25, 1.0, lambert) + fill) + 0.12 * shine + pores;
    let skin = lips(face, u, v, skin);
    let skin = brows(face, u, v, skin);
    eye(face, u, v, -1.0, lambert).or_else(|| eye(face, u, v, 1.0, lambert)).unwrap_or(skin)
}

fn lips(face: &Face, u: f32, v: f32, skin: f32) -> f32 {
    let x = (u - face.turn) / 0.125;
    let bow = 0.012 * (1.0 - (2.0 * x.abs() - 0.5).powi(2));
    let (upper, lower) = (0.25 - bow + 0.03 * x * x, 0.35 - 0.05 * x * x);
    if x.abs() > 1.0 || !(upper..lower).contains(&v) {
        return skin;
    }
    let seam = step(0.008, 0.001, (v - 0.294 - 0.008 * (1.0 - x * x)).abs());
    skin * mix(0.74, 0.3, seam)
}

fn brows(face: &Face, u: f32, v: f32, skin: f32) -> f32 {
    let x = ((u - face.turn).abs() - 0.17) / 0.12;
    let arch = -0.215 + 0.03 * (x - 0.3).powi(2) - 0.012 * x;
    let thickness = 0.022 * (1.0 - 0.6 * x.max(0.0));
    let hairs = 0.75 + 0.4 * face.noise.fractal(u * 30.0 + v * 40.0, v * 12.0, 3);
    let cover = step(1.0, 0.8, x.abs()) * step(thickness * 1.3, thickness * 0.5, (v - arch).abs()) * hairs;
    mix(skin, face.hair_tone * 0.55, cover.clamp(0.0, 1.0) * 0.9)
}

fn eye(face: &Face, u: f32, v: f32, side: f32, lambert: f32) -> Option<f32> {
    let (x, y) = ((u - face.turn - side * 0.17) / 0.082, (v + 0.083) / 0.082);
    let (upper, lower) = (-0.46 * (1.0 - x * x), 0.36 * (1.0 - x * x));
    if x.abs() > 1.08 || y < upper - 0.14 || y > lower {
        return None;
    }
    if y < upper {
        return (x.abs() < 1.05).then_some(0.08);
    }
    if x.abs() > 1.0 {
        return None;
    }
    let gaze = face.turn * 2.0;
    let from_pupil = (x - gaze).hypot(y + 0.04);
    let glint = (x - gaze - 0.13 * face.light[0].signum()).hypot(y + 0.2);
    let shade = (0.35 + 0.65 * lambert.max(0.0)) * (1.0 - 0.45 * step(0.3, 0.0, y - upper));
    let white = 0.92 * shade * (1.0 - 0.3 * x * x);
    let iris = mix(0.18, 0.5, step(0.15, 0.4, from_pupil)) * step(0.48, 0.42, from_pupil) + 0.05;
    Some(match () {
        () if glint < 0.1 => 1.0,
        () if from_pupil < 0.19 => 0.02,
        () if from_pupil < 0.45 => iris * (0.6 + 0.4 * shade),
        () => white,
    })
}

fn hair_behind(face: &Face, u: f32, v: f32) -> Option<f32> {
    let half = 0.54 + 0.07 * face.noise.fractal(v * 2.0, u.signum() * 4.0, 3);
    let above = 1.0 - (u / half).powi(2) - (v.min(0.0) / 0.8).powi(2);
    let falls = v < face.hair_length + 0.05 * face.noise.smooth(u * 9.0, 2.0);
    (above > 0.0 && falls).then(|| strands(face, u, v, 0.75))
}

/// Tone of the hair over the forehead, and how much of the face it covers, 0 to 1. `None`: the point has no such hair.
fn fringe(face: &Face, u: f32, v: f32) -> Option<(f32, f32)> {
    let outline = 1.0 - (u / 0.53).powi(2) - ((v + 0.02) / 0.78).powi(2);
    let part = face.light[0].signum() * 0.12;
    let hairline = -0.44 + 0.55 * (u - part).powi(2) + 1.9 * (u.abs() - 0.24).max(0.0);
    let cover = step(0.03, -0.03, v - hairline - 0.025 * face.noise.fractal(u * 14.0, v * 3.0, 3));
    (outline > 0.0 && cover > 0.0 && v < 0.2).then(|| (strands(face, u, v, 1.0), cover))
}

fn strands(face: &Face, u: f32, v: f32, brightness: f32) -> f32 {
    let angle = u.atan2(-(v - 0.9));
    let flow = face.noise.fractal(angle * 46.0, (v - u * u) * 2.2, 4);
    let normal = normal(|u, v| 0.6 * (1.0 - (u / 0.62).powi(2) - (v / 0.92).powi(2)).max(0.02).sqrt(), u, v);
    let lit = step(-0.2, 1.0, dot(normal, face.light));
    let band = (-((v + 0.42 - 0.35 * u * face.light[0]) / 0.12).powi(2)).exp();
    brightness * (face.hair_tone * (0.25 + 0.85 * lit) * (1.0 + 0.55 * flow) + 0.2 * band * lit * (0.6 + flow))
}

/// Tone of neck and shoulders. `None`: the point is beside them.
fn bust(face: &Face, u: f32, v: f32) -> Option<f32> {
    let neck = |u: f32, _: f32| 0.25 * (1.0 - (u / 0.23).powi(2)).max(0.0).sqrt();
    let slope = 0.74 + 0.42 * (u.abs() - 0.2).max(0.0).powf(1.35) - 0.05 * (1.0 - (u / 0.25).powi(2)).max(0.0);
    let open = v > 0.4 && u.abs() < 0.22 && v < slope + 0.16 * (1.0 - (u / 0.22).powi(2));
    if open {
        let lit = step(-0.25, 1.0, dot(normal(neck, u, v), face.light));
        // The chin casts a shadow on the neck.
        let under = mix(0.4, 1.0, step(0.56, 0.74, v + 0.12 * u * face.light[0]));
        return Some(face.skin * (0.12 + 0.7 * lit) * under);
    }
    if v < slope || u.abs() > 1.0 {
        return None;
    }
    let cloth = |u: f32, v: f32| {
        0.5 * (1.0 - (u / 1.05).powi(2)).max(0.0).sqrt() + 0.05 * face.noise.fractal(u * 2.5 + v, v * 1.5 - u, 3)
    };
    let lit = step(-0.3, 1.0, dot(normal(cloth, u, v), face.light));
    let weave = 0.03 * face.noise.fractal(u * 40.0, v * 40.0, 2);
    Some(0.1 + 0.6 * lit + weave)
}

fn backdrop(face: &Face, x: f32, y: f32) -> f32 {
    let glow = (-(x - face.centre_x + 0.5 * face.light[0]).powi(2) * 0.6 - (y + 0.1).powi(2) * 0.7).exp();
    0.18 + 0.6 * glow + 0.07 * face.noise.fractal(x * 1.5, y * 1.5, 4)
}

fn normal(height: impl Fn(f32, f32) -> f32, u: f32, v: f32) -> Vector {
    const REACH: f32 = 0.004;
    let along_x = (height(u + REACH, v) - height(u - REACH, v)) / (2.0 * REACH);
    let along_y = (height(u, v + REACH) - height(u, v - REACH)) / (2.0 * REACH);
    unit([-along_x, -along_y, 1.0])
}
