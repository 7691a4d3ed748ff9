//! Propagation against closed forms, the direct sum, and itself.
#![allow(clippy::unwrap_used)]

/// What every engine must get right: the reference tests.
mod engines;
/// Fields to send, and how to compare what arrives.
mod fields;
/// Nothing that is allowed makes anything panic.
mod fuzz;
/// Each method against closed forms, the direct sum and its adjoint.
mod methods;
/// The planner's choices against the alternatives, and what is refused.
mod planner;
