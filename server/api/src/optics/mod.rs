//! Messages of the optics engine that several resources use: methods of propagation, detectors, regions, quality.

pub(crate) mod from_wire;
pub(crate) mod propagation_checks;
pub(crate) mod to_wire;
