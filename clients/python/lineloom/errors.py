"""What can go wrong, as types.

LineloomError
├── ConnectionFailedError       no answer, and the retries are used up
├── ProblemError                the service said no (RFC 9457); has status, type, detail, errors
│   ├── InvalidRequestError     400, 413, 415, 422: sending the same again cannot help
│   ├── AccessDeniedError       401, 403
│   ├── NotFoundError           404
│   ├── ConflictError           409, e.g. two robots that are not connected yet
│   ├── BusyError               429: the site's backlog is full; has retry_after
│   ├── TooSlowError            408: the request did not come through in time
│   └── ServiceFailedError      5xx
├── UnexpectedAnswerError       an answer that is not of the contract: is it Lineloom at all?
├── InvalidScanError            a scan that cannot be sent (also a ValueError)
├── NotIdleError                the wait for the map, or for the service, took too long
└── OutboxError
    ├── OutboxFullError         the bound is reached and the policy is to refuse
    └── SequenceError           another scan has this session and seq already
"""

from __future__ import annotations

from http import HTTPStatus

from lineloom.wire import FieldError, Problem


class LineloomError(Exception):
    """Everything this package raises on purpose."""


class ConnectionFailedError(LineloomError):
    """The service could not be reached, or broke off."""

    def __init__(self, url: str, reason: str, attempts: int) -> None:
        tries = "" if attempts == 1 else f" ({attempts} attempts)"
        super().__init__(f"no answer from {url}: {reason}{tries}")
        self.url = url
        self.reason = reason
        self.attempts = attempts


class ProblemError(LineloomError):
    """The service's own words on why it refused. `type` is stable and names the kind."""

    def __init__(self, problem: Problem, retry_after: float | None = None) -> None:
        super().__init__(_sentence(problem))
        self.status = problem.status
        self.type = problem.type
        self.title = problem.title
        self.detail = problem.detail
        self.errors: list[FieldError] = problem.errors
        self.retry_after = retry_after


class InvalidRequestError(ProblemError):
    """The request is malformed or too large: sending the same again cannot help."""


class AccessDeniedError(ProblemError):
    """No token, a wrong one, or one without the scope."""


class NotFoundError(ProblemError):
    """No such site, robot, component or constraint."""


class ConflictError(ProblemError):
    """The request is right, the state of the map is not, e.g. `not-connected`."""


class BusyError(ProblemError):
    """The site's backlog is over its limit; nothing was taken. See `retry_after` [s]."""


class TooSlowError(ProblemError):
    """The request came too slowly and nothing of it was taken: the link, not what was sent."""


class ServiceFailedError(ProblemError):
    """The service, or a proxy before it, failed."""


class UnexpectedAnswerError(LineloomError):
    """An answer that is not of the contract."""


class InvalidScanError(LineloomError, ValueError):
    """A scan that cannot be sent. `field` names what is wrong, `reason` says why."""

    def __init__(self, field: str, reason: str) -> None:
        super().__init__(f"{field}: {reason}")
        self.field = field
        self.reason = reason


class NotIdleError(LineloomError, TimeoutError):
    """The wait took longer than its timeout. `pending`: scans not yet in the map."""

    def __init__(self, message: str, pending: int = 0) -> None:
        super().__init__(message)
        self.pending = pending


class OutboxError(LineloomError):
    """The queue on disk cannot do what was asked."""


class OutboxFullError(OutboxError):
    """The bound is reached and the policy is to refuse."""


class SequenceError(OutboxError):
    """Another scan has this session and seq already: it would be lost as a duplicate."""


def problem_error(problem: Problem, retry_after: float | None = None) -> ProblemError:
    """Return the error class that fits the problem's status."""
    kinds: dict[int, type[ProblemError]] = {
        HTTPStatus.UNAUTHORIZED: AccessDeniedError,
        HTTPStatus.FORBIDDEN: AccessDeniedError,
        HTTPStatus.NOT_FOUND: NotFoundError,
        HTTPStatus.REQUEST_TIMEOUT: TooSlowError,
        HTTPStatus.CONFLICT: ConflictError,
        HTTPStatus.TOO_MANY_REQUESTS: BusyError,
    }
    kind = kinds.get(problem.status)
    if kind is None:
        kind = ServiceFailedError if problem.status >= 500 else InvalidRequestError
    return kind(problem, retry_after)


def _sentence(problem: Problem) -> str:
    text = f"{problem.title} ({problem.status})"
    if problem.detail and problem.detail != problem.title:
        text += f": {problem.detail}"
    for error in problem.errors[:3]:
        text += f"; {error.pointer}: {error.reason}"
    if len(problem.errors) > 3:
        text += f"; and {len(problem.errors) - 3} more"
    return text
