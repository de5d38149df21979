"""Find PDOs of two nodes with the same COB-ID: a command for one drive would also move the other, or one pass for the other.

The plan of a node gives the PDOs that it uses COB-IDs that no other node of the cell has by default (CiA 301 7.3.5). Two nodes can
still have the same one: a drive refuses another COB-ID, or a PDO that axisbus does not use is switched on with a COB-ID of another
node. The latter is the case in drives whose COB-IDs were set for another network, or were written without the node-ID.

Each COB-ID needs one producer: the master for an RPDO that it sends, the node for a TPDO. An RPDO that the master does not send may
consume a TPDO of another node, but not an RPDO that the master sends to another node.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from axisbus.bus.pdo.plan import PdoPlan
from axisbus.bus.pdo.read import Indices
from axisbus.cia301 import cob
from axisbus.cia301 import objects as o
from axisbus.errors import BootError

_STEP = "PDO configuration"


class PdoUse(NamedTuple):
    """One PDO that is switched on; ``used``: axisbus sends or evaluates it."""

    node_id: int
    receive: bool
    number: int
    cob_id: int
    used: bool

    @property
    def name(self) -> str:
        """``RPDO1 of node 5`` and so on."""
        return f"{'RPDO' if self.receive else 'TPDO'}{self.number} of node {self.node_id}"

    @property
    def consumes(self) -> bool:
        """Whether a device other than the master may produce it."""
        return self.receive and not self.used

    def conflicts(self, other: PdoUse) -> bool:
        """Whether the two PDOs may not have the same COB-ID."""
        if self.cob_id != other.cob_id or self.node_id == other.node_id:
            return False
        if self.consumes or other.consumes:
            return any(use.receive and use.used for use in (self, other))
        return True


class CobIdUses:
    """The PDOs of the nodes that have been booted, and the predefined ones of those that have not.

    Several threads may boot nodes at the same time. So each node adds its own PDOs before it looks at those of the others, and the
    node with an unused PDO is the one that has to switch it off.
    """

    def __init__(self, nodes: Collection[int]) -> None:
        """``nodes``: the IDs of all CANopen nodes of the cell."""
        self._predefined = {node_id: list(_predefined(node_id)) for node_id in nodes}
        self._booted: dict[int, list[PdoUse]] = {}

    def conflicts(self, node_id: int, uses: Iterable[PdoUse]) -> list[tuple[PdoUse, PdoUse]]:
        """Take the PDOs of a node that boots; return those with a COB-ID of another node, each with the PDO of the other node.

        Any node may have its predefined COB-IDs, whether it has been booted or not: only an unused PDO is in conflict with them.
        """
        self._booted[node_id] = list(uses)
        found = []
        for use in self._booted[node_id]:
            others = self._others(node_id, self._predefined if not use.used else {})
            other = next(
                (each for each in others if use.conflicts(each) and not self._yields(each, use)), None
            )
            if other is not None:
                found.append((use, other))
        return found

    def drop(self, use: PdoUse) -> None:
        """Take a PDO out that has been switched off."""
        self._booted[use.node_id].remove(use)

    def _others(self, node_id: int, more: Mapping[int, list[PdoUse]]) -> Iterator[PdoUse]:
        for known in (dict(self._booted), more):
            for other, uses in known.items():
                if other != node_id:
                    yield from uses

    def _yields(self, unused: PdoUse, use: PdoUse) -> bool:
        """Whether the other node switches its PDO off, because the COB-ID is a predefined one of this node."""
        own = self._predefined[use.node_id]
        return use.used and not unused.used and any(use.cob_id == each.cob_id for each in own)


def uses_of(node_id: int, plans: Sequence[PdoPlan]) -> list[PdoUse]:
    """Return the PDOs of a node that are switched on after its plans (those of its axes, and of its inputs and outputs)."""
    planned = [pdo for plan in plans for pdo in plan.pdos]
    used = {(pdo.receive, pdo.target.number) for plan in plans for pdo in plan.active}
    on = {(pdo.receive, pdo.target.number): pdo.target for pdo in planned if pdo.target.valid}
    changed = {(pdo.receive, pdo.target.number) for pdo in planned}
    for receive, pdo in (each for plan in plans for each in plan.unused):
        if (receive, pdo.number) not in changed:
            on[receive, pdo.number] = pdo
    return [PdoUse(node_id, *key, pdo.cob_id, key in used) for key, pdo in on.items()]


def error(use: PdoUse, other: PdoUse) -> BootError:
    """Return the error of a PDO that must not keep its COB-ID."""
    index = Indices.of(use.receive, use.number).communication
    table = f"{'rpdo' if use.receive else 'tpdo'}{use.number}"
    effect = (
        "a command for one of these nodes would also reach the other"
        if use.receive and other.receive
        else "the frames of one of these nodes would be taken for those of the other"
    )
    return BootError(
        f"node {use.node_id}: {use.name} has the COB-ID {use.cob_id:03X}h, and so has {other.name}",
        node=use.node_id,
        step=_STEP,
        index=index,
        subindex=o.PDO_COB_ID,
        observed=f"both are switched on; {effect}",
        remedy=f"set another cob_id in [nodes.{use.node_id}.pdo.{table}] of cell.toml, or set {index:04X}h:01 with the drive's own "
        "tool",
    )


def _predefined(node_id: int) -> Iterator[PdoUse]:
    for receive, bases in ((True, cob.RPDO), (False, cob.TPDO)):
        for number, base in enumerate(bases, start=1):
            yield PdoUse(node_id, receive, number, base + node_id, used=True)
