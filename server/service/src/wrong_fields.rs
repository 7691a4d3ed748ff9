//! Checks that go on after a wrong field, so that a refusal names every wrong field of a request at once.

use crate::error::{Fix, Result, ServiceError, WrongField};
use crate::field::Field;

/// Limit on the wrong fields that one refusal names: enough for a screen. Long ones are cut where the answer is made, because
/// clients accept few headers.
const WRONG_FIELDS_MAX: usize = 12;

/// Evaluates every check, and binds the names to the values of all of them. Returns from the function with the errors
/// of all checks if one of them fails.
///
/// ```ignore
/// check_all! {
///     width_px = at("width_px").integer(message.width_px, SIDE_PX);
///     height_px = at("height_px").integer(message.height_px, SIDE_PX);
/// }
/// ```
#[macro_export]
macro_rules! check_all {
    ($($name:ident = $check:expr;)+) => {
        $(let $name = $check;)+
        let ($($name,)+) = match ($($name,)+) {
            ($(Ok($name),)+) => ($($name,)+),
            ($($name,)+) => {
                let errors = [$($name.err(),)+];
                return Err($crate::all_of(errors.into_iter().flatten()));
            }
        };
    };
}

/// The values of all checks, or the errors of all checks that failed.
pub fn collect_all<T>(checks: impl IntoIterator<Item = Result<T>>) -> Result<Vec<T>> {
    let (mut values, mut errors) = (Vec::new(), Vec::new());
    for check in checks {
        match check {
            Ok(value) => values.push(value),
            Err(error) => errors.push(error),
        }
    }
    if errors.is_empty() { Ok(values) } else { Err(all_of(errors)) }
}

/// One error for several: it names all wrong fields. An error that is not about a field, such as a missing permission,
/// stands for all of them; but a present state that does not allow the request counts only without wrong fields.
///
/// # Panics
///
/// If there is no error.
pub fn all_of(errors: impl IntoIterator<Item = ServiceError>) -> ServiceError {
    let mut errors: Vec<ServiceError> = errors.into_iter().collect();
    assert!(!errors.is_empty(), "a refusal has a reason");
    if errors.iter().any(is_about_fields) {
        errors.retain(|error| !matches!(error, ServiceError::Precondition { .. }));
    }
    if let Some(other) = errors.iter().position(|error| !is_about_fields(error)) {
        return errors.swap_remove(other);
    }
    if errors.len() == 1 {
        return errors.remove(0);
    }
    let are_missing = errors.iter().all(|error| matches!(error, ServiceError::Missing { .. }));
    let mut fields: Vec<WrongField> = Vec::new();
    for field in errors.into_iter().flat_map(wrong_fields) {
        if !fields.contains(&field) {
            fields.push(field);
        }
    }
    let count = fields.len();
    fields.truncate(WRONG_FIELDS_MAX);
    ServiceError::SeveralInvalid { fields, count, are_missing }
}

/// True for errors that name a field of the request.
pub fn is_about_fields(error: &ServiceError) -> bool {
    matches!(error, ServiceError::Invalid { .. } | ServiceError::Missing { .. } | ServiceError::SeveralInvalid { .. })
}

fn wrong_fields(error: ServiceError) -> Vec<WrongField> {
    match error {
        ServiceError::Invalid(wrong) => vec![wrong],
        ServiceError::Missing { field, what, fix } => vec![missing(field, &what, fix)],
        ServiceError::SeveralInvalid { fields, .. } => fields,
        _ => Vec::new(),
    }
}

/// A field that names a missing resource.
#[must_use]
pub fn missing(field: String, what: &str, fix: &str) -> WrongField {
    WrongField { field, problem: format!("names {what}, which does not exist"), fix: Fix::Action(fix.to_owned()) }
}

/// The error about a request that is part of another one, in its field `outer`.
#[must_use]
pub fn within(outer: &Field, error: ServiceError) -> ServiceError {
    let inner = |field: &str| outer.at(field).to_string();
    let wrong = |wrong: WrongField| WrongField { field: inner(&wrong.field), ..wrong };
    match error {
        ServiceError::Invalid(field) => ServiceError::Invalid(wrong(field)),
        ServiceError::SeveralInvalid { fields, count, are_missing } => {
            ServiceError::SeveralInvalid { fields: fields.into_iter().map(wrong).collect(), count, are_missing }
        }
        ServiceError::Missing { field, what, fix } => ServiceError::Missing { field: inner(&field), what, fix },
        ServiceError::Precondition { reason, message } => {
            ServiceError::Precondition { reason, message: format!("{outer}: {message}") }
        }
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn checked(width: u32, height: u32, name: Result<String>) -> Result<(u32, u32, String)> {
        check_all! {
            width = Field::new("width").integer(width, 16..=64);
            height = Field::new("height").integer(height, 16..=64);
            name = name;
        }
        Ok((width, height, name))
    }

    #[test]
    fn every_wrong_field_is_named_once() {
        assert_eq!(checked(20, 30, Ok("lab".into())).unwrap(), (20, 30, "lab".into()));
        let one = checked(2, 30, Ok("lab".into())).unwrap_err();
        assert_eq!(one.to_string(), "width is 2, but must be 16 to 64");
        let missing = || Field::new("name").missing("displays/lab", "create it first");
        let all = checked(2, 99, Err(missing())).unwrap_err().to_string();
        assert_eq!(
            all,
            "3 fields of the request are wrong:\n  width is 2, but must be 16 to 64\n  height is 99, but must be 16 to \
             64\n  name names displays/lab, which does not exist; create it first"
        );
        let nested = all_of([checked(2, 99, Ok(String::new())).unwrap_err(), missing(), missing()]).to_string();
        assert!(nested.starts_with("3 fields"), "{nested}");
    }

    #[test]
    fn fields_of_a_part_are_named_with_the_part() {
        let part = Field::new("requests").index(3);
        let wrong = within(
            &part,
            checked(2, 99, Err(Field::new("name").missing("displays/lab", "create it first"))).unwrap_err(),
        );
        let text = wrong.to_string();
        assert!(
            text.contains("requests[3].width is 2") && text.contains("requests[3].name names displays/lab"),
            "{text}"
        );
    }

    #[test]
    fn an_error_that_is_not_about_a_field_stands_for_all() {
        let denied = checked(2, 99, Err(ServiceError::Denied("no".into()))).unwrap_err();
        assert!(matches!(denied, ServiceError::Denied(_)));
    }

    #[test]
    fn the_present_state_counts_only_without_wrong_fields() {
        let state = || ServiceError::Precondition {
            reason: lightpath_domain::reason::PreconditionReason::DatasetOpen,
            message: "is open".into(),
        };
        let wrong = all_of([state(), Field::new("epochs").but("is 5000", "must be 9")]);
        assert_eq!(wrong.to_string(), "epochs is 5000, but must be 9");
        assert_eq!(all_of([state(), state()]).to_string(), "is open");
    }

    #[test]
    fn long_lists_of_wrong_fields_are_cut() {
        let field = Field::new("x");
        let wrong = (0..100).map(|i| field.index(i).number(2.0, 0.0..=1.0));
        let text = collect_all(wrong).unwrap_err().to_string();
        assert!(text.starts_with("100 fields") && text.ends_with("and 88 more"), "{text}");
        assert_eq!(collect_all((0..3).map(|i| field.number(f64::from(i), 0.0..=9.0))).unwrap(), [0.0, 1.0, 2.0]);
    }
}
