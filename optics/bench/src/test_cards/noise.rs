//! Seeded random numbers on a lattice, and smooth noise that interpolates them (Perlin 2002).

/// A source of random numbers by address: the same address always gives the same number.
#[derive(Clone, Copy)]
pub(super) struct Noise {
    seed: u64,
}

impl Noise {
    /// Makes a noise source. Each `stream` of a seed gives other numbers.
    pub(super) fn new(seed: u64, stream: u64) -> Self {
        Self { seed: scrambled(seed ^ scrambled(stream)) }
    }

    /// The random number of a lattice point, uniform in [0, 1).
    pub(super) fn uniform(&self, ix: i32, iy: i32) -> f32 {
        (self.bits(ix, iy) >> 40) as f32 / (1_u64 << 24) as f32
    }

    /// The random number with number `index`, uniform in [low, high).
    pub(super) fn between(&self, index: i32, low: f32, high: f32) -> f32 {
        low + (high - low) * self.uniform(index, -7)
    }

    /// The random whole number with number `index`, 0 to `count` − 1.
    pub(super) fn choice(&self, index: i32, count: usize) -> usize {
        ((self.uniform(index, -9) * count as f32) as usize).min(count - 1)
    }

    /// Smooth noise around 0, within ±1, with a period of about 1.
    pub(super) fn smooth(&self, x: f32, y: f32) -> f32 {
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (x - x0, y - y0);
        let corner = |dx: i32, dy: i32| {
            // A point near a horizon can lie beyond the largest number.
            let bits = self.bits((x0 as i32).wrapping_add(dx), (y0 as i32).wrapping_add(dy));
            let (gx, gy) = GRADIENTS[(bits >> 61) as usize];
            gx * (fx - dx as f32) + gy * (fy - dy as f32)
        };
        let fade = |t: f32| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
        let (u, v) = (fade(fx), fade(fy));
        let top = corner(0, 0) + u * (corner(1, 0) - corner(0, 0));
        let bottom = corner(0, 1) + u * (corner(1, 1) - corner(0, 1));
        (1.5 * (top + v * (bottom - top))).clamp(-1.0, 1.0)
    }

    /// Sum of `octaves` noises, each finer and weaker than the one before: around 0, mostly within ±1.
    pub(super) fn fractal(&self, x: f32, y: f32, octaves: u32) -> f32 {
        self.octaves(x, y, octaves, |value| value)
    }

    /// Sum of `octaves` noises with sharp crests, each finer than the one before: about 0 to 1.
    pub(super) fn ridges(&self, x: f32, y: f32, octaves: u32) -> f32 {
        self.octaves(x, y, octaves, |value| 1.0 - 2.0 * value.abs()) / 2.0 + 0.35
    }

    fn octaves(&self, x: f32, y: f32, octaves: u32, shape: impl Fn(f32) -> f32) -> f32 {
        let (mut sum, mut weight, mut x, mut y) = (0.0, 0.55, x, y);
        for _ in 0..octaves {
            sum += weight * shape(self.smooth(x, y));
            weight *= 0.5;
            // Rotates and shifts the coordinates: the lattices of two octaves must not coincide.
            (x, y) = (1.6 * x - 1.2 * y + 17.3, 1.2 * x + 1.6 * y - 9.1);
        }
        sum
    }

    fn bits(&self, ix: i32, iy: i32) -> u64 {
        scrambled(self.seed ^ (u64::from(ix as u32) << 32 | u64::from(iy as u32)))
    }
}

const GRADIENTS: [(f32, f32); 8] = {
    const D: f32 = std::f32::consts::FRAC_1_SQRT_2;
    [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (D, D), (-D, D), (D, -D), (-D, -D)]
};

/// SplitMix64's output function (Steele, Lea & Flood 2014).
fn scrambled(bits: u64) -> u64 {
    let z = bits.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
