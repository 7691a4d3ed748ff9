//! Checks of Adam's learning rate.

/// Limit on the learning rate: with larger ones the optimizer does not converge.
const LEARNING_RATE_MAX: f64 = 10.0;

/// Checks a learning rate, which must be above 0. `None`: the value is 0, which stands for the default.
pub(super) fn learning_rate(field: &Field, value: f64) -> Result<Option<f64>> {
    if value == 0.0 {
        return Ok(None);
    }
    if value > 0.0 && value <= LEARNING_RATE_MAX {
        return Ok(Some(value));
    }
    Err(field
        .but(format!("is {value}"), format!("must be above 0 and at most {LEARNING_RATE_MAX}, or 0 for the default")))
}
use lightpath_service::{Field, Result};
