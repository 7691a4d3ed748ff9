//! Tests of propagation: comparisons with closed forms, with the direct sum, and between methods.
//!
//! They are unit tests of the engine: as a program of their own they would compile it for f64 once more, which takes longer
//! than they do.

mod all_orders;
/// Reference tests that every propagation engine must pass.
mod band_response;
mod engines;
/// Input fields for the tests, and measures that compare fields.
mod fields;
mod filter;
/// Random valid inputs, which must not cause a panic.
mod fuzz;
/// Comparisons of each method with closed forms, with the direct sum and with its adjoint.
mod methods;
/// Comparisons of the planner's choices with the alternatives, and refused setups.
mod planner;
