"""Devices on a bus that use a protocol other than CANopen, recognised by the drive plug-ins that know the protocols.

A plug-in names the class of its ``ProtocolDetector`` as ``detector`` in the ``parts`` of its ``Extension``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar, Protocol

from axisbus.cia301.frame import CanFrame
from axisbus.drives import registry

PACKAGE = "detector"


class ForeignDevice(Protocol):
    """A device that was recognised."""

    @property
    def plain(self) -> Mapping[str, object]:
        """Its protocol, node-ID and the like, as plain values."""


class ProtocolDetector(Protocol):
    """Recognises the devices of a plug-in's protocols by listening; holds state: the frames so far.

    ``factory_rate`` is the bit rate with which its ``make`` leaves the factory.
    """

    factory_rate: ClassVar[int]
    make: ClassVar[str]

    def note(self, frame: CanFrame) -> None:
        """Take a frame; frames must come in order of time."""

    @property
    def speakers(self) -> Sequence[ForeignDevice]:
        """The devices recognised so far."""

    def text(self, frame: CanFrame) -> str | None:
        """Return the text of a frame of a recognised device; None for any other frame."""

    def commands(self, can_ids: Iterable[int]) -> set[int]:
        """Return the 11-bit identifiers among ``can_ids`` that a recognised device takes for commands of its protocol."""

    def heard(self) -> list[str]:
        """Return the recognised devices, a line for each protocol."""

    def remedies(self) -> list[str]:
        """Return what to do about them, a line for each protocol."""


class ForeignProtocols:
    """The detectors of all plug-ins; holds their state, and the number of frames without error frames."""

    def __init__(self) -> None:
        """Blocks while the detectors are imported."""
        self._detectors: list[ProtocolDetector] = [make() for make in registry.parts(PACKAGE)]
        self.frames = 0

    def note(self, frame: CanFrame) -> None:
        """As ``ProtocolDetector.note``."""
        self.frames += not frame.error
        for each in self._detectors:
            each.note(frame)

    @property
    def speakers(self) -> list[ForeignDevice]:
        """As ``ProtocolDetector.speakers``."""
        return [speaker for each in self._detectors for speaker in each.speakers]

    def text(self, frame: CanFrame) -> str | None:
        """As ``ProtocolDetector.text``."""
        return next((text for each in self._detectors if (text := each.text(frame)) is not None), None)

    def commands(self, can_ids: Iterable[int]) -> set[int]:
        """As ``ProtocolDetector.commands``."""
        ids = tuple(can_ids)
        return {can_id for each in self._detectors for can_id in each.commands(ids)}

    def heard(self) -> list[str]:
        """As ``ProtocolDetector.heard``."""
        return [line for each in self._detectors for line in each.heard()]

    def remedies(self) -> list[str]:
        """As ``ProtocolDetector.remedies``."""
        return [line for each in self._detectors for line in each.remedies()]

    def lines(self) -> list[str]:
        """Return the recognised devices, each protocol with its remedy below it."""
        pairs = (
            (heard, remedy)
            for each in self._detectors
            for heard, remedy in zip(each.heard(), each.remedies(), strict=True)
        )
        return [line for heard, remedy in pairs for line in (heard, f"  remedy:   {remedy}")]

    @property
    def factory_rates(self) -> dict[int, str]:
        """The bit rates with which devices leave their factory, each with the make."""
        return {each.factory_rate: each.make for each in self._detectors}
