//! Remembering which targets have light in the region of interest. Artifacts never change, so a target that was checked
//! once is right for all later jobs, and is decoded only once.

use std::collections::{HashSet, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};

/// Findings that are kept: some hundred bytes each.
const FINDINGS_MAX: usize = 1000;

/// The latest findings; clones are the same.
#[derive(Clone, Debug, Default)]
pub(crate) struct CheckedTargets(Arc<Mutex<Findings>>);

#[derive(Debug, Default)]
struct Findings {
    known: HashSet<String>,
    /// The oldest first.
    order: VecDeque<String>,
}

impl CheckedTargets {
    /// Whether a target was found to have light; `what` names the picture and all that the check depends on.
    pub(crate) fn knows(&self, what: &str) -> bool {
        self.findings().known.contains(what)
    }

    /// Keeps a finding; the oldest is forgotten where there are too many.
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
        // Both parts are changed together, without anything in between that could panic.
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
