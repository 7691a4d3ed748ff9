//! Requests that may be repeated after a lost answer: their ids, and by what the server knows them again.

use lightpath_artifacts::digest_of;
use lightpath_service::{Call, Field, Result};
use lightpath_store::RequestMark;
use prost::Message;

/// Limit on the length of a request id \[bytes\]: a UUID and a few words.
const REQUEST_ID_BYTES_MAX: usize = 128;

/// Checks the id of a request; `None` if it is empty.
pub(crate) fn request_id(given: String) -> Result<Option<String>> {
    let field = Field::new("request_id");
    if given.chars().any(char::is_control) {
        return Err(field.but("contains control characters", "must be plain text"));
    }
    let given = field.text(given, REQUEST_ID_BYTES_MAX)?;
    Ok((!given.is_empty()).then_some(given))
}

/// By what the same request of the method is known again; `None` if it has no id.
pub(crate) fn mark(call: &Call, method: &str, request: &impl Message, id: &str) -> Result<Option<RequestMark>> {
    let Some(request_id) = request_id(id.to_owned())? else { return Ok(None) };
    let content = format!("{method} {}", digest_of(&request.encode_to_vec()));
    Ok(Some(RequestMark { caller: call.caller.name.clone(), request_id, content }))
}
