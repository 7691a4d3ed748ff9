//! Estimates of the memory and the time of jobs, made before they start.
//!
//! Each kind of job runs in stages. An estimate is the largest sum of the memory that is held at once. The engine
//! counts its own buffers (`lightpath_optics::memory`), and the reading of pictures is counted where they are decoded.
//! The work of a job has the unit of the engine, values times radix-2 stages. The speed of the machine turns it into a
//! time.
//!
//! An estimate must not be below the real memory, and should be at most six tenths above it. `docs/estimates.md`
//! compares estimates with measurements. What a kind of job needs is in its file in `kinds`, from the sizes here.

#[cfg(test)]
mod tests;

use crate::dataset::{Dataset, Split};
use crate::display::Display;
use lightpath_optics::learning::Blocks;
use lightpath_optics::memory::EngineSize;
use serde::{Deserialize, Serialize};

/// Limit on the memory for the decoded training pairs of one job \[bytes\]. Reading a pair again takes about as long as
/// learning from it, but a large dataset must not fill the machine's memory.
pub const TRAINING_PAIRS_BYTES_MAX: usize = 256 << 20;
/// The same limit for validation pairs and for test pairs, which are used less often \[bytes\].
pub const OTHER_PAIRS_BYTES_MAX: usize = 64 << 20;
/// Limit on the memory for the pictures of the pairs from which an alignment is computed \[bytes\].
pub const ALIGNMENT_BYTES_MAX: usize = 384 << 20;
/// Limit on the number of these pairs.
pub const ALIGNMENT_PAIRS_MAX: usize = 8;
/// Number of L-BFGS steps for each hologram with which a learned kernel of a simulated display is photographed. The
/// result is within one or two decibels of convergence.
pub const CAPTURED_ITERATIONS: u32 = 40;

/// Number of L-BFGS steps for each hologram from which the suggested ones are chosen: enough for a recognizable
/// picture.
pub const SUGGESTED_ITERATIONS: u32 = 15;
/// Limit on the number of photographed holograms whose information is computed. It is taken for that of all.
pub const SAMPLED_PAIRS_MAX: usize = 8;

/// Memory that every job takes: stacks of its threads, rows of the database, tables, and what the allocator keeps
/// \[bytes\].
const BASE_BYTES: u64 = 12 << 20;
/// Part of the memory in smaller allocations that the allocator keeps for itself after they are freed.
const FRAGMENTATION: f64 = 0.03;
/// Bytes of a real number in f32.
pub(super) const REAL: u64 = 4;
/// Time of reading or writing a pixel of a picture: codec, digest and disk, in the unit of work.
pub(super) const FILE_STAGES: f64 = 1500.0;
/// Time of a step, relative to that on a small display, whose buffers fit into the caches. The speed is measured on
/// such a display.
pub(super) const STEP_FACTOR: f64 = 1.2;
/// Time of learning, relative to that of its propagations and products.
pub(super) const LEARNING_FACTOR: f64 = 1.5;
/// Work of a job besides what is counted: its start, its rows in the database, its files.
const BASE_WORK: f64 = 5e8;

/// Estimate of a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Largest memory at a time, above that of the idle server \[bytes\]; 0: not estimated.
    pub memory_bytes: u64,
    /// Time of an attempt that no other job slows down \[s\]; 0: not estimated.
    pub time_s: f64,
}

/// Memory and work of a job.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Need {
    /// Largest memory at a time \[bytes\].
    pub memory_bytes: u64,
    /// Work, in values times radix-2 stages.
    pub work: f64,
    /// Time for what is no computation, such as photographs at a bench \[s\].
    pub waiting_s: f64,
}

impl Need {
    pub(super) fn new(stages: impl IntoIterator<Item = u64>, work: f64) -> Self {
        let largest = stages.into_iter().max().unwrap_or(0);
        let memory_bytes = BASE_BYTES + largest + (FRAGMENTATION * largest as f64) as u64;
        Self { memory_bytes, work: BASE_WORK + work, waiting_s: 0.0 }
    }

    /// The same with some time for what is no computation \[s\].
    pub(super) fn and_waiting(self, waiting_s: f64) -> Self {
        Self { waiting_s, ..self }
    }

    /// The estimate for a machine that does `work_per_s` work each second.
    #[must_use]
    pub fn on(self, work_per_s: f64) -> Estimate {
        Estimate { memory_bytes: self.memory_bytes, time_s: self.work / work_per_s + self.waiting_s }
    }
}

/// A kernel that a job uses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KernelSize {
    /// Engine with the kernel.
    pub engine: EngineSize,
    /// Highest order of a smooth kernel; 0 for other kernels.
    pub order: usize,
    /// Blocks of the kernel's model.
    pub blocks: Blocks,
    /// Whether the kernel has a value for each frequency.
    pub has_bins: bool,
    /// Size of the kernel's file \[bytes\]; 0: the ideal kernel.
    pub file_bytes: u64,
}

impl KernelSize {
    /// Memory for reading the kernel and sampling its transfer functions, besides them: the file, its numbers, and
    /// their copy.
    pub(super) fn reading_bytes(&self) -> u64 {
        3 * self.numbers_bytes() + self.engine.sampling_bytes
    }

    /// Numbers of a kernel with a value for each frequency.
    pub(super) fn numbers_bytes(&self) -> u64 {
        if self.has_bins { self.file_bytes } else { 0 }
    }

    /// Transfer functions that the engine's cache may keep.
    pub(super) fn cached_bytes(&self) -> u64 {
        if self.has_bins { 0 } else { self.engine.transfers_bytes() }
    }
}

/// The pairs of a dataset, as far as they determine memory and work.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairsSize {
    /// Numbers of pairs for training, validation and test.
    pub splits: [usize; 3],
    /// Number of all pairs.
    pub all: usize,
    /// Whether a pair was not measured with the present alignment.
    pub is_stale: bool,
    /// Largest number of pixels of a photograph.
    pub photo_px: u64,
    /// Largest memory for decoding one photograph \[bytes\].
    pub decoding_bytes: u64,
}

impl PairsSize {
    /// Memory for decoding one pixel of a photograph: file, samples, and light before and after its orientation.
    const DECODING_BYTES_PER_PX: u64 = 10;

    /// Size of a dataset's pairs. Photographs whose size is not known have that of the display.
    #[must_use]
    pub fn of(dataset: &Dataset, display: &Display) -> Self {
        let used = |split| dataset.pairs.iter().filter(|pair| pair.split == Some(split)).count();
        let px = |[width, height]: [u32; 2]| u64::from(width) * u64::from(height);
        let measured = dataset.pairs.iter().filter_map(|pair| pair.checks.as_ref()).map(|checks| px(checks.photo_px));
        let aligned = dataset.alignment.as_ref().map(|found| px([found.photo_width_px, found.photo_height_px]));
        let own = px([display.width_px, display.height_px]);
        let photo_px = measured.chain(aligned).max().unwrap_or(0).max(own);
        Self {
            splits: [Split::Train, Split::Validation, Split::Test].map(used),
            all: dataset.pairs.len(),
            is_stale: dataset.pairs.iter().any(|pair| !pair.is_measured_with(dataset.camera_map())),
            photo_px,
            decoding_bytes: Self::DECODING_BYTES_PER_PX * photo_px,
        }
    }

    /// Memory of the decoded pairs that are kept, for training, validation and test.
    pub(super) fn kept_bytes(&self, pixels: u64, datasets: usize) -> [u64; 3] {
        let limits = [TRAINING_PAIRS_BYTES_MAX, OTHER_PAIRS_BYTES_MAX, OTHER_PAIRS_BYTES_MAX];
        let pair = 2 * REAL * pixels;
        std::array::from_fn(|i| {
            let room = (limits[i] / datasets) as u64 / pair;
            room.min(self.splits[i] as u64) * pair
        })
    }

    /// Memory for reading a pair: the files, the decoded photograph, and the planes on the display's grid.
    pub(super) fn reading_bytes(&self, pixels: u64) -> u64 {
        self.decoding_bytes + 4 * REAL * pixels
    }
}
