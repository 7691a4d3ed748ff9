//! What a process can run: labels that jobs need, and memory.

use serde::{Deserialize, Serialize};
use std::fmt::{self, Display};

/// Limit on the labels that a job needs.
pub const NEEDS_MAX: usize = 8;
/// Limit on the labels of a process: each claim compares them with the needs of jobs.
pub const LABELS_MAX: usize = 32;
/// Limit on the length of a label \[bytes\], as of a label in the domain name system.
const LABEL_BYTES_MAX: usize = 63;

/// Begin of the labels for rigs.
const RIG_PREFIX: &str = "rig.";

/// Labels, such as `gpu` or `bench-2`: ascending, each once.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Labels(Vec<String>);

/// Why texts are no labels.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LabelError {
    /// A text is no label.
    #[error(
        "has {0:?}, which is no label; a label has 1 to 63 small letters, digits, '.' and '-', and begins with a letter or \
         digit, such as gpu or bench-2"
    )]
    Form(String),
    /// There are too many.
    #[error("has {0} labels, but may have {1}")]
    Count(usize, usize),
}

impl Labels {
    /// Checks labels, at most `count_max`.
    ///
    /// # Errors
    ///
    /// [`LabelError`].
    pub fn new<T: AsRef<str>>(texts: impl IntoIterator<Item = T>, count_max: usize) -> Result<Self, LabelError> {
        let mut labels = Vec::new();
        for text in texts {
            let text = text.as_ref();
            if !is_label(text) {
                let shown: String = text.chars().take(LABEL_BYTES_MAX + 1).collect();
                return Err(LabelError::Form(shown));
            }
            labels.push(text.to_owned());
        }
        labels.sort();
        labels.dedup();
        match labels.len() > count_max {
            true => Err(LabelError::Count(labels.len(), count_max)),
            false => Ok(Self(labels)),
        }
    }

    /// Reads the labels of a process, separated by commas.
    ///
    /// # Errors
    ///
    /// [`LabelError`].
    pub fn parse(text: &str) -> Result<Self, LabelError> {
        Self::new(text.split(',').map(str::trim).filter(|label| !label.is_empty()), LABELS_MAX)
    }

    /// The label of processes to which the rig of a display is connected, and of jobs that need it. It may be longer than
    /// labels that people choose.
    #[must_use]
    pub fn of_rig(display: &str) -> Self {
        Self(vec![format!("{RIG_PREFIX}{display}")])
    }

    /// The first display whose rig is among the labels.
    #[must_use]
    pub fn rig(&self) -> Option<&str> {
        self.iter().find_map(|label| label.strip_prefix(RIG_PREFIX))
    }

    /// All of these labels.
    #[must_use]
    pub fn all_of(parts: impl IntoIterator<Item = Self>) -> Self {
        let mut labels: Vec<String> = parts.into_iter().flat_map(|part| part.0).collect();
        labels.sort();
        labels.dedup();
        Self(labels)
    }

    /// The labels, ascending.
    pub fn iter(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(String::as_str)
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether every one of `needs` is among the labels.
    #[must_use]
    pub fn contain(&self, needs: &Self) -> bool {
        needs.0.iter().all(|need| self.0.binary_search(need).is_ok())
    }
}

impl Display for Labels {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.join(", "))
    }
}

fn is_label(text: &str) -> bool {
    let is_inner = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit();
    text.len() <= LABEL_BYTES_MAX
        && text.bytes().next().is_some_and(is_inner)
        && text.bytes().all(|byte| is_inner(byte) || byte == b'.' || byte == b'-')
}

/// What a process offers to jobs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Abilities {
    /// Labels of the process.
    pub labels: Labels,
    /// Largest memory of a job that it starts, by [`counted_memory`] \[bytes\].
    pub memory_bytes: u64,
    /// It starts only jobs that need one of these labels; empty: all jobs.
    pub only_for: Labels,
}

impl Default for Abilities {
    /// No labels, and no limit on the memory.
    fn default() -> Self {
        Self { labels: Labels::default(), memory_bytes: u64::MAX, only_for: Labels::default() }
    }
}

impl Abilities {
    /// Whether the process starts a job with this estimate of memory \[bytes\].
    #[must_use]
    pub fn give(&self, memory_bytes: u64) -> bool {
        counted_memory(memory_bytes) <= self.memory_bytes
    }
}

/// Memory for which a job with this estimate counts when processes choose among jobs \[bytes\]: rounded up to one of 16
/// steps between a number and its double; 0 up to 32 MiB, which every process has. So there are few different values, and
/// thousands of jobs that are too large for a process are passed over at once.
#[must_use]
pub fn counted_memory(bytes: u64) -> u64 {
    const SMALL: u64 = 32 << 20;
    const BITS: u32 = 5;
    if bytes <= SMALL {
        return 0;
    }
    let step = 1_u64 << (u64::BITS - bytes.leading_zeros() - BITS);
    bytes.checked_next_multiple_of(step).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_sorted_and_checked() {
        let labels = Labels::parse(" gpu, bench-2,gpu,").unwrap();
        assert_eq!(labels.iter().collect::<Vec<_>>(), ["bench-2", "gpu"]);
        assert_eq!((labels.to_string(), Labels::parse("").unwrap()), ("bench-2, gpu".to_owned(), Labels::default()));
        for bad in ["GPU", "-gpu", ".x", "a b", "ä", "a_b", "a\n", "", &"x".repeat(64)] {
            assert!(matches!(Labels::new([bad], NEEDS_MAX), Err(LabelError::Form(_))), "{bad:?}");
        }
        Labels::new(["0", "a.b-c", &"x".repeat(63)], NEEDS_MAX).unwrap();
        let nine: Vec<String> = (0..9).map(|n| n.to_string()).collect();
        assert_eq!(Labels::new(&nine, NEEDS_MAX), Err(LabelError::Count(9, 8)));
        assert!(Labels::new(nine[..8].iter().chain(&nine[..8]), NEEDS_MAX).is_ok(), "doubles do not count");
    }

    #[test]
    fn memory_is_rounded_up_by_a_sixteenth_at_most() {
        for bytes in [(32 << 20) + 1, (64 << 20) - 1, 1_000_000_007, 40 << 30, (1 << 50) - 1] {
            let counted = counted_memory(bytes);
            assert!(counted >= bytes && (counted - bytes) * 16 < bytes, "{bytes}: {counted}");
            assert_eq!(counted_memory(counted), counted, "{bytes}");
            let offers = |memory_bytes| Abilities { memory_bytes, ..Abilities::default() }.give(bytes);
            assert!(offers(counted) && !offers(counted - 1), "{bytes}");
        }
        assert_eq!((counted_memory(0), counted_memory(32 << 20), counted_memory(u64::MAX)), (0, 0, u64::MAX));
    }

    #[test]
    fn every_need_must_be_among_the_labels() {
        let of = |text| Labels::parse(text).unwrap();
        for (labels, needs, enough) in
            [("", "", true), ("", "a", false), ("a,b", "", true), ("a,b", "b", true), ("a,b", "a,c", false)]
        {
            assert_eq!(of(labels).contain(&of(needs)), enough, "{labels} for {needs}");
        }
        assert!(!of("ab").contain(&of("a")) && !of("a-b").contain(&of("a")));
    }
}
