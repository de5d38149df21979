"""A program of its own that gets a signal in the middle of an action; it writes down the final state of its motor.

``python -m kit.scenarios.signalled_program FOLDER NETS SCENE...``: the cell file is FOLDER/cell.toml, NETS are the nets to cut
(joined by ``;``), each SCENE is one of ``SCENES``. It prints ``ready`` when a scene is running, and appends a line of JSON to
FOLDER/seen.jsonl when the machine is closed. The exception of the last scene is not caught.
"""

from __future__ import annotations

import asyncio
import atexit
import json
import signal
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path

from axisbus.errors import added_notes
from axisbus.machine.handle import Handle
from axisbus.machine.machine import Machine
from axisbus.sim.drive import Drive
from kit.scenarios.safety_nets import cut

CUT = ExitStack()  # never closed: the nets stay cut while the interpreter ends
LONG = 60.0  # seconds; nothing here waits for its end
SPEED, BRAKING = 90.0, 60.0  # deg/s and deg/s²: a halt takes 1.5 s and 67 deg


class Scene:
    """One machine in a scene; holds the position of the motor when closing began."""

    def __init__(self, folder: Path, name: str) -> None:
        self.name = name
        self.folder = folder
        self._drive: Drive | None = None
        self._from: float | None = None

    def open(self) -> Machine:
        """Open the machine and let its axis turn."""
        machine = Machine.open(self.folder / "cell.toml")
        self._drive = machine.simulated_node(1).drive()
        machine["x"].enable().wait(30)
        machine["x"].move_velocity(SPEED, acceleration=900.0, deceleration=BRAKING).wait(30)
        return machine

    def leaves(self) -> None:
        """Remember where the motor is: from here on it is being stopped."""
        self._from = self._where

    def write_down(self, error: BaseException | None) -> None:
        """Append the final state of the motor."""
        assert self._drive is not None
        seen = {
            "scene": self.name,
            "raised": "" if error is None else f"{type(error).__name__}({error})",
            "notes": [] if error is None else added_notes(error),
            "velocity": self._drive.axis.motor.velocity / 100,
            "stage": int(self._drive.power.stage),
            "way": abs(self._where - (self._where if self._from is None else self._from)),
        }
        with (self.folder / "seen.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps(seen) + "\n")

    @property
    def _where(self) -> float:
        assert self._drive is not None
        return self._drive.axis.motor.position / 100


def ready() -> None:
    """Report that the signal may be sent."""
    print("ready", flush=True)


def long_move(machine: Machine) -> Handle:
    """Begin a move that lasts for hours and ends on a short ramp."""
    return machine["x"].move_relative(1e6, velocity=SPEED, deceleration=450.0)


def sleeping(scene: Scene) -> None:
    with scene.open():
        try:
            ready()
            time.sleep(LONG)
        finally:
            scene.leaves()


def waiting(scene: Scene) -> None:
    with scene.open() as machine:
        handle = long_move(machine)
        try:
            ready()
            handle.wait()
        finally:
            scene.leaves()


async def _await_long_move(scene: Scene, machine: Machine) -> None:
    handle = long_move(machine)
    asyncio.get_running_loop().call_later(0.05, ready)
    try:
        await handle
    finally:
        scene.leaves()


def awaiting(scene: Scene) -> None:
    """The event loop runs inside the machine's block."""
    with scene.open() as machine:
        asyncio.run(_await_long_move(scene, machine))


def awaiting_inside(scene: Scene) -> None:
    """The machine's block is inside the event loop."""

    async def main() -> None:
        with scene.open() as machine:
            await _await_long_move(scene, machine)

    asyncio.run(main())


def leaving(scene: Scene) -> None:
    """The block has ended, and the signal is received while the motor still brakes."""
    with scene.open():
        scene.leaves()
        ready()


def closing(scene: Scene) -> None:
    """The same without a block."""
    machine = scene.open()
    scene.leaves()
    ready()
    machine.close()


def forgetting(scene: Scene) -> None:
    """The program ends without closing the machine."""
    atexit.register(scene.write_down, None)  # registered before the machine's own, so called after it
    machine = scene.open()
    scene.leaves()
    assert not machine.session.ended


SCENES: dict[str, Callable[[Scene], None]] = {
    work.__name__: work
    for work in (sleeping, waiting, awaiting, awaiting_inside, leaving, closing, forgetting)
}


def play(folder: Path, name: str) -> None:
    """Play one scene and write down its end; its exception passes on."""
    scene = Scene(folder, name)
    try:
        SCENES[name](scene)
    except BaseException as error:
        scene.write_down(error)
        raise
    if name != "forgetting":
        scene.write_down(None)


def main() -> None:
    """Play the scenes one after the other."""
    folder, nets, *names = sys.argv[1:]
    signal.signal(signal.SIGINT, signal.default_int_handler)  # whatever the shell had made of it
    CUT.enter_context(cut(tuple(nets.split(";")) if nets else ()))
    for name in names[:-1]:
        with suppress(KeyboardInterrupt, SystemExit):
            play(Path(folder), name)
    play(Path(folder), names[-1])


if __name__ == "__main__":
    main()
