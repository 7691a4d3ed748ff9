//! What the agent is told.

use crate::Clock;
use crate::optics::in_words;
use lightpath_manifest::{Optics, PublicKey, Wanted};
use std::path::PathBuf;
use std::time::Duration;

/// What an agent does, for which device.
#[derive(Clone, Debug)]
pub struct Settings {
    /// URL of the server without a slash at its end, such as `https://lab:7070`.
    pub server: String,
    /// Id of the display.
    pub display: String,
    /// Name under which the server knows this device.
    pub device: String,
    /// Wavelength and place of the kernel: a manifest for others is refused.
    pub optics: Optics,
    /// Id of the kernel in addresses; `None`: the server is asked for it.
    pub kernel: Option<String>,
    /// Format of its file, such as `compact`.
    pub format: String,
    /// Root keys from the device's manufacture.
    pub roots: Vec<PublicKey>,
    /// File with the token of the device. It is read before each call, so that it can be replaced at any time.
    pub token_file: Option<PathBuf>,
    /// PEM file with the certificate authorities that may vouch for the server; without it, those of the system.
    pub ca_file: Option<PathBuf>,
    /// PEM files with the certificate by which the server knows this device, and with its private key.
    pub client: Option<(PathBuf, PathBuf)>,
    /// Directory that the agent keeps.
    pub directory: PathBuf,
    /// Program that tests a new kernel.
    pub self_test: Option<PathBuf>,
    /// Time limit of that program.
    pub self_test_limit: Duration,
    /// Times and limits.
    pub pace: Pace,
    /// The clock by which manifests and keyrings count.
    pub clock: Clock,
}

impl Settings {
    /// The kernel in words, such as `pluto, 515 nm, 150 mm`.
    pub(crate) fn subject(&self) -> String {
        format!("{}, {}", self.display, in_words(&self.optics))
    }

    /// What a manifest must say to count for this device.
    pub(crate) fn wanted(&self, generation: u64) -> Wanted {
        Wanted { display: self.display.clone(), optics: self.optics.clone(), format: self.format.clone(), generation }
    }
}

/// Whether a text can be an id: it is then safe in addresses.
pub(crate) fn is_word(text: &str) -> bool {
    (1..=63).contains(&text.len())
        && text.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"._-".contains(&byte))
        && !text.starts_with('.')
}

/// Times of the agent. Tests shorten them.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Longest time until a connection is open, with the search of its address and the handshake of TLS.
    pub connect: Duration,
    /// Longest time in which nothing arrives.
    pub stall: Duration,
    /// Longest time for a call that is not for a file, from the search of the address to the last byte.
    pub answer: Duration,
    /// Longest time for the file in one check. After it, the agent asks for the manifest again and continues the file. Small
    /// files have less: the time of an answer, and one second for each kilobyte.
    pub file: Duration,
    /// Time for which the server may wait for a change before it answers.
    pub wait: Duration,
    /// First pause after an error. It doubles with each further one.
    pub error_pause_min: Duration,
    /// Longest pause after an error.
    pub error_pause_max: Duration,
    /// Pause before a cut download continues.
    pub cut_pause: Duration,
    /// Longest time between two reports.
    pub report_interval: Duration,
    /// Longest time between two looks at the keyring, which is where a device learns of revoked keys.
    pub keyring_interval: Duration,
}

impl Pace {
    /// Speed below which a small file counts as cut \[bytes/s\]: less than that of the slowest modems.
    const FILE_BYTES_PER_S_MIN: u64 = 1000;

    /// Time for a file of this size in one check: the time of an answer, and that of its bytes at the least speed, but not
    /// more than the limit.
    pub(crate) fn time_for_file(&self, size_bytes: u64) -> Duration {
        let bytes = Duration::from_secs(size_bytes / Self::FILE_BYTES_PER_S_MIN);
        self.file.min(self.answer.saturating_add(bytes))
    }
}

impl Default for Pace {
    fn default() -> Self {
        Self {
            connect: Duration::from_secs(15),
            stall: Duration::from_secs(30),
            answer: Duration::from_secs(60),
            file: Duration::from_secs(600),
            // The server's own limit: gateways commonly end requests after a minute.
            wait: Duration::from_secs(50),
            error_pause_min: Duration::from_secs(5),
            error_pause_max: Duration::from_secs(300),
            cut_pause: Duration::from_secs(1),
            report_interval: Duration::from_secs(3600),
            keyring_interval: Duration::from_secs(86_400),
        }
    }
}
