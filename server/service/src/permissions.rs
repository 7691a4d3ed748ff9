//! Permissions of callers: the displays that a caller may use, the owners for whom a caller may submit jobs, and before
//! whose jobs.
//!
//! Admission has checked the role of the caller. Only the handler knows the display of a call, and passes the caller to
//! these functions.

use crate::call::Call;
use crate::error::{Result, ServiceError};
use crate::field::{Field, shortened};
use lightpath_domain::access::Role;

const PRIORITY_MAX: i32 = 100;

/// Refuses a caller whose token is for other displays.
///
/// # Errors
///
/// [`ServiceError::Denied`].
pub fn require_display(call: &Call, id: &str) -> Result<()> {
    if call.caller.may_use(id) {
        return Ok(());
    }
    Err(ServiceError::Denied(format!(
        "the token \"{}\" is not valid for displays/{id}; ask an admin for one that is",
        call.caller.name
    )))
}

/// Refuses a caller whose token is for some displays only, if a call concerns all displays. `field` is the field that
/// can limit the call to one display.
///
/// # Errors
///
/// [`ServiceError::Denied`].
pub fn require_all_displays(call: &Call, field: &str) -> Result<()> {
    match call.caller.displays.first() {
        None => Ok(()),
        Some(own) => Err(ServiceError::Denied(format!(
            "the token \"{}\" is not valid for all displays; set {field} to one of its displays, such as displays/{own}",
            call.caller.name
        ))),
    }
}

/// The device that a call is about: `given`, or the device of the caller's token if `given` is empty. A token of the
/// role firmware stands for the device of its own name, so that no device can speak for another one.
///
/// # Errors
///
/// [`ServiceError::Denied`] if `given` is another device than that of the token.
pub fn device_of(call: &Call, given: &str) -> Result<Option<String>> {
    match (call.caller.role, call.caller.name.as_str()) {
        (Role::Firmware, name) if given.is_empty() || given == name => Ok(Some(name.to_owned())),
        (Role::Firmware, name) => Err(ServiceError::Denied(format!(
            "the token \"{name}\" stands for the device {name}, and not for {:?}; use the token of that device",
            shortened(given)
        ))),
        (_, _) => Ok((!given.is_empty()).then(|| given.to_owned())),
    }
}

/// The owner of a job: `given`, or the caller's name if `given` is empty. Without tokens callers have no names, and any
/// owner may be given.
///
/// # Errors
///
/// [`ServiceError::Denied`] if `given` is not the caller's name, unless the caller is an admin for all displays: other
/// owners have jobs and limits that concern other displays.
pub fn owner_of_job(call: &Call, given: String) -> Result<String> {
    match (call.caller.name.as_str(), call.caller.role) {
        ("", _) => Ok(given),
        (name, _) if given.is_empty() => Ok(name.to_owned()),
        (name, _) if given == name => Ok(given),
        (_, Role::Admin) if call.caller.displays.is_empty() => Ok(given),
        (name, _) => Err(ServiceError::Denied(format!(
            "owner is {given:?}, but jobs of the token \"{name}\" must have its name as their owner; leave owner empty"
        ))),
    }
}

/// The priority of a job. Only curators and admins may let a job overtake those of others.
///
/// # Errors
///
/// [`ServiceError::Denied`]; [`ServiceError::Invalid`] if the number is too small or too large.
pub fn priority_of_job(call: &Call, given: i32) -> Result<i32> {
    let field = Field::new("priority");
    let priority = field.integer(given, -PRIORITY_MAX..=PRIORITY_MAX)?;
    if priority >= 0 || matches!(call.caller.role, Role::Curator | Role::Admin) {
        return Ok(priority);
    }
    Err(ServiceError::Denied(format!(
        "{field} is {priority}, but a job before those of others needs a token with the role curator or admin; use 0 to \
         {PRIORITY_MAX}"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightpath_domain::access::Caller;

    fn ada(role: Role) -> Call {
        ada_for(role, &["lab"])
    }

    fn ada_for(role: Role, displays: &[&str]) -> Call {
        let displays = displays.iter().map(|display| (*display).to_owned()).collect();
        Call::new(Caller { name: "ada".to_owned(), role, displays }, None)
    }

    #[test]
    fn token_is_valid_for_its_displays_only() {
        assert!(require_display(&ada(Role::Submitter), "lab").is_ok());
        assert!(matches!(require_display(&ada(Role::Submitter), "other"), Err(ServiceError::Denied(_))));
        assert!(require_display(&Call::without_token(), "other").is_ok());
        let refusal = require_all_displays(&ada(Role::Submitter), "display").unwrap_err().to_string();
        assert!(refusal.contains("set display to one of its displays, such as displays/lab"), "{refusal}");
        assert!(require_all_displays(&Call::without_token(), "display").is_ok());
    }

    #[test]
    fn firmware_speaks_for_its_own_device() {
        for given in ["", "ada"] {
            assert_eq!(device_of(&ada(Role::Firmware), given).unwrap().as_deref(), Some("ada"));
        }
        assert!(matches!(device_of(&ada(Role::Firmware), "bob"), Err(ServiceError::Denied(_))));
        assert_eq!(device_of(&ada(Role::Curator), "bob").unwrap().as_deref(), Some("bob"));
        assert_eq!(device_of(&Call::without_token(), "").unwrap(), None);
    }

    #[test]
    fn only_admins_for_all_displays_submit_for_other_owners() {
        for (call, given, owner) in [
            (ada(Role::Submitter), "", Some("ada")),
            (ada(Role::Submitter), "ada", Some("ada")),
            (ada_for(Role::Submitter, &[]), "bob", None),
            (ada(Role::Admin), "ada", Some("ada")),
            (ada(Role::Admin), "bob", None),
            (ada_for(Role::Admin, &[]), "bob", Some("bob")),
        ] {
            assert_eq!(owner_of_job(&call, given.to_owned()).ok().as_deref(), owner, "{given}");
        }
        assert_eq!(owner_of_job(&Call::without_token(), "bob".to_owned()).unwrap(), "bob");
    }

    #[test]
    fn only_curators_and_admins_let_a_job_overtake_others() {
        for role in [Role::Submitter, Role::Curator, Role::Admin] {
            for priority in [0, 1, PRIORITY_MAX] {
                assert_eq!(priority_of_job(&ada(role), priority).unwrap(), priority, "{role:?}");
            }
            for priority in [-PRIORITY_MAX - 1, PRIORITY_MAX + 1] {
                assert!(
                    matches!(priority_of_job(&ada(role), priority), Err(ServiceError::Invalid { .. })),
                    "{priority}"
                );
            }
        }
        for priority in [-1, -PRIORITY_MAX] {
            assert!(matches!(priority_of_job(&ada(Role::Submitter), priority), Err(ServiceError::Denied(_))));
            for role in [Role::Curator, Role::Admin] {
                assert_eq!(priority_of_job(&ada(role), priority).unwrap(), priority, "{role:?}");
            }
        }
    }
}
