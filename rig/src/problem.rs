//! Why the program ends.

use std::process::ExitCode;

/// A reason to end, for which a retry can never help.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Problem {
    /// The rig's file, its options or its folder are wrong.
    #[error("{0}")]
    Setting(String),
    /// The server does not let this rig serve.
    #[error("{0}")]
    Refused(String),
    /// The devices cannot be used.
    #[error("{0}")]
    Devices(String),
}

impl Problem {
    /// The exit code: 2 for wrong settings, 3 if the server refuses, 4 for devices.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(match self {
            Self::Setting(_) => 2,
            Self::Refused(_) => 3,
            Self::Devices(_) => 4,
        })
    }
}

impl From<crate::device::DeviceError> for Problem {
    fn from(error: crate::device::DeviceError) -> Self {
        Self::Devices(error.0)
    }
}
