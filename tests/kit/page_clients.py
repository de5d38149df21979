"""Pages at a client handler, on a simulated cell in virtual time."""

from __future__ import annotations

import json
from typing import Any

from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from axisbus.web.access.tokens import PageSession, Role
from axisbus.web.commands.clients import PageClient, PageClients
from kit.cell import SCALE

BEAT = 0.05


class Pages:
    """A client handler at a simulated machine, and a clock that runs with its virtual time."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.desk = PageClients(machine, lambda: "http://here/enter?token=t")
        self.now = 100.0
        self.press = 0

    def admit(self, role: Role = Role.OPERATOR) -> PageClient:
        return self.desk.admit(PageSession(1, role), "127.0.0.1")

    def operator(self) -> PageClient:
        place = self.admit()
        self.ask(place, "take")
        return place

    def ask(self, place: PageClient, do: str, axis: str = "", **more: Any) -> None:
        message = {"do": do, "axis": axis, "sent": self.now - 90.0, **more}
        self.desk.receive(place, json.dumps(message), self.now)

    def pass_(self, seconds: float) -> None:
        """Let time pass, with a look each 20 ms."""
        for _ in range(round(seconds / 0.02)):
            self.machine.sleep(0.02)
            self.now += 0.02
            self.desk.poll(self.now)

    def enabled(self, place: PageClient, *names: str) -> None:
        for name in names:
            self.ask(place, "enable", name, sure=True)
        self.pass_(1.0)
        assert all(self.machine[name].state is AxisState.STANDSTILL for name in names)

    def beat(
        self, place: PageClient, axis: str = "x", times: int = 10, way: str = "1", **values: str
    ) -> None:
        """One press's beats continue."""
        for _ in range(times):
            self.ask(place, "jog", axis, press=self.press, values={"direction": way, **values})
            self.pass_(BEAT - 0.01)

    def jog(self, place: PageClient, axis: str = "x", **values: str) -> None:
        """A new press, until the axis has its velocity."""
        self.press += 1
        self.beat(place, axis, **values)
        assert abs(self.speed(axis)) > 15.0

    def speed(self, axis: str = "x") -> float:
        """How fast the plant turns, in deg/s."""
        node = self.machine.cell.axes[axis].node
        velocity: float = self.machine.simulated_node(node).drive().axis.motor.velocity
        return velocity / SCALE

    def told(self, place: PageClient) -> list[tuple[str, str]]:
        told, place.messages = place.messages, []
        return [(one.kind, one.text) for one in told]
