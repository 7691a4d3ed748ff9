//! Who makes the call that is being handled, and which displays it may be about.
//!
//! The gate in front of the handlers has checked the role; what a call is about only its handler knows. The caller is kept
//! beside the handler's task, so that the functions that read names can check them, and none is forgotten.

use super::error::ApiError;
use lightpath_domain::access::{Caller, Role};
use std::future::Future;

tokio::task_local! {
    static CALLER: Caller;
}

/// Handles a call for `caller`.
pub(crate) async fn handle_for<F: Future>(caller: Caller, handling: F) -> F::Output {
    CALLER.scope(caller, handling).await
}

/// The call may be about this display.
///
/// # Errors
///
/// [`ApiError::Denied`].
pub(super) fn require_display(id: &str) -> Result<(), ApiError> {
    let denied = |caller: &Caller| match caller.may_use(id) {
        true => Ok(()),
        false => Err(ApiError::Denied(format!(
            "the token \"{}\" is for other displays than displays/{id}; ask for one that names it",
            caller.name
        ))),
    };
    // Outside of a call, in the server's own tests of the API, nobody is kept from anything.
    CALLER.try_with(denied).unwrap_or(Ok(()))
}

/// The call may be about all displays at once.
///
/// # Errors
///
/// [`ApiError::Denied`].
pub(super) fn require_all_displays(field: &str) -> Result<(), ApiError> {
    let denied = |caller: &Caller| match caller.displays.first() {
        None => Ok(()),
        Some(own) => Err(ApiError::Denied(format!(
            "the token \"{}\" is not for all displays; set {field} to one of its own, such as displays/{own}",
            caller.name
        ))),
    };
    CALLER.try_with(denied).unwrap_or(Ok(()))
}

/// Whether the caller may hear of this display.
pub(super) fn may_see(id: &str) -> bool {
    CALLER.try_with(|caller| caller.may_use(id)).unwrap_or(true)
}

/// The caller's name; empty where nobody has to say who calls.
pub(super) fn name() -> String {
    CALLER.try_with(|caller| caller.name.clone()).unwrap_or_default()
}

/// The caller, where it is not for all displays.
pub(super) fn scoped() -> Option<Caller> {
    CALLER.try_with(|caller| (!caller.displays.is_empty()).then(|| caller.clone())).ok().flatten()
}

/// Whose turn a job takes: the caller's own, unless nobody has to say who calls.
///
/// # Errors
///
/// [`ApiError::Denied`] for somebody else's name.
pub(super) fn owner(given: String) -> Result<String, ApiError> {
    let own = |caller: &Caller| match (caller.name.as_str(), caller.role) {
        ("", _) => Ok(given.clone()),
        (name, _) if given.is_empty() => Ok(name.to_owned()),
        (name, role) if given == name || role == Role::Admin => Ok(given.clone()),
        (name, _) => Err(ApiError::Denied(format!(
            "owner is {given:?}, but the token \"{name}\" takes turns of its own only; leave owner empty"
        ))),
    };
    CALLER.try_with(own).unwrap_or_else(|_| Ok(given.clone()))
}
