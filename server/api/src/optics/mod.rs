//! Messages of the optics engine that several resources use: propagation methods, detectors, regions, quality.

pub(crate) mod from_wire;
pub(crate) mod to_wire;
