"""Every exception of axisbus, as one tree.

::

    AxisbusError
    ├── UserError                    impossible configuration or request; nothing was sent
    │   ├── ArgumentError            a value of a call: NaN, infinity, wrong type, missing default (also ValueError)
    │   │   └── LimitError           a value beyond a limit of the axis or beyond the object's type
    │   ├── StateError               not possible in the present state of the axis or machine
    │   │   ├── OwnershipError       another program has control of the machine
    │   │   ├── NodeStateError       the axis's node is lost, has restarted, or is not operational
    │   │   └── UnknownNameError     the cell has no axis, group, pair, node, input or output of this name
    │   ├── PlatformError            needs something that this operating system does not have
    │   ├── ConfigError              cell.toml, with file and line
    │   └── EdsError                 an EDS or DCF that cannot be used, with file and line
    ├── BusError                     the adapter, the wire or a node's communication
    │   ├── AdapterError             the CAN adapter cannot be opened, refuses to send, or stopped receiving
    │   │   ├── BusOff               its controller has left the bus; it may come back
    │   │   └── TransmitQueueFull    it accepts no frames at present
    │   ├── SecondMasterError        another master, or a tool that acts as one, was heard before our first frame
    │   ├── NodeError                a node: no answer, lost, rebooted
    │   │   ├── DuplicateNodeError   ... two devices have its node-ID
    │   │   └── NodeTimeout          (also TimeoutError)
    │   │       └── NodeRefused      it is present, and does not enter the commanded NMT state
    │   ├── SdoError                 an SDO transfer that failed
    │   │   ├── SdoAbort             the drive refused it and gave the reason
    │   │   └── SdoTimeout           no answer (also TimeoutError)
    │   ├── LssError                 a layer setting service (CiA 305) that failed, or several slaves answered instead of one
    │   │   ├── LssRefused           the slave refused it and gave the reason
    │   │   └── LssTimeout           no answer (also TimeoutError)
    │   ├── BootError                a node that could not be brought up, with step and object
    │   ├── SyncError                the SYNC of another producer is missing, or has another period
    │   └── ScanError                the cyclic scan ended
    ├── DriveError                   the drive answers, but not as requested
    │   ├── DriveFault               it reports a fault (CiA 402 state Fault)
    │   ├── TransitionError          it does not follow the controlword (also TimeoutError)
    │   ├── ModeError                it does not enter the mode of operation
    │   ├── SetPointError            it does not accept the set-point
    │   ├── MotionTimeout            it does not arrive in time (also TimeoutError)
    │   ├── FollowingError           the axis is too far from its commanded position
    │   ├── SkewError                the skew of a gantry pair is too large
    │   ├── UncommandedMotion        it moves, or is pulled, while no command runs
    │   ├── HomingError              homing failed
    │   ├── ProbeError               a touch probe is not armed as requested, or a move until an edge has seen none
    │   └── StaleError               a value that the command needs is too old or was never received
    ├── SignalTimeout                an input or output did not get the expected value in time (also TimeoutError)
    ├── CommandError                 a command failed internally: by an exception (__cause__), or without the data that it needs
    └── Interrupted                  the command ended because of another one
        ├── Replaced                 a newer command on the same axis took over
        └── Stopped                  a stop took over: requested, by the fault policy, or at the end of the program

Every error has three plain texts: ``message`` (the request and the result, naming the object), ``observed`` (the observation) and
``remedy`` (the first thing to do). Printing an error shows all three, and below them its notes: further failures, such as a stop
that could not be confirmed. A traceback and the command line also name the ``page`` of its symptom. If an error becomes part of
another text, ``alarm_of`` keeps its warning that an axis may move.
"""

from __future__ import annotations

import re

from axisbus.symptoms.lookup import page_of

__all__ = [
    "AdapterError",
    "ArgumentError",
    "AxisbusError",
    "BootError",
    "BusError",
    "BusOff",
    "CommandError",
    "ConfigError",
    "DriveError",
    "DriveFault",
    "DuplicateNodeError",
    "EdsError",
    "FollowingError",
    "HomingError",
    "Interrupted",
    "LimitError",
    "LssError",
    "LssRefused",
    "LssTimeout",
    "ModeError",
    "MotionTimeout",
    "NodeError",
    "NodeRefused",
    "NodeStateError",
    "NodeTimeout",
    "OwnershipError",
    "PlatformError",
    "ProbeError",
    "Replaced",
    "ScanError",
    "SdoAbort",
    "SdoError",
    "SdoTimeout",
    "SecondMasterError",
    "SetPointError",
    "SignalTimeout",
    "SkewError",
    "StaleError",
    "StateError",
    "Stopped",
    "SyncError",
    "TransitionError",
    "TransmitQueueFull",
    "UncommandedMotion",
    "UnknownNameError",
    "UserError",
]


_ALARM = re.compile(r"TREAT [^\n;]* AS [A-Z]{2,}[^\n;]*")


class AxisbusError(Exception):
    """Base of all; ``message``, ``observed`` and ``remedy`` are plain texts, empty if there is nothing to say."""

    def __init__(self, message: str, *, observed: str = "", remedy: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.observed = observed
        self.remedy = remedy

    @property
    def page(self) -> str:
        """The name of its symptom's page, which ``axisbus explain`` prints: by its class, and by its code if it has one."""
        return page_of(self)

    def __str__(self) -> str:
        lines = [self.message]
        if self.observed:
            lines.append(f"  observed: {self.observed}")
        if self.remedy:
            lines.append(f"  remedy:   {self.remedy}")
        return "\n".join([*lines, *added_notes(self)])

    @property
    def __notes__(self) -> list[str]:  # type: ignore[override]  # never stored: made for each traceback, by the codes then known
        """The lines that a traceback prints below the text of the error: the line that names the page."""
        return [help_line(self)]

    def add_note(self, note: str, /) -> None:
        """Add a line that is printed below the texts; ``added_notes`` returns these lines."""
        self.__dict__["__notes__"] = [*added_notes(self), note]

    def __reduce__(self) -> tuple[object, ...]:
        return _rebuild, (type(self), self.__dict__.copy())


def _rebuild(cls: type[AxisbusError], fields: dict[str, object]) -> AxisbusError:
    error = cls.__new__(cls, fields["message"])
    error.__dict__.update(fields)
    return error


class UserError(AxisbusError):
    """An impossible configuration or request; nothing was sent."""


class ArgumentError(UserError, ValueError):
    """A value given to a call cannot be used."""


class LimitError(ArgumentError):
    """A value is beyond a limit of the axis, or out of the range of the object's data type."""


class StateError(UserError):
    """The state of the axis or machine does not allow the request."""


class OwnershipError(StateError):
    """Another program has control of the machine; this one may read values, and stop it."""


class NodeStateError(StateError):
    """The node of the axis is lost, has restarted, or is not operational; the remedy says how to bring it back."""


class UnknownNameError(StateError):
    """The cell has no axis, group, gantry, node, input or output of this name; ``observed`` lists the existing ones."""


class PlatformError(UserError):
    """The request needs something that this operating system does not have; the remedy says what works instead."""


class ConfigError(UserError):
    """A cell file is wrong; ``file`` and ``line`` (from 1, 0 if unknown) are the location."""

    def __init__(
        self, message: str, *, file: str = "", line: int = 0, observed: str = "", remedy: str = ""
    ) -> None:
        where = f"{file}:{line}: " if file and line else f"{file}: " if file else ""
        super().__init__(where + message, observed=observed, remedy=remedy)
        self.file = file
        self.line = line


class EdsError(ConfigError):
    """An EDS or DCF file cannot be used; ``file`` and ``line`` are the location."""


class BusError(AxisbusError):
    """The adapter, the wire, or a node's communication failed."""


class AdapterError(BusError):
    """The CAN adapter cannot be opened, refuses to send, or has stopped receiving."""


class BusOff(AdapterError):
    """The CAN controller is bus-off (ISO 11898-1): nothing is sent or received until it is restarted."""


class TransmitQueueFull(AdapterError):
    """The CAN adapter accepts no frames at present: its transmit queue is full, or its driver refuses them for another reason."""


class SecondMasterError(BusError):
    """Another master, or a tool that acts as one, is on the bus. ``heard`` lists the signs of it, as text.

    If the error came before the first frame of a machine, nothing was sent. Later, the axes that the other master commands were
    stopped.
    """

    def __init__(
        self, message: str, *, heard: tuple[str, ...] = (), observed: str = "", remedy: str = ""
    ) -> None:
        super().__init__(message, observed=observed, remedy=remedy)
        self.heard = heard


class NodeError(BusError):
    """A node is silent, lost or restarted; ``node`` is its node-ID (1 to 127)."""

    def __init__(self, message: str, *, node: int, observed: str = "", remedy: str = "") -> None:
        super().__init__(message, observed=observed, remedy=remedy)
        self.node = node


class NodeTimeout(NodeError, TimeoutError):
    """A node did not answer in time."""


class NodeRefused(NodeTimeout):
    """A node is present and reports an NMT state other than the commanded one; repeating the command is of no use."""


class DuplicateNodeError(NodeError):
    """Two devices on the bus have the same node-ID; ``node`` is that ID."""


class SdoError(BusError):
    """An SDO transfer failed; ``node``, ``index`` and ``subindex`` name the object.

    ``for_this_only``: the node serves other objects. It has refused this one, or was silent for it only: some drives are silent for
    an object that they do not have.
    """

    for_this_only = False

    def __init__(
        self, message: str, *, node: int, index: int, subindex: int, observed: str = "", remedy: str = ""
    ) -> None:
        super().__init__(message, observed=observed, remedy=remedy)
        self.node = node
        self.index = index
        self.subindex = subindex


class SdoAbort(SdoError):
    """The drive refused an SDO transfer; ``code`` is the abort code of CiA 301."""

    def __init__(
        self,
        message: str,
        *,
        node: int,
        index: int,
        subindex: int,
        code: int,
        observed: str = "",
        remedy: str = "",
    ) -> None:
        super().__init__(message, node=node, index=index, subindex=subindex, observed=observed, remedy=remedy)
        self.code = code
        self.for_this_only = True


class SdoTimeout(SdoError, TimeoutError):
    """The node did not answer an SDO request in time."""


class LssError(BusError):
    """A layer setting service (CiA 305) failed; ``service`` is its name in the standard, ``slave`` the addressed slave."""

    def __init__(
        self, message: str, *, service: str, slave: str = "", observed: str = "", remedy: str = ""
    ) -> None:
        super().__init__(message, observed=observed, remedy=remedy)
        self.service = service
        self.slave = slave


class LssRefused(LssError):
    """The slave refused; ``code`` is the service's error code (255: vendor-specific, then in ``specific``)."""

    def __init__(
        self,
        message: str,
        *,
        service: str,
        slave: str,
        code: int,
        specific: int = 0,
        observed: str = "",
        remedy: str = "",
    ) -> None:
        super().__init__(message, service=service, slave=slave, observed=observed, remedy=remedy)
        self.code = code
        self.specific = specific


class LssTimeout(LssError, TimeoutError):
    """No LSS slave answered in time."""


class BootError(BusError):
    """A node could not be brought up; the fields name the step and, if there is one, the object.

    ``letter`` is that of CiA 302-2 (A to O, empty if the standard has none), ``abort`` the SDO abort code; ``tries`` is the number
    of attempts of the last request, ``elapsed`` the seconds since the boot-up began.
    """

    def __init__(
        self,
        message: str,
        *,
        node: int,
        step: str,
        index: int | None = None,
        subindex: int = 0,
        observed: str = "",
        remedy: str = "",
    ) -> None:
        super().__init__(message, observed=observed, remedy=remedy)
        self.node = node
        self.step = step
        self.index = index
        self.subindex = subindex
        self.letter = ""
        self.abort: int | None = None
        self.tries = 0
        self.elapsed = 0.0


class SyncError(BusError):
    """The SYNC of another device is missing, or its period differs from the scan period."""


class ScanError(BusError):
    """The cyclic scan of a bus ended; it no longer controls any motion."""


class DriveError(AxisbusError):
    """The drive answers, but does not do what was requested; ``axis`` is the axis's name."""

    def __init__(self, message: str, *, axis: str = "", observed: str = "", remedy: str = "") -> None:
        super().__init__(message, observed=observed, remedy=remedy)
        self.axis = axis


class DriveFault(DriveError):
    """The drive reports a fault; ``code`` is its error code (object 603Fh), None if it was not read."""

    def __init__(
        self, message: str, *, axis: str = "", code: int | None = None, observed: str = "", remedy: str = ""
    ) -> None:
        super().__init__(message, axis=axis, observed=observed, remedy=remedy)
        self.code = code


class TransitionError(DriveError, TimeoutError):
    """The drive does not follow the controlword in time."""


class ModeError(DriveError):
    """The drive does not enter the mode of operation (6061h does not follow 6060h)."""


class SetPointError(DriveError):
    """The drive does not accept the set-point (handshake of CiA 402 profile position mode)."""


class MotionTimeout(DriveError, TimeoutError):
    """The motion did not arrive by its deadline."""


class FollowingError(DriveError):
    """The axis is further from its commanded position than a lag explains."""


class SkewError(DriveError):
    """The skew of a gantry pair is larger than ``max_skew``, or is unknown."""


class UncommandedMotion(DriveError):
    """The axis is enabled and moves, or is pulled away, while no command runs."""


class HomingError(DriveError):
    """Homing failed: the drive reports an error, was interrupted, or did not finish."""


class ProbeError(DriveError):
    """A touch probe is not armed as requested, or a move that waits for an edge ended without one."""


class StaleError(DriveError):
    """A value that is needed was never received or is older than its maximum age."""


class SignalTimeout(AxisbusError, TimeoutError):
    """An input or output did not get the expected value in time; ``signal`` is its name in the cell file."""

    def __init__(self, message: str, *, signal: str = "", observed: str = "", remedy: str = "") -> None:
        super().__init__(message, observed=observed, remedy=remedy)
        self.signal = signal


class CommandError(AxisbusError):
    """A command failed internally: by an exception, with its traceback in ``__cause__``.

    Or its program did not send the data that it needs, such as the next part of a trajectory, in time.
    """


class Interrupted(AxisbusError):
    """The command ended because another one took over."""


class Replaced(Interrupted):
    """A newer command on the same axis took over."""


class Stopped(Interrupted):
    """A stop took over: requested, ordered by the fault policy, or at the end of the program."""


def help_line(error: AxisbusError) -> str:
    """Return the line that names the page of an error's symptom, to be printed below its texts."""
    return page_reference(error.page)


def page_reference(page: str) -> str:
    """Return the line that names a page, to be printed below the texts that it explains."""
    return f"  more:     axisbus explain {page}"


def added_notes(error: BaseException) -> list[str]:
    """Return the lines added to an error by ``add_note``, such as further failures while its machine was being stopped."""
    return list(vars(error).get("__notes__", ()))


def alarm_of(error: BaseException) -> str:
    """Return the warnings of an error, its notes and its parts, such as ``TREAT THE AXIS AS MOVING: ...``; empty without any."""
    parts = error.exceptions if isinstance(error, BaseExceptionGroup) else ()
    texts = [getattr(error, "remedy", ""), *added_notes(error), *map(alarm_of, parts)]
    return "; ".join(dict.fromkeys(found for text in texts for found in _ALARM.findall(text)))


def with_alarm(text: str, *errors: BaseException) -> str:
    """Return ``text``, which omits the remedies of ``errors``, followed by those of their warnings that it lacks."""
    alarms = dict.fromkeys(alarm for alarm in map(alarm_of, errors) if alarm and alarm not in text)
    return "; ".join([text, *alarms])


def said_of(error: AxisbusError, *, alarm: bool = True) -> str:
    """Return an error in one line, without its kind: its message, the observation in brackets, and its warnings (``alarm``)."""
    seen = f" ({error.observed})" if error.observed else ""
    return with_alarm(f"{error.message}{seen}", *([error] if alarm else []))


def one_line(error: BaseException, *, alarm: bool = True) -> str:
    """Return an error as part of another error's observation: its kind, and the text of ``said_of``.

    ``alarm`` False: the other error takes over its remedy, which contains the warnings.
    """
    said = said_of(error, alarm=alarm) if isinstance(error, AxisbusError) else with_alarm(str(error), error)
    return f"{type(error).__name__}: {said}"


def seen_of(error: AxisbusError) -> str:
    """Return the observation and the notes, a line each: for code that shows the texts of an error one by one."""
    return "\n".join(filter(None, [error.observed, *added_notes(error)]))
