//! Order of the pairs, and schedule of the learning rate.

use rand::{SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::PI;

/// The order of the pairs in an epoch, drawn at random from the seed.
pub(super) fn shuffled(pairs: usize, epoch: u32, seed: u64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..pairs).collect();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(u64::from(epoch) + 1);
    order.shuffle(&mut random);
    order
}

/// Learning rate of a one-cycle schedule: it rises to `peak` over the first third of the steps and falls to a hundredth
/// of it at the end, both along half a cosine. A constant learning rate was seen to diverge once the model was nearly
/// right.
pub(super) fn one_cycle(step: u32, steps: u32, peak: f64) -> f64 {
    let (low, progress) = (peak / 100.0, f64::from(step) / f64::from(steps.max(1)));
    let height = if progress < 1.0 / 3.0 { progress * 3.0 } else { (1.0 - progress) * 1.5 };
    low + (peak - low) * (1.0 - (PI * height).cos()) / 2.0
}
