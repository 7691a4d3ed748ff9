//! The types of samples that are read.

/// The type of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SampleKind {
    U8,
    U16,
    /// float32.
    F32,
}

impl SampleKind {
    /// Length of a sample \[bytes\].
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::F32 => 4,
        }
    }

    /// The value of white.
    pub(super) fn full_scale(self) -> f32 {
        match self {
            Self::U8 => u8::MAX.into(),
            Self::U16 => u16::MAX.into(),
            Self::F32 => 1.0,
        }
    }
}
