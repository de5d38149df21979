"""First values of a port, read by SDO: inputs that no TPDO may send soon, and all entries that an RPDO would overwrite."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence

from axisbus.bus.pdo.plan import PdoPlan
from axisbus.bus.pdo.rpdo import RpdoImage
from axisbus.bus.sdo.access import require_answering, try_upload
from axisbus.bus.sdo.client import SdoClient
from axisbus.cia301.pdo import MappedObject
from axisbus.cia402.port import INPUT_OBJECTS, OFFSET_OBJECTS, Sample, ValueTransport
from axisbus.errors import BootError, SdoError

_STEP = "priming"

# Start value of an output that cannot be read: the input that shows the same, or 0 if 0 means standstill.
_INSTEAD = {"target_position": "position", "interpolation_target": "position", "mode": "mode"}
_REST = frozenset({"target_velocity", "target_torque", *OFFSET_OBJECTS})


def prime_inputs(sdo: SdoClient, plan: PdoPlan, index_of: Callable[[int], int]) -> dict[str, Sample]:
    """Read every input of the axis; leave out inputs that cannot be read. Blocks, raises as ``SdoClient.read``."""
    samples = {}
    for name, source in plan.inputs.items():
        if source is ValueTransport.NONE:
            continue
        try:
            value = sdo.read(index_of(INPUT_OBJECTS[name]))
        except SdoError as error:
            require_answering(sdo, error)
            continue
        if isinstance(value, int):
            samples[name] = Sample(value, time.monotonic())
    return samples


def prime_outputs(
    sdo: SdoClient, plan: PdoPlan, images: Sequence[RpdoImage], samples: Mapping[str, Sample]
) -> None:
    """Set every entry of every RPDO to the present value in the drive; blocks.

    Raises:
        BootError: an entry that is not an output of motion cannot be read, and setting it to zero could have any effect.
        others as ``SdoClient.upload``.
    """
    for image in images:
        for mapped, name in image.unknown:
            image.put(mapped.index, mapped.subindex, _first_value(sdo, plan, image, mapped, name, samples))


def _first_value(
    sdo: SdoClient,
    plan: PdoPlan,
    image: RpdoImage,
    mapped: MappedObject,
    name: str | None,
    samples: Mapping[str, Sample],
) -> int:
    found = try_upload(sdo, mapped.index, mapped.subindex)
    if isinstance(found, bytes):
        return int.from_bytes(found, "little")
    shown = samples.get(_INSTEAD.get(name or "", ""))
    if shown is not None:
        return shown.value
    if name in _REST:
        return 0
    raise BootError(
        f"node {plan.node_id}: {image.name} contains {sdo.dictionary.entry(mapped.index, mapped.subindex)}, which cannot be "
        "read, so sending it could write a wrong value",
        node=plan.node_id,
        step=_STEP,
        index=mapped.index,
        subindex=mapped.subindex,
        observed=found.observed,
        remedy="allow the mapping to be changed, or disable this RPDO in the node's [pdo] table",
    ) from found
