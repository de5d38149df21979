"""Recordings for readers other than ours: the requirements of Foxglove, and of MCAP's own package."""

from __future__ import annotations

import json

import jsonschema
import pytest

from axisbus import Machine
from kit.cell import cell_file
from kit.io_module import LEVEL, MODULE
from kit.scenarios.simulated_bus import until

mcap_reader = pytest.importorskip("mcap.reader")
OBJECTS = {
    "lamp": "boolean",
    "part": "boolean",
    "level": "number",
    "x:6041": "number",
    "x:6081": "number",
    "1:1008": "string",
}
PLAIN = {"boolean", "string", "number", "integer"}  # no list of types, and no null


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A recording over a bus, with objects that come by PDO and by SDO."""
    folder = tmp_path_factory.mktemp("readers")
    file = cell_file(folder, "x", heartbeat="1s", more=MODULE.format(node="") + LEVEL)
    with (
        Machine.open(file) as machine,
        machine.recording(folder / "run.mcap", objects=list(OBJECTS)) as recording,
    ):
        machine["x"].enable().wait()
        wired = machine.simulated_node(5).device.io
        wired.set(0x6401, 2, 350)
        wired.set_bit(0x6000, 1, 2, True)
        machine.io["lamp"].set(True).wait(1.0)
        until(lambda: all(recording.reads.values()), 20.0)
    return folder / "run.mcap"


def read(path, **how):
    with path.open("rb") as file:
        return [
            (schema, channel, json.loads(message.data))
            for schema, channel, message in mcap_reader.make_reader(file).iter_messages(**how)
        ]


def test_each_type_is_a_plain_one_and_each_message_is_valid_by_its_schema(path):
    seen = set()
    for schema, channel, value in read(path):
        known = json.loads(schema.data)
        assert known["type"] == "object"
        assert {each["type"] for each in known["properties"].values()} <= PLAIN, channel.topic
        jsonschema.validate(value, known)
        assert set(value) <= set(known["properties"])
        seen.add(channel.topic)
    assert {"axis/x", "events/command", *(f"object/{label}" for label in OBJECTS)} <= seen


def test_an_object_has_the_type_of_its_values(path):
    found = {
        channel.topic: json.loads(schema.data)["properties"]["value"]["type"]
        for schema, channel, _ in read(path)
        if channel.topic.startswith("object/")
    }
    assert found == {f"object/{label}": kind for label, kind in OBJECTS.items()}


def test_an_unknown_value_is_left_out(path):
    samples = [value for _, channel, value in read(path) if channel.topic == "axis/x"]
    assert all(None not in sample.values() for sample in samples)
    assert {"position", "state", "power"} <= set(samples[-1])


def test_every_chunk_has_the_offset_of_each_message_of_each_channel(path):
    with path.open("rb") as file:
        summary = mcap_reader.make_reader(file).get_summary()
    led = set().union(*(chunk.message_index_offsets for chunk in summary.chunk_indexes))
    assert all(chunk.message_index_offsets for chunk in summary.chunk_indexes)
    assert led == set(summary.statistics.channel_message_counts)


def test_one_channel_and_one_moment_are_found_by_the_indexes(path):
    alone = [value for _, _, value in read(path, topics=["object/level"])]
    assert alone == [value for _, channel, value in read(path) if channel.topic == "object/level"]
    assert alone
