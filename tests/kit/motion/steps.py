"""One axis without a scan: the inputs from a drive cycle by cycle, on a clock whose times add up exactly."""

from __future__ import annotations

from axisbus.cia402.port import Capabilities, Inputs, Sample, SdoReply, ValueTransport
from axisbus.errors import BusError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.parameters import DemandUse, DriveTimeouts
from kit.motion.rig import GENERIC, dictionary_of, parameters

T = 1 / 64  # seconds of a cycle: times that add up exactly show on which side of a limit they lie
TIMING = DriveTimeouts(settle=0.125, standstill_time=0.0625)


class Drive:
    """The inputs from a drive, cycle by cycle: the image and the order of an axis without a scan."""

    def __init__(
        self, by_event: bool = False, ages: dict | None = None, start: float = 10.0, **changes
    ) -> None:
        source = ValueTransport.EVENT_PDO if by_event else ValueTransport.SYNC_PDO
        changes = {"scan_period": T, "timing": TIMING, "demand": DemandUse.USE} | changes
        self.parameters = parameters("x", dictionary_of(GENERIC), **changes)
        capabilities = Capabilities({"statusword": source}, {}, True, ages or {})
        use, window = self.parameters.demand, self.parameters.pull_window
        self.image = AxisImage(capabilities, T, 2.0, TIMING.standstill_time, use, window)
        self.order = CycleOutputs()
        self.now = start
        self._samples: dict[str, Sample | None] = {}
        self._replies: tuple[SdoReply, ...] = ()
        self.operational, self.nmt = True, 5
        self.bus: BusError | None = None

    def says(self, **values: int | None) -> Drive:
        """The drive sends these values now; None: they are gone."""
        for name, value in values.items():
            self._samples[name] = None if value is None else Sample(value, self.now)
        return self

    def answers(self, request: int, value: int | None = None, abort: int | None = None) -> Drive:
        """The drive ends an SDO transfer."""
        self._replies += (SdoReply(request, value, abort),)
        return self

    def cycle(self, **values: int | None) -> tuple[AxisImage, CycleOutputs]:
        """One cycle later, with these values new."""
        self.now += T
        self.says(**values)
        names = ("statusword", "mode", "position", "velocity", "torque", "demand")
        self.image.update(
            Inputs(
                self.now,
                self.operational,
                **{name: self._samples.get(name) for name in names},
                sdo=self._replies,
                nmt=self.nmt,
                bus=self.bus,
            )
        )
        self._replies = ()
        self.image.flight.note(
            self.order.outputs(self.image.state), self.now - T
        )  # they went out with the cycle before
        self.order.clear()
        return self.image, self.order

    def later(self, seconds: float) -> Drive:
        """Let the clock continue; the next cycle comes one period after that."""
        self.now += seconds
        return self
