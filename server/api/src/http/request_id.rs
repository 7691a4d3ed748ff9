//! The id of a request, by which its log and its refusal are found.

/// Id of a request, in its extensions.
#[derive(Clone, Debug, Default)]
pub(super) struct RequestId(pub(super) String);
