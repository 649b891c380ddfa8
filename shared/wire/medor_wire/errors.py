"""The error tree: what may cross the wire, from general to specific.

    MedorError
    ├── BadRequest                the asker is wrong; the same question again gets the same answer
    │   ├── NoGarment             nothing that looks like cloth in view
    │   ├── SeveralGarments       more than one garment in view
    │   ├── OutOfReach            the arm cannot get there, or the place is out of view
    │   ├── NotFound              unknown id
    │   └── IdReused              an id seen before, with other content
    ├── Refused                   well formed, but not now and not by you
    │   ├── LeaseHeld             somebody else holds the robot
    │   ├── LeaseLost             the fencing epoch is not the current one
    │   └── EmergencyStopped      the e-stop is latched
    ├── ReconstructionFailed      the garment was seen, its mesh cannot be trusted
    ├── OutcomeUnknown            an action may or may not have happened; look again before acting
    ├── Cancelled                 the asker cancelled
    ├── Unavailable               nobody answered; a read may be asked again
    │   ├── Busy                  admission control turned the request away
    │   └── Timeout               the deadline passed
    ├── BadFrame                  bytes that are not a valid Medor frame
    │   └── BadVersion            a frame of another major version
    └── InternalError             a defect in the server; the traceback is in its log

An error crosses the wire as `code` and text and is raised again as the same class on the other side.
"""


class MedorError(Exception):
    """Anything Medor reports on purpose."""

    code: str = "error"
    retry: bool = False
    """Whether asking the same again may succeed."""
    reported: bool = False
    """Whether a peer answered with this error; else nobody answered, or it arose here."""


class BadRequest(MedorError):
    code = "bad_request"


class NoGarment(BadRequest):
    code = "no_garment"


class SeveralGarments(BadRequest):
    code = "several_garments"


class OutOfReach(BadRequest):
    code = "out_of_reach"


class NotFound(BadRequest):
    code = "not_found"


class IdReused(BadRequest):
    code = "id_reused"


class Refused(MedorError):
    code = "refused"


class LeaseHeld(Refused):
    code = "lease_held"
    retry = True


class LeaseLost(Refused):
    code = "lease_lost"


class EmergencyStopped(Refused):
    code = "emergency_stopped"


class ReconstructionFailed(MedorError):
    code = "reconstruction_failed"


class OutcomeUnknown(MedorError):
    code = "outcome_unknown"


class Cancelled(MedorError):
    code = "cancelled"


class Unavailable(MedorError):
    code = "unavailable"
    retry = True


class Busy(Unavailable):
    code = "busy"


class Timeout(Unavailable):
    code = "timeout"


class BadFrame(MedorError):
    code = "bad_frame"


class BadVersion(BadFrame):
    code = "bad_version"


class InternalError(MedorError):
    code = "internal"


def every_error(root: type[MedorError] = MedorError) -> dict[str, type[MedorError]]:
    """All error classes by code."""
    found = {root.code: root}
    for child in root.__subclasses__():
        found |= every_error(child)
    return found


def error_from(code: str, message: str) -> MedorError:
    """The error a peer reported, as the class of its code (`InternalError` for unknown codes)."""
    error = every_error().get(code, InternalError)(message)
    error.reported = True
    return error
