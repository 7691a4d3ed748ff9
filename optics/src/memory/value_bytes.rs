//! Bytes of the values in buffers.

/// Bytes of a complex number in f32.
pub(super) const COMPLEX: u64 = 8;
/// Bytes of a complex number in f64.
pub(super) const COMPLEX_F64: u64 = 16;
/// Bytes of a real number in f32.
pub(super) const REAL: u64 = 4;
