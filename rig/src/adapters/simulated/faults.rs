//! Faults that are planted on purpose, each with a probability and all from one seed.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};
use serde::Deserialize;
use std::fmt;
use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::PathBuf;

/// Probabilities and sizes of the faults, in the rig's file. All are 0 unless they are given.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Faults {
    /// Seed of the random numbers.
    pub seed: u64,
    /// A frame shows the pattern before, and says that it is new.
    pub stale_frame: f64,
    /// The upper half of a frame shows the pattern, the lower half the pattern before.
    pub half_frame: f64,
    /// A frame is lost: the number after it is higher by 2.
    pub dropped_frame: f64,
    /// A frame comes twice, with the same number.
    pub doubled_frame: f64,
    /// A change of the exposure takes effect a frame later than the camera says.
    pub late_exposure: f64,
    /// A frame is black.
    pub black_frame: f64,
    /// A frame is far too bright.
    pub saturated_frame: f64,
    /// The picture of a frame is moved by up to 20 px.
    pub shifted_frame: f64,
    /// A window covers a part of the pattern while it is shown.
    pub covered_pattern: f64,
    /// The camera does not answer, for `hang_s`.
    pub hanging_camera: f64,
    /// Time for which the camera hangs \[s\].
    pub hang_s: f64,
    /// The bits of a frame are in the upper part of 16, though the camera says the lower, or the other way round.
    pub wrong_bits: f64,
    /// Number of pixels that are always white.
    pub hot_pixels: u32,
    /// Standard deviation of noise that is added, as a part of white.
    pub read_noise: f64,
    /// Part of its light that the source loses from one frame to the next.
    pub power_drift_per_frame: f64,
    /// Pixels by which the picture moves to the right from one frame to the next \[px\].
    pub place_drift_px_per_frame: f64,
    /// File to which each planted fault is added as a line: the number of the frame, the fault.
    pub log: Option<PathBuf>,
}

/// A kind of fault that happens now and then.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Fault {
    /// [`Faults::stale_frame`].
    StaleFrame = 1,
    /// [`Faults::half_frame`].
    HalfFrame = 2,
    /// [`Faults::dropped_frame`].
    DroppedFrame = 3,
    /// [`Faults::doubled_frame`].
    DoubledFrame = 4,
    /// [`Faults::late_exposure`].
    LateExposure = 5,
    /// [`Faults::black_frame`].
    BlackFrame = 6,
    /// [`Faults::saturated_frame`].
    SaturatedFrame = 7,
    /// [`Faults::shifted_frame`].
    ShiftedFrame = 8,
    /// [`Faults::covered_pattern`].
    CoveredPattern = 9,
    /// [`Faults::hanging_camera`].
    HangingCamera = 10,
    /// [`Faults::wrong_bits`].
    WrongBits = 11,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::StaleFrame => "stale_frame",
            Self::HalfFrame => "half_frame",
            Self::DroppedFrame => "dropped_frame",
            Self::DoubledFrame => "doubled_frame",
            Self::LateExposure => "late_exposure",
            Self::BlackFrame => "black_frame",
            Self::SaturatedFrame => "saturated_frame",
            Self::ShiftedFrame => "shifted_frame",
            Self::CoveredPattern => "covered_pattern",
            Self::HangingCamera => "hanging_camera",
            Self::WrongBits => "wrong_bits",
        })
    }
}

/// A fault that happened.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Planted {
    /// Number of the frame; of a covered pattern that of the frame before.
    pub frame: u64,
    /// What happened.
    pub fault: Fault,
}

/// Decides when a fault happens. The same seed gives the same faults at the same numbers.
pub(super) struct Planter {
    pub(super) faults: Faults,
    pub(super) planted: Vec<Planted>,
}

impl Planter {
    pub(super) fn new(faults: Faults) -> Self {
        Self { faults, planted: Vec::new() }
    }

    fn probability(&self, fault: Fault) -> f64 {
        let faults = &self.faults;
        match fault {
            Fault::StaleFrame => faults.stale_frame,
            Fault::HalfFrame => faults.half_frame,
            Fault::DroppedFrame => faults.dropped_frame,
            Fault::DoubledFrame => faults.doubled_frame,
            Fault::LateExposure => faults.late_exposure,
            Fault::BlackFrame => faults.black_frame,
            Fault::SaturatedFrame => faults.saturated_frame,
            Fault::ShiftedFrame => faults.shifted_frame,
            Fault::CoveredPattern => faults.covered_pattern,
            Fault::HangingCamera => faults.hanging_camera,
            Fault::WrongBits => faults.wrong_bits,
        }
    }

    /// Whether a fault happens at the `n`-th chance, which is frame `frame`; it is written down if so.
    pub(super) fn happens(&mut self, fault: Fault, n: u64, frame: u64) -> bool {
        let does = draws(self.faults.seed, fault as u64, n).next() < self.probability(fault);
        if does {
            self.planted.push(Planted { frame, fault });
            self.write(frame, fault);
        }
        does
    }

    fn write(&self, frame: u64, fault: Fault) {
        let Some(path) = &self.faults.log else { return };
        let opened = OpenOptions::new().create(true).append(true).open(path);
        if let Err(error) = opened.and_then(|mut file| writeln!(file, "{frame} {fault}")) {
            crate::log::line(format_args!("the planted fault cannot be written to {}: {error}", path.display()));
        }
    }
}

/// Random numbers of a purpose.
pub(super) struct Draws(ChaCha8Rng);

/// The random numbers of one purpose at one time.
pub(super) fn draws(seed: u64, purpose: u64, n: u64) -> Draws {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream((purpose << 40) + n);
    Draws(rng)
}

impl Draws {
    /// A uniform random number in [0, 1).
    pub(super) fn next(&mut self) -> f64 {
        const UNIT: f64 = 1.0 / (1u64 << 53) as f64;
        (self.0.next_u64() >> 11) as f64 * UNIT
    }

    /// A normal random number with mean 0 and standard deviation 1 (Box and Muller).
    pub(super) fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.next()).ln()).sqrt() * (std::f64::consts::TAU * self.next()).cos()
    }
}
