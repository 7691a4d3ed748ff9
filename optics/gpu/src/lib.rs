//! Holograms on a graphics card of any vendor, through Vulkan.
//!
//! [`GpuBackend`] is a [`Backend`](lightpath_optics::hologram::Backend) beside the processor's: every method that finds a
//! hologram runs on it as it is. It computes all detectors, losses by intensity and amplitude, several pictures and
//! frames, and every part of a learned display. It refuses displays that show all orders, total variation and speckle,
//! and sides with prime factors above 13; [`CardOrProcessor`] leaves these to the processor.
//!
//! # Never a wrong hologram
//!
//! - The shaders of a problem are compared with the processor's engine at the problem's own size before their first use:
//!   light, loss, gain and gradient, to 1e-5.
//! - A call that fails, or returns zeros or numbers that are not finite, is answered by the processor. Calls depend on
//!   their arguments only, so the method goes on where it is. The card is put aside, and [`Computed`] says why.
//! - Sums are made row by row and closed in a fixed order, without atomic operations: the same card and driver give the
//!   same bits in every run.
//!
//! # Layout
//!
//! | files | what |
//! |---|---|
//! | `backend.rs`, `handover.rs`, `task.rs`, `record.rs` | the border: who computes, and what happens when a card fails |
//! | `device.rs`, `speed.rs` | the choice between card and processor |
//! | `problem.rs`, `adam.rs`, `projection.rs` | a problem on a card: evaluations; steps of Adam; rounds of Gerchberg–Saxton |
//! | `passes.rs`, `program.rs` | which shaders run in which order, recorded once |
//! | `shape.rs`, `sizes.rs`, `plan.rs` | sizes: layout of fields, radices and threads |
//! | `display.rs`, `tables.rs`, `memory.rs` | a display's tables and a problem's arrays in the card's memory |
//! | `shaders/` | the text of the shaders, made from the sizes |
//! | `card.rs`, `fault.rs` | the card itself, and what goes wrong with it. Nothing else waits for the card |
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod adam;
mod backend;
mod card;
mod device;
mod display;
mod fault;
#[cfg(test)]
mod fault_tests;
mod handover;
mod memory;
mod passes;
mod plan;
#[cfg(test)]
mod planted;
mod problem;
mod program;
mod projection;
mod record;
mod shaders;
mod shape;
mod sizes;
mod speed;
mod tables;
mod task;

pub use backend::{CardOrProcessor, GpuBackend};
pub use card::{Card, CardInfo, cards};
pub use device::{Device, DeviceChoice};
pub use fault::Fault;
pub use record::Computed;
pub use speed::evaluation_time;
