//! Checks of Adam's learning rate.

/// Limit on the learning rate: with larger ones the optimizer does not converge.
const LEARNING_RATE_MAX: f64 = 10.0;

/// Checks a learning rate, which must be above 0 and may be left out for `unset`.
pub(super) fn learning_rate(field: &Field, value: Option<f64>, unset: &str) -> Result<Option<f64>> {
    field.if_set(value, unset, |value| field.positive(value, LEARNING_RATE_MAX))
}
use lightpath_service::{Field, Result};
