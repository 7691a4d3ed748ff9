//! What computed a hologram.

use crate::card::CardInfo;
use crate::fault::Fault;
use std::fmt;
use std::sync::{Mutex, PoisonError};

/// What computes the problems of one backend, as far as they have got.
#[derive(Debug, Default)]
pub(crate) struct Record(Mutex<Computed>);

/// What computed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Computed {
    /// The card that computed at least a part; `None`: the processor computed everything.
    pub card: Option<CardInfo>,
    /// Why the processor computed what it did, although there was a card; `None`: it did not.
    pub processor_because: Option<String>,
}

impl Record {
    /// What computed so far.
    pub(crate) fn computed(&self) -> Computed {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    pub(crate) fn took(&self, card: &CardInfo) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).card = Some(card.clone());
    }

    pub(crate) fn refused(&self, reason: &str) {
        let mut computed = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        computed.processor_because.get_or_insert_with(|| reason.to_owned());
    }

    pub(crate) fn hand_over(&self, fault: &Fault) {
        self.refused(&fault.to_string());
    }
}

impl fmt::Display for Computed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.card, &self.processor_because) {
            (None, None) => write!(f, "processor"),
            (None, Some(reason)) => write!(f, "processor: {reason}"),
            (Some(card), None) => write!(f, "{card}"),
            (Some(card), Some(reason)) => write!(f, "{card}, then processor: {reason}"),
        }
    }
}
