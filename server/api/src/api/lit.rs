//! Pictures that were found to have light where it counts. Artifacts never change, so that this stays true, and a hundred jobs
//! with the same target decode it once.

use std::collections::{HashSet, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};

/// Findings that are kept: some hundred bytes each.
const FINDINGS_MAX: usize = 1000;

/// The latest findings; clones are the same.
#[derive(Clone, Debug, Default)]
pub(super) struct Lit(Arc<Mutex<Findings>>);

#[derive(Debug, Default)]
struct Findings {
    known: HashSet<String>,
    /// The oldest first.
    order: VecDeque<String>,
}

impl Lit {
    /// Whether this was found; `what` names the picture and all that its light was looked for with.
    pub(super) fn knows(&self, what: &str) -> bool {
        self.findings().known.contains(what)
    }

    pub(super) fn remember(&self, what: String) {
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
        let lit = Lit::default();
        for n in 0..FINDINGS_MAX + 2 {
            lit.remember(n.to_string());
            lit.remember(n.to_string());
        }
        assert!(!lit.knows("0") && !lit.knows("1") && lit.knows("2"));
        assert!(lit.knows(&(FINDINGS_MAX + 1).to_string()));
        let findings = lit.findings();
        assert_eq!((findings.known.len(), findings.order.len()), (FINDINGS_MAX, FINDINGS_MAX));
    }
}
