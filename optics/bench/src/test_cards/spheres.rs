//! Balls on a chequered floor, drawn by ray tracing.

use super::noise::Noise;
use super::scene::Scene;
use super::vector::{Vector, add_scaled, dot, mirrored, mix, step, unit};

struct Ball {
    centre: Vector,
    radius: f32,
    albedo: f32,
    /// Part of the light that the ball mirrors, 0 to 1.
    polish: f32,
}

struct Room {
    balls: Vec<Ball>,
    light: Vector,
    turn: f32,
    marble: Noise,
}

/// Depth of the floor below the eye.
const FLOOR_Y: f32 = 1.0;
/// Largest number of reflections that a ray follows.
const BOUNCES_MAX: u32 = 3;

pub(super) fn spheres(seed: u64) -> Scene {
    let draws = Noise::new(seed, 500);
    let balls = (0..5).map(|i| {
        let radius = draws.between(10 + i, 0.35, 0.75) * if i == 0 { 1.25 } else { 0.8 };
        let x = [0.0, -1.9, 1.8, -0.95, 1.05][i as usize] + draws.between(20 + i, -0.25, 0.25);
        let z = [-4.6, -5.2, -5.6, -3.3, -3.1][i as usize] + draws.between(30 + i, -0.3, 0.3);
        let radius = if i > 2 { radius * 0.55 } else { radius };
        let polish = if draws.uniform(40 + i, 0) < 0.45 { 0.75 } else { 0.06 };
        Ball { centre: [x, FLOOR_Y - radius, z], radius, albedo: draws.between(50 + i, 0.25, 0.95), polish }
    });
    let light = unit([draws.between(1, -0.9, 0.9), -1.0, draws.between(2, 0.1, 0.8)]);
    let room = Room { balls: balls.collect(), light, turn: draws.between(3, 0.0, 1.5), marble: Noise::new(seed, 501) };
    Box::new(move |x, y| {
        let eye = [0.0, -0.25, 0.0];
        traced(&room, eye, unit([x * 0.42, y * 0.42 + 0.13, -1.0]), BOUNCES_MAX).powf(1.0 / 1.6)
    })
}

fn traced(room: &Room, from: Vector, towards: Vector, bounces: u32) -> f32 {
    let nearest = room.balls.iter().filter_map(|ball| Some((hit(ball, from, towards)?, ball)));
    let nearest = nearest.min_by(|a, b| a.0.total_cmp(&b.0));
    let floor = (FLOOR_Y - from[1]) / towards[1];
    match nearest {
        Some((along, ball)) if floor < 0.0 || along < floor => {
            let point = add_scaled(from, towards, along);
            let normal = unit(add_scaled(point, ball.centre, -1.0));
            let veins = room.marble.fractal(normal[0] * 3.0 + ball.centre[0] * 5.0, normal[1] * 3.0 + normal[2], 5);
            let albedo = ball.albedo * (1.0 + 0.35 * veins);
            let lit = dot(normal, room.light).max(0.0) * sunlight(room, point, normal);
            let own = albedo * (0.12 + 0.1 * (normal[1] + 1.0) + 0.75 * lit);
            let leaving = mirrored(towards, normal);
            let shine = dot(leaving, room.light).max(0.0).powi(60) * sunlight(room, point, normal);
            let fresnel = ball.polish + (1.0 - ball.polish) * (1.0 + dot(towards, normal)).max(0.0).powi(5);
            let reflected = if bounces == 0 { 0.3 } else { traced(room, point, leaving, bounces - 1) };
            mix(own, reflected, fresnel) + 0.7 * shine
        }
        _ if floor > 0.0 => tiles(room, add_scaled(from, towards, floor), floor),
        _ => sky(towards),
    }
}

fn tiles(room: &Room, point: Vector, distance: f32) -> f32 {
    let (sin, cos) = room.turn.sin_cos();
    let (u, v) = (point[0] * cos - point[2] * sin, point[0] * sin + point[2] * cos);
    let bright = (u * 1.4).floor().rem_euclid(2.0) == (v * 1.4).floor().rem_euclid(2.0);
    let grain = 0.08 * room.marble.fractal(u * 4.0, v * 4.0, 4);
    let albedo = if bright { 0.78 } else { 0.1 } + grain;
    let lit = -room.light[1] * sunlight(room, point, [0.0, -1.0, 0.0]);
    // Balls shade the floor right below them from the light of the sky.
    let open = room.balls.iter().map(|ball| {
        let from_ball = (point[0] - ball.centre[0]).hypot(point[2] - ball.centre[2]) / ball.radius;
        mix(0.45, 1.0, step(0.0, 1.3, from_ball))
    });
    let near = albedo * (0.22 * open.product::<f32>() + 0.7 * lit);
    mix(near, 0.5, step(6.0, 30.0, distance))
}

fn sky(towards: Vector) -> f32 {
    mix(0.5, 0.12, step(0.0, 0.7, -towards[1]))
}

/// Sunlight at a point: 0 in a ball's shadow, 1 in full light.
fn sunlight(room: &Room, point: Vector, normal: Vector) -> f32 {
    let from = add_scaled(point, normal, 1e-3);
    if room.balls.iter().any(|ball| hit(ball, from, room.light).is_some()) { 0.0 } else { 1.0 }
}

/// Distance along the ray to its first point on the ball. `None`: the ray misses the ball.
fn hit(ball: &Ball, from: Vector, towards: Vector) -> Option<f32> {
    let offset = add_scaled(from, ball.centre, -1.0);
    let (along, squared) = (dot(offset, towards), dot(offset, offset) - ball.radius * ball.radius);
    let root = (along * along - squared).max(-1.0);
    let distance = -along - if root < 0.0 { return None } else { root.sqrt() };
    (distance > 1e-3).then_some(distance)
}
