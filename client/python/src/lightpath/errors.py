"""What can go wrong, as exceptions that say which field, why, and what to do.

Every exception of this package is a `LightpathError`. Those that Python has a word for are also a `ValueError`,
`LookupError`, `PermissionError` or `ConnectionError`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

from google.rpc import error_details_pb2, status_pb2

from lightpath.argument_names import argument, in_text

if TYPE_CHECKING:
    from collections.abc import Iterable

    import grpc


class LightpathError(Exception):
    """An error of this package. Attributes that an error does not have are empty.

    - `field`: the argument, such as `distance` or `pixel_pitch`
    - `reason`: a stable word for programs, such as `INVALID_FIELD` or `QUEUE_FULL`
    - `fix`: what to do, for people
    """

    field: str = ""
    reason: str = ""
    fix: str = ""


class InvalidArgument(LightpathError, ValueError):
    """An argument that this package refuses before it asks the server."""

    reason = "INVALID_ARGUMENT"

    def __init__(self, field: str, problem: str, fix: str) -> None:
        super().__init__(f"{field} {problem}: {fix}")
        self.field, self.fix = field, fix


class MissingKernel(InvalidArgument, LookupError):
    """The display has no kernel at this distance and wavelength."""

    reason = "NOT_FOUND"


class Unreachable(LightpathError, ConnectionError):
    """No server answered, the connection was lost, or the server is stopping. The call may succeed later."""

    reason = "UNREACHABLE"

    def __init__(self, url: str, cause: str, retry_after_s: float | None = None) -> None:
        if "CERTIFICATE_VERIFY_FAILED" in cause:
            self.fix = "give the certificate of the authority that signed the server's: ca_file, or LIGHTPATH_CA_FILE"
        else:
            self.fix = 'start it with `lightpathd serve`, or give another address: lightpath.connect("http://lab:7070")'
        super().__init__(f"server {url} could not be reached ({cause}); {self.fix}")
        self.url, self.cause, self.retry_after_s = url, cause, retry_after_s


@dataclass(frozen=True)
class FieldViolation:
    """A wrong argument: its name, what is wrong with it, and what to do."""

    field: str
    problem: str
    fix: str
    path: str = ""
    """The field of the request in the API that the argument became."""


class Refused(LightpathError):
    """The server refused a call.

    - `code`: the code of gRPC, such as `INVALID_ARGUMENT`
    - `message`: the server's text, with the names of the API
    - `fields`: all wrong arguments, each with its problem and its fix
    - `retry_after_s`: time after which the call may succeed [s], if the server gave one
    """

    def __init__(self, status: ServerStatus) -> None:
        self.code, self.message, self.reason = status.code, status.message, status.reason
        self.fields, self.retry_after_s = status.fields, status.retry_after_s
        self.field = status.fields[0].field if status.fields else status.subject
        self.fix = _fix(status)
        super().__init__(self._text())

    def _text(self) -> str:
        # The message about several fields has a line for each of them.
        first, *others = in_text(self.message).split("\n")
        lines = [f"{first} ({self.reason or self.code})", *(each.strip() for each in others)]
        # What the message has already is not repeated.
        unsaid = [wrong for wrong in self.fields if wrong.path not in self.message]
        lines += [f"{wrong.field}: {wrong.problem}" for wrong in unsaid]
        # The messages of Lightpath say what to do. Those of a proxy between do not.
        if not self.reason:
            lines.append(self.fix)
        return "\n  ".join(lines)


class InvalidRequest(Refused, ValueError):
    """A field of the request has a value that is not allowed."""


class NotFound(Refused, LookupError):
    """A display, dataset, kernel, job or artifact does not exist, or the token may not see it."""


class AlreadyExists(Refused):
    """Something else has this name already."""


class PreconditionFailed(Refused):
    """The present state does not allow the call, such as learning from an open dataset."""


class NotAllowed(Refused, PermissionError):
    """The token is missing, is not accepted, or has a role that may not make the call."""


class Exhausted(Refused):
    """A limit is reached: of the queue, the disk, the owner or the calls."""


class Aborted(Refused):
    """Somebody else changed the same thing at the same time."""


class Damaged(LightpathError):
    """Bytes do not match their digest."""

    reason = "DAMAGED"
    fix = "try again; if that does not help, run `lightpathd check` on the server"


class InvalidSignature(LightpathError, PermissionError):
    """A message to a webhook's receiver was not signed by the server, or is too old. Answer it with the status 403."""

    field = "webhook-signature"
    reason = "INVALID_SIGNATURE"

    def __init__(self, problem: str, fix: str) -> None:
        super().__init__(f"the message is not genuine: {problem}; {fix}")
        self.fix = fix


class ProtocolError(LightpathError):
    """The server's answer breaks the rules of the API."""

    reason = "PROTOCOL"
    fix = "use a client and a server of the same version"

    def __init__(self, what: str) -> None:
        super().__init__(f"the server's answer is invalid: {what}; {self.fix}")


class JobUnsuccessful(LightpathError):
    """A job has no result, because it failed, was cancelled, or has not ended. `job` is its name."""

    def __init__(self, job: str, ending: str, reason: str, fix: str) -> None:
        super().__init__(f"{job} {ending}; {fix}")
        self.job, self.reason, self.fix = job, reason, fix


class WaitInterrupted(KeyboardInterrupt):
    """The user interrupted the waiting for a job. The job goes on; `job` is its name."""

    def __init__(self, job: str) -> None:
        self.job = job
        super().__init__(
            f'{job} goes on on the server. Fetch its result later: lab.job("{job}").result(). '
            f'Cancel it: lab.job("{job}").cancel()'
        )


@dataclass(frozen=True)
class ServerStatus:
    """The parts of a failed call's status."""

    code: str
    message: str
    reason: str = ""
    subject: str = ""
    fields: tuple[FieldViolation, ...] = ()
    retry_after_s: float | None = None
    fix: str = ""


_CLASSES: dict[str, type[Refused]] = {
    "INVALID_ARGUMENT": InvalidRequest,
    "OUT_OF_RANGE": InvalidRequest,
    "NOT_FOUND": NotFound,
    "ALREADY_EXISTS": AlreadyExists,
    "FAILED_PRECONDITION": PreconditionFailed,
    "PERMISSION_DENIED": NotAllowed,
    "UNAUTHENTICATED": NotAllowed,
    "RESOURCE_EXHAUSTED": Exhausted,
    "ABORTED": Aborted,
}

_FIXES = {
    "UNAUTHENTICATED": "give a token: lightpath.connect(token_file=...), or set LIGHTPATH_TOKEN",
    "PERMISSION_DENIED": "ask the operator for a token with a role that may do this",
    "NOT_FOUND": "check the name",
    "ALREADY_EXISTS": "choose another name, or use what exists",
    "ABORTED": "look at the present state, and try again",
    "DEADLINE_EXCEEDED": "try again",
    "INTERNAL": "report the id in the message to the operator",
}


def from_rpc_error(url: str, error: grpc.RpcError) -> LightpathError:
    """Return the exception for a failed call."""
    status = _status(error)
    if _is_unreachable(status):
        return Unreachable(url, status.message or status.code, status.retry_after_s)
    return _CLASSES.get(status.code, Refused)(status)


def _status(error: grpc.RpcError) -> ServerStatus:
    code, message = error.code().name, error.details() or ""
    details = status_pb2.Status()
    for key, value in _metadata(error):
        if key == "grpc-status-details-bin":
            details.ParseFromString(value)
    info, wrong, retry, fix = (
        error_details_pb2.ErrorInfo(),
        error_details_pb2.BadRequest(),
        error_details_pb2.RetryInfo(),
        error_details_pb2.LocalizedMessage(),
    )
    retry_after_s = None
    for detail in details.details:
        detail.Unpack(info)
        detail.Unpack(wrong)
        detail.Unpack(fix)
        if detail.Unpack(retry):
            retry_after_s = retry.retry_delay.seconds + retry.retry_delay.nanos * 1e-9
    fields = tuple(
        FieldViolation(
            argument(each.field), in_text(each.description), in_text(each.localized_message.message), each.field
        )
        for each in wrong.field_violations
    )
    subject = info.metadata.get("field", "") or info.metadata.get("resource", "")
    return ServerStatus(code, message, info.reason, subject, fields, retry_after_s, fix.message)


def _metadata(error: grpc.RpcError) -> Iterable[tuple[str, bytes]]:
    # The stubs of gRPC lack the type of this answer.
    return cast("Iterable[tuple[str, bytes]]", error.trailing_metadata() or ())


def _is_unreachable(status: ServerStatus) -> bool:
    # A connection that breaks in the middle of a stream has other codes, and no reason of the server.
    broken = status.code in {"UNKNOWN", "INTERNAL", "CANCELLED"} and not status.reason
    return status.code == "UNAVAILABLE" or broken


def _fix(status: ServerStatus) -> str:
    """Return what to do: what the server says, or what helps against errors that others report with the same code."""
    if len(status.fields) > 1:
        return "\n".join(f"{wrong.field}: {wrong.fix}" for wrong in status.fields)
    fix = status.fields[0].fix if status.fields else status.fix
    if fix:
        return fix
    if status.retry_after_s is not None:
        return f"try again in {status.retry_after_s:.0f} s"
    return _FIXES.get(status.code, "ask the operator of the server")
