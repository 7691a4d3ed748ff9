//! Three-dimensional vectors for shading: x to the right, y down, z towards the viewer.

pub(super) type Vector = [f32; 3];

pub(super) fn dot(a: Vector, b: Vector) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn add_scaled(a: Vector, b: Vector, scale: f32) -> Vector {
    [a[0] + b[0] * scale, a[1] + b[1] * scale, a[2] + b[2] * scale]
}

/// The vector of length 1 in the same direction.
pub(super) fn unit(a: Vector) -> Vector {
    let scale = 1.0 / dot(a, a).sqrt().max(1e-9);
    a.map(|value| value * scale)
}

/// The direction of `a` after its reflection at a mirror with the unit normal `normal`.
pub(super) fn mirrored(a: Vector, normal: Vector) -> Vector {
    add_scaled(a, normal, -2.0 * dot(a, normal))
}

/// Linear interpolation: `a` at t = 0, `b` at t = 1.
pub(super) fn mix(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// A smooth step: 0 below `start`, 1 above `end`. With `start` > `end` it falls from 1 to 0.
pub(super) fn step(start: f32, end: f32, value: f32) -> f32 {
    let t = ((value - start) / (end - start)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The point (x, y), rotated by `angle_rad` around the origin.
pub(super) fn turned(x: f32, y: f32, angle_rad: f32) -> (f32, f32) {
    let (sin, cos) = angle_rad.sin_cos();
    (x * cos - y * sin, x * sin + y * cos)
}
