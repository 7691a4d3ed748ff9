//! A memory of the targets that have light in the region of interest. Artifacts never change, so a checked target need
//! not be decoded again for later jobs.

use std::collections::{HashSet, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};

/// Limit on the remembered checks, which need some hundred bytes each.
const FINDINGS_MAX: usize = 1000;

/// The latest checks. Clones share them.
#[derive(Clone, Debug, Default)]
pub(crate) struct CheckedTargets(Arc<Mutex<Findings>>);

#[derive(Debug, Default)]
struct Findings {
    known: HashSet<String>,
    /// Keys of the checks, the oldest first.
    order: VecDeque<String>,
}

impl CheckedTargets {
    /// Whether a target is known to have light. `what` names the picture and everything else on which the check
    /// depends.
    pub(crate) fn knows(&self, what: &str) -> bool {
        self.findings().known.contains(what)
    }

    /// Remembers a check. The oldest check is forgotten if there are too many.
    pub(crate) fn remember(&self, what: String) {
        let mut findings = self.findings();
        if !findings.known.insert(what.clone()) {
            return;
        }
        findings.order.push_back(what);
        if findings.order.len() > FINDINGS_MAX
            && let Some(oldest) = findings.order.pop_front()
        {
            findings.known.remove(&oldest);
        }
    }

    fn findings(&self) -> std::sync::MutexGuard<'_, Findings> {
        // The state is consistent even after a panic: both parts change together, and nothing in between can panic.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_latest_findings_are_kept_and_no_more() {
        let targets = CheckedTargets::default();
        for n in 0..FINDINGS_MAX + 2 {
            targets.remember(n.to_string());
            targets.remember(n.to_string());
        }
        assert!(!targets.knows("0") && !targets.knows("1") && targets.knows("2"));
        assert!(targets.knows(&(FINDINGS_MAX + 1).to_string()));
        let findings = targets.findings();
        assert_eq!((findings.known.len(), findings.order.len()), (FINDINGS_MAX, FINDINGS_MAX));
    }
}
