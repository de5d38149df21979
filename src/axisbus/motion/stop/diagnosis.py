"""Explain a failure: the drive's observed values as text, and the first things to check."""

from __future__ import annotations

from collections import deque

from axisbus import cpu_starvation
from axisbus.cia301 import cob, emcy
from axisbus.cia301.nmt import NmtState
from axisbus.cia402 import modes, objects
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.state import PowerState
from axisbus.errors import AxisbusError, BusOff, DriveFault, NodeError, NodeStateError, TransmitQueueFull
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.command_status import CommandStatus
from axisbus.motion.moves.activity import SdoTransfers
from axisbus.motion.parameters import AxisParameters

# Separates the first observation from its consequences, in the field "observed".
THEN = "\n            then: "
_LINE = "\n            "  # separates two remedies, in the field "remedy"
_RECENT = 5.0  # seconds during which an EMCY counts as belonging to the present event


# First check, by error code: by its class (first hex digit), by its group (first two digits), then exact codes with a text of their
# own.
_REMEDY_BY_CLASS = {
    0x2: "look for a short circuit, a blocked axis, or acceleration and torque limits that need too much current",
    0x3: "measure the supply: if it is too high while braking, fit a brake chopper; if it is too low, use a stronger supply "
    "or thicker cable",
    0x4: "let it cool down; check load, duty cycle and ventilation",
    0x5: "the drive has a hardware fault: see its manual",
    0x6: "check the drive's parameters (a value out of range, or not stored)",
    0x7: "check motor, encoder and brake with their cables",
    0x8: "check load, tuning and limits",
    0x9: "an external fault input is active: check its wiring and the device that is connected to it",
}
_REMEDY_BY_GROUP = {
    0x81: "the drive has trouble with the bus: check termination, bit rate and cable, and how full the bus is",
    0x82: "frames that the drive received or expected did not match its configuration: check whether another master or tool "
    "maps or commands it, and boot it again",
}
_REMEDY_BY_CODE = {
    0x8130: "the drive missed the master's heartbeat: check cable, termination and that this program got enough processor "
    "time",
    0x8140: "the bus was off: check termination, bit rate and cable",
    0x8150: "another sender uses an identifier of this drive: look for a second node with its node-ID, or another master",
    **dict.fromkeys(
        range(0x8250, 0x8260),
        "the drive waited for its process data: check that cycles are not late and that the bus loses no frames",
    ),
    0x8611: "the axis does not follow its demand: blocked, too high acceleration, bad tuning, or a following error window (6065h) "
    "that is too narrow",
    0x8612: "a limit switch or software limit (607Dh) was reached: move away from it, check the limits",
    0x8700: "the period of SYNC is not the one that the drive expects: check whether cycles are late, and see its manual for "
    "the periods that it accepts",
    0x7121: "the motor is blocked: check the mechanics and the brake",
}


# Error codes of a drive that received too little from the master: heartbeat, an RPDO's deadline (CiA 301 table 26), SYNC (CiA
# 402-2, 603Fh).
_MASTER_SILENCE_CODES = frozenset({0x8130, 0x8250, 0x8700})


_SHOWN_PARTS = 4  # parts that remain at the beginning and at the end of a long chain of observations
_NO_CODE = "no error code could be read (603Fh)"
_NOT_YET = "its error code is being read (603Fh)"
_NO_OTHER = frozenset({PowerState.FAULT, PowerState.FAULT_REACTION_ACTIVE, PowerState.UNKNOWN})


class DriveHistory:
    """The last states and emergency messages of one drive; bounded."""

    __slots__ = ("emcy", "states")

    def __init__(self) -> None:
        self.states: deque[tuple[float, PowerState]] = deque(maxlen=8)
        self.emcy: deque[emcy.Emcy] = deque(maxlen=16)

    def note(self, image: AxisImage) -> None:
        """Add the state and the emergency messages of this cycle, if they are new."""
        if not self.states or self.states[-1][1] is not image.state:
            self.states.append((image.now, image.state))
        if image.emcy:
            self.emcy.extend(image.emcy)

    def path(self) -> str:
        """Return the last states in order, as text for the user."""
        return " > ".join(state.value for _, state in list(self.states)[-4:])

    @property
    def began_in_fault(self) -> bool:
        """Whether this master has seen the drive in no other known state than fault or *fault reaction active*."""
        return all(state in _NO_OTHER for _, state in self.states)

    def recent_emcy(self, now: float) -> list[emcy.Emcy]:
        """Return the emergency messages (no resets) of the last seconds."""
        return [entry for entry in self.emcy if now - entry.stamp < _RECENT and not entry.is_reset]


class FaultDiagnosis:
    """Reads the drive's description of its fault: 603Fh and the objects of the drive plug-in.

    Holds the transfers, and the tickets that wait for the explanation.

    ``doing``: what the fault interrupted, such as ``" during x.home()"``.
    """

    __slots__ = ("_deadline", "_parameters", "_transfers", "doing", "done", "tickets")

    def __init__(self, parameters: AxisParameters, now: float) -> None:
        self._parameters = parameters
        items: list[tuple[int, int, int | None]] = [(objects.ERROR_CODE, 0, None)]
        items += [(index, subindex, None) for index, subindex in parameters.fault_objects]
        wanted = [item for item in items if parameters.has(item[0])]
        self._transfers = SdoTransfers(wanted, parameters)
        self._deadline = now + parameters.timing.diagnosis
        self.doing = ""
        self.tickets: list[CommandStatus] = []
        self.done = False

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True once all values have arrived, or no more can be expected."""
        try:
            self.done = self._transfers.step(image, order)
        except AxisbusError:
            # A drive that refuses to explain itself is still in fault: report the known values.
            self.done = True
        if image.now > self._deadline:
            self._transfers.cancel(order)
            self.done = True
        return self.done

    def fault_error(self, image: AxisImage, history: DriveHistory) -> DriveFault:
        """Return the error that explains the fault."""
        name, values = self._parameters.name, dict(self._transfers.values)
        recent = history.recent_emcy(image.now)
        code = values.pop((objects.ERROR_CODE, 0), None)
        if not code and recent:
            code = recent[-1].code
        texts = [f"error code {emcy.describe(code)}" if code else _NO_CODE if self.done else _NOT_YET]
        texts += self._parameters.explain_fault(code or 0, values)
        texts += [f"EMCY {emcy.describe(entry.code)}{_register(entry)}" for entry in recent[-2:]]
        texts.append(f"path: {history.path()}")
        came = "was found in" if history.began_in_fault else "went into"
        fault = DriveFault(
            f"{name}: the drive {came} fault{self.doing}",
            axis=name,
            code=code,
            observed="; ".join(texts),
            remedy=f"{remedy(code)}; then reset it: axis.reset()",
        )
        if code in _MASTER_SILENCE_CODES:
            name_starvation(fault, image)
        return fault


def chained(observed: str, what: str) -> str:
    """Append ``what`` to the observed text; of a long chain, only the beginning and the end remain."""
    parts = [*observed.split(THEN), what]
    if len(parts) > 2 * _SHOWN_PARTS:
        parts = [*parts[:_SHOWN_PARTS], *parts[-_SHOWN_PARTS:]]
    return THEN.join(parts)


def first_observation(error: AxisbusError) -> str:
    """Return the first observation, without its consequences."""
    return error.observed.split(THEN)[0]


def join_remedies(first: str, then: str) -> str:
    """Join two remedies, one line each, in the field "remedy"; omit lines of ``then`` that ``first`` already contains."""
    said = first.split(_LINE) if first else []
    return _LINE.join([*said, *(line for line in then.split(_LINE) if line and line not in said)])


def remedy(code: int | None) -> str:
    """Return the first things to check for an error code."""
    if not code:
        return "read the drive's error history (1003h)"
    return (
        _REMEDY_BY_CODE.get(code)
        or _REMEDY_BY_GROUP.get(code >> 8)
        or _REMEDY_BY_CLASS.get(code >> 12)
        or "see the drive's manual for this error code"
    )


def nmt_text(image: AxisImage) -> str:
    """Return why a node does not count as operational: the NMT state that it reports, or its silence."""
    silent = image.overdue or image.nmt in (NmtState.OPERATIONAL, NmtState.UNKNOWN)
    if not silent:
        return f"NMT state {NmtState(image.nmt).text}"
    return "it does not answer node guarding" if image.guarded else "its heartbeat has stopped"


def _register(entry: emcy.Emcy) -> str:
    words = emcy.register_words(entry.register)
    return f" (error register: {', '.join(words)})" if words else ""


def enrich(error: AxisbusError, image: AxisImage, history: DriveHistory) -> AxisbusError:
    """Add the drive's observed values to ``error.observed``.

    Added are states, mode, EMCY, the NMT state (unless the error is about the node or the bus), and the age of an old statusword.
    """
    texts = [error.observed] if error.observed else []
    texts.append(f"drive: {history.path()}")
    if image.mode is not None:
        texts.append(f"mode {image.mode} ({modes.short(ModeOfOperation(image.mode))})")
    texts += [f"EMCY {emcy.describe(entry.code)}" for entry in history.recent_emcy(image.now)[-2:]]
    if not image.operational and not isinstance(error, NodeError | BusOff | TransmitQueueFull):
        texts.append(nmt_text(image))
    age = image.now - image.statusword_stamp
    if 0.5 < age < 1e6:
        texts.append(f"last statusword {age:.3g} s ago")
    error.observed = "; ".join(texts)
    return name_starvation(error, image)


def name_starvation(error: AxisbusError, image: AxisImage) -> AxisbusError:
    """Put the cause on this computer first: the master did not run in time.

    A remedy that is an alarm (``TREAT ...``) stays first. An error that already names the cause is not changed.
    """
    text = image.starvation.text(image.now)
    if not text or "this program did not run" in error.message:
        return error
    error.observed = f"{text}; {error.observed}"
    first, then = (
        (error.remedy, cpu_starvation.REMEDY)
        if error.remedy.startswith("TREAT ")
        else (cpu_starvation.REMEDY, error.remedy)
    )
    error.remedy = join_remedies(first, then)
    return error


# -- Error texts and remedies for a node that is lost ------------------------------------------------------------------


# Last received NMT state of a node that is lost without any message.
SILENT = frozenset({NmtState.OPERATIONAL, NmtState.UNKNOWN})
REOPEN = "close the machine and open it again"


def start_and_reset(node: int) -> str:
    """Return how to restart a node that still has its configuration; a node that has restarted needs ``boot_and_reset`` instead."""
    return (
        f"start it (axisbus nmt start {node} --cell CELL; in a program: machine.node({node}).command(NmtCommand.START)), "
        "and reset the axis: axis.reset()"
    )


def boot_node(node: int) -> str:
    """Return how to configure and start a node that has restarted, while the machine runs."""
    return f"boot it (axisbus boot CELL --node {node}; in a program: machine.node({node}).boot())"


def boot_and_reset(node: int) -> str:
    """Return how to bring an axis back whose node has restarted, while the machine runs."""
    return f"{boot_node(node)}, and reset the axis: axis.reset()"


def when_back(node: int) -> str:
    """Return what to do when a node is present again, whether it has restarted or not."""
    return (
        f"when the node answers again, {start_and_reset(node)}; if it has restarted, {boot_and_reset(node)}"
    )


def remedy_for_silence(node: int) -> str:
    """Return what to do when a node has become silent."""
    return (
        f"check supply and cable of node {node}, then bus load and that SYNC reaches it (axisbus scan shows the nodes that "
        f"answer); {when_back(node)}"
    )


def silence_of(node: int, image: AxisImage) -> tuple[str, str]:
    """Return why a silent node counts as lost, and what was expected from it."""
    if image.guarded:
        return (
            "it does not answer node guarding",
            f"requests for its state (remote frames {cob.HEARTBEAT + node:03X}h) are not answered",
        )
    return "its heartbeat stopped", "its heartbeat did not come in time"


def not_to_be_reset(name: str, node: int, image: AxisImage, *, stopping: bool) -> NodeStateError:
    """Return why a command cannot reset an axis whose node is not operational; ``stopping``: the axis is still being stopped."""
    still = "; the axis is still being stopped" if stopping else ""
    if image.bus is not None:
        return NodeStateError(
            f"{name}: node {node} cannot be reached: {image.bus.message}",
            observed=image.bus.observed + still,
            remedy=f"{image.bus.remedy}; then reset again if the node is still operational, else {boot_and_reset(node)}",
        )
    if image.restarted and (image.overdue or image.nmt != NmtState.OPERATIONAL):
        return NodeStateError(
            f"{name}: node {node} has restarted, or may have, so a reset is not enough",
            observed=f"{nmt_text(image)}; it is not known whether it still has the configuration of this master{still}",
            remedy=boot_and_reset(node),
        )
    if image.overdue or image.nmt == NmtState.UNKNOWN:
        return NodeStateError(
            f"{name}: node {node} is lost, so there is no node to reset",
            observed=f"{nmt_text(image)}{still}",
            remedy=f"check supply and cable of node {node} until axisbus scan shows it; then {boot_and_reset(node)}; if it "
            f"has not restarted, it is enough to {start_and_reset(node)}",
        )
    if image.nmt == NmtState.OPERATIONAL:
        return NodeStateError(
            f"{name}: node {node} has returned, but a reset is not enough",
            observed="it has restarted, or may have: it is not known whether it still has the configuration of this "
            f"master{still}",
            remedy=boot_and_reset(node),
        )
    return NodeStateError(
        f"{name}: node {node} is present, but not operational, so a reset alone is not enough",
        observed=nmt_text(image) + still,
        remedy=f"its EMCY says why it left operational (axisbus monitor): clear that cause; then {start_and_reset(node)}",
    )
