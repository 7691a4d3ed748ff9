//! How a workgroup computes a Fourier transform: radices, threads, and the memory that its threads share.
//!
//! A transform of n = r₁ r₂ … values is done in stages (Stockham). In stage i each thread transforms r_i values in its
//! registers, at the places b + j n/r_i of a butterfly b, after a multiplication by
//!
//! ```text
//! e^{−2πi j (b mod s) / (s r_i)},   s = r_1 … r_{i−1}
//! ```
//!
//! and hands them to the other threads through shared memory. C. Van Loan, Computational Frameworks for the Fast Fourier
//! Transform (1992), §1.7.

use std::f64::consts::{PI, TAU};

/// Radices that a thread transforms in its registers.
const RADICES: [usize; 14] = [2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 15, 16];
/// Most stages of a transform.
const STAGES_MAX: usize = 5;
/// Values that a thread holds, of 8 bytes each. With more, few threads have room on a card, and memory is waited for.
const VALUES: usize = 18;
/// Threads that run in step on most cards.
const WARP: usize = 32;

/// A transform of `n` values by `threads` threads.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Plan {
    pub(crate) n: usize,
    pub(crate) radices: Vec<usize>,
    pub(crate) threads: usize,
}

impl Plan {
    /// The plan that wastes least work, with few stages; `None` if `n` has a factor above 13, or is too long for
    /// `threads_max` threads.
    pub(crate) fn choose(n: usize, threads_max: usize) -> Option<Self> {
        let mut best: Option<(f64, Self)> = None;
        products(n, &mut Vec::new(), &mut |radices| {
            let mut counts: Vec<usize> =
                radices.iter().flat_map(|r| (1..4).map(move |rounds| (n / r).div_ceil(rounds))).collect();
            counts.sort_unstable();
            counts.dedup();
            for threads in counts.into_iter().filter(|&threads| threads <= threads_max) {
                let plan = Self { n, radices: radices.to_vec(), threads };
                if plan.values() <= VALUES {
                    let cost = plan.cost();
                    if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                        best = Some((cost, plan));
                    }
                }
            }
        });
        best.map(|(_, plan)| plan)
    }

    /// Work relative to that of an ideal plan, with a price for each stage. Even outer radices make threads wait for
    /// each other's memory banks.
    fn cost(&self) -> f64 {
        let slots: usize = (0..self.radices.len()).map(|i| self.rounds(i) * self.radices[i] * self.threads).sum();
        let even = |r: &usize| if r.is_multiple_of(2) { 0.03 } else { 0.0 };
        let ends = self.radices.first().map_or(0.0, even) + self.radices.last().map_or(0.0, even);
        let ragged = if self.threads.is_multiple_of(WARP) { 0.0 } else { 0.02 };
        slots as f64 / self.n as f64 + 0.6 * self.radices.len() as f64 + ends + ragged
    }

    /// The plan of the inverse: its first stage takes values where the last stage of this plan leaves them.
    pub(crate) fn reversed(&self) -> Self {
        Self { radices: self.radices.iter().rev().copied().collect(), ..self.clone() }
    }

    /// Number of butterflies of a thread in stage `i`.
    pub(crate) fn rounds(&self, i: usize) -> usize {
        self.butterflies(i).div_ceil(self.threads)
    }

    /// Number of butterflies of stage `i`.
    pub(crate) fn butterflies(&self, i: usize) -> usize {
        self.n / self.radices[i]
    }

    /// s of stage `i`.
    pub(crate) fn stride(&self, i: usize) -> usize {
        self.radices[..i].iter().product()
    }

    /// Largest number of values that a thread holds.
    pub(crate) fn values(&self) -> usize {
        (0..self.radices.len()).map(|i| self.rounds(i) * self.radices[i]).max().unwrap_or(1)
    }

    /// Places that stay empty after each block of s·r values in shared memory behind stage `i`, so that few threads of a
    /// warp meet in one bank. `columns` transforms are interleaved; a value takes `words` words.
    pub(crate) fn padding(&self, i: usize, columns: usize, words: usize) -> usize {
        let (s, r, next) = (self.stride(i), self.radices[i], self.radices[i + 1]);
        let lanes = WARP / words;
        let cost = |padding: usize| -> usize {
            let of_group = |group: usize| {
                let mut banks = [[0_usize; WARP]; 2];
                for lane in group * lanes..(group + 1) * lanes {
                    let (thread, column) = (lane / columns, lane % columns);
                    let (b, b_next) = (thread.min(self.n / r - 1), thread.min(self.n / next - 1));
                    let written = (b % s + (s * r + padding) * (b / s)) * columns + column;
                    let read = (b_next + b_next / (s * r) * padding) * columns + column;
                    for word in 0..words {
                        banks[0][(written * words + word) % WARP] += 1;
                        banks[1][(read * words + word) % WARP] += 1;
                    }
                }
                banks.iter().map(|bank| bank.iter().max().copied().unwrap_or(0)).sum::<usize>()
            };
            (0..self.threads * columns / lanes).map(of_group).sum()
        };
        (0..5).min_by_key(|&padding| cost(padding)).unwrap_or(0)
    }

    /// Values of shared memory for this plan and its reverse.
    pub(crate) fn shared_len(&self, columns: usize, words: usize) -> usize {
        let of = |plan: &Self| {
            let behind = |i: usize| {
                let blocks = plan.n / (plan.stride(i) * plan.radices[i]);
                (plan.n + blocks * plan.padding(i, columns, words)) * columns
            };
            (0..plan.radices.len() - 1).map(behind).max().unwrap_or(0)
        };
        of(self).max(of(&self.reversed()))
    }

    /// Turns of the padding, e^{−iπk/n}, then those of each stage of this plan, and of its reverse.
    pub(crate) fn turns(&self) -> Vec<[f32; 2]> {
        let turn = |angle: f64| [angle.cos() as f32, angle.sin() as f32];
        let mut turns: Vec<_> = (0..self.n).map(|k| turn(-PI * k as f64 / self.n as f64)).collect();
        for plan in [self, &self.reversed()] {
            for i in 1..plan.radices.len() {
                let (s, r) = (plan.stride(i), plan.radices[i]);
                turns.extend((0..s).map(|q| turn(-TAU * q as f64 / (s * r) as f64)));
            }
        }
        turns
    }

    /// Place of the turns of stage `i` in [`Self::turns`] of the forward plan. `self` is the plan in use.
    pub(crate) fn turns_at(&self, inverse: bool, i: usize) -> usize {
        let before = |plan: &Self, stages: usize| (1..stages).map(|k| plan.stride(k)).sum::<usize>();
        let forward = if inverse { before(&self.reversed(), self.radices.len()) } else { 0 };
        self.n + forward + before(self, i)
    }
}

/// Calls `found` with each product of radices that is `n`.
fn products(n: usize, chosen: &mut Vec<usize>, found: &mut dyn FnMut(&[usize])) {
    if n == 1 && !chosen.is_empty() {
        return found(chosen);
    }
    if chosen.len() == STAGES_MAX {
        return;
    }
    for r in RADICES {
        if n.is_multiple_of(r) {
            chosen.push(r);
            products(n / r, chosen, found);
            chosen.pop();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_sizes_have_plans_and_sizes_with_large_factors_none() {
        for n in [5, 7, 11, 12, 360, 640, 1080, 1200, 1920, 2160, 2464, 3840, 4160, 7680] {
            let plan = Plan::choose(n, 1024).unwrap();
            assert_eq!(plan.radices.iter().product::<usize>(), n);
            assert!(plan.values() <= VALUES && plan.threads <= 1024, "{plan:?}");
        }
        for n in [1, 17, 34, 1009] {
            assert_eq!(Plan::choose(n, 1024), None, "{n}");
        }
        assert_eq!(Plan::choose(7680, 64), None);
    }
}
