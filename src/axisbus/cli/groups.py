"""The groups of subcommands: eds, lss, od, config, program, bridge, fleet and record, one table each."""

from __future__ import annotations

import click

from axisbus.cli.shared.lazy import HELP_OPTIONS, LazyGroup

# -- ``axisbus eds``: the workbench for EDS and DCF files ------------------------------------------------------------------

EDS_COMMANDS = {
    "check": ("axisbus.cli.eds.check", "Show all errors of a file, with their locations."),
    "fix": (
        "axisbus.cli.eds.fix",
        "Fix the errors that can be fixed safely; shows a diff, writes only with --write.",
    ),
    "list": (
        "axisbus.cli.eds.reports:list_command",
        "List the EDS files that come with axisbus (builtin:NAME).",
    ),
    "show": ("axisbus.cli.eds.reports:show_command", "Show the dictionary as a tree, or one object."),
    "diff": ("axisbus.cli.eds.reports:diff_command", "Compare the meaning of two files."),
    "doc": (
        "axisbus.cli.eds.reports:doc_command",
        "Write a complete reference of the drive as HTML or Markdown.",
    ),
    "dcf": ("axisbus.cli.eds.dcf", "Make a DCF from an EDS and values, or a concise DCF, and back."),
    "export": (
        "axisbus.cli.eds.reports:export_command",
        "Write the dictionary as CSV or JSON, or the PDOs as DBC.",
    ),
    "code": (
        "axisbus.cli.eds.code",
        "Write a Python module that describes the objects, or a C header with the PDOs.",
    ),
    "verify": (
        "axisbus.cli.eds.device:verify_command",
        "Compare a file with the connected drive; reads only.",
    ),
    "from-device": (
        "axisbus.cli.eds.device:from_device_command",
        "Read the EDS from the drive, or make a skeleton of it.",
    ),
}


@click.group("eds", cls=LazyGroup, table=EDS_COMMANDS)
def eds() -> None:
    """Check, fix, show, compare and document EDS and DCF files.

    Exit codes: 0 all well, 1 something was found wrong, 2 wrong use, 3 the bus or a drive failed.
    """


# -- ``axisbus lss``: node-IDs and bit rates over the bus (CiA 305) --------------------------------------------------------

LSS_COMMANDS = {
    "find": ("axisbus.cli.lss.commands:find_command", "Find every slave without a node-ID; changes nothing."),
    "inquire": ("axisbus.cli.lss.commands:inquire_command", "Show a slave's identity and node-ID."),
    "set-node-id": ("axisbus.cli.lss.commands:set_node_id_command", "Give a slave a node-ID."),
    "set-bitrate": ("axisbus.cli.lss.set_bitrate", "Set the bit rate of slaves, and change over to it."),
    "store": ("axisbus.cli.lss.commands:store_command", "Make a slave store node-ID and bit rate."),
}


@click.group("lss", cls=LazyGroup, table=LSS_COMMANDS)
def lss() -> None:
    """Set node-IDs and bit rates over the bus (CiA 305), on a bus where no machine is running.

    Exit codes: 0 all well, 1 something was found wrong, 2 wrong use, 3 the bus or a slave failed.
    """


# -- ``axisbus od``: the objects of a node, by name or number --------------------------------------------------------------

OD_COMMANDS = {
    "read": ("axisbus.cli.od.commands:read_command", "Read objects and show their meaning."),
    "write": ("axisbus.cli.od.commands:write_command", "Write one object; checked before, read back after."),
    "dump": ("axisbus.cli.od.commands:dump_command", "Read every object of a node; writes nothing."),
    "watch": ("axisbus.cli.od.commands:watch_command", "Read objects periodically, and show changes."),
}


@click.group("od", cls=LazyGroup, table=OD_COMMANDS)
def od() -> None:
    """Read, write, list and watch the objects of a node.

    A node is its ID, or an axis of --cell; an object is an index (6041, 1018:1) or a name of the EDS, with _ for a space.
    """


# -- ``axisbus config``: the configuration of a node as a DCF file ---------------------------------------------------------

CONFIG_COMMANDS = {
    "backup": (
        "axisbus.cli.config.commands:backup_command",
        "Read all objects of a node into a DCF; writes nothing to it.",
    ),
    "diff": (
        "axisbus.cli.config.commands:diff_command",
        "Compare two files, a file and a node, or a node and its EDS.",
    ),
    "restore": (
        "axisbus.cli.config.restore",
        "Configure a node as in a DCF, and read every object again.",
    ),
}


@click.group("config", cls=LazyGroup, table=CONFIG_COMMANDS)
def config() -> None:
    """Back up, compare and restore the configuration of a node as a DCF.

    Exit codes: 0 all well, 1 something differs or was refused, 2 wrong use, 3 the bus or a drive failed.
    """


# -- ``axisbus program``: the program (firmware) of a node -----------------------------------------------------------------

PROGRAM_COMMANDS = {
    "show": (
        "axisbus.cli.program:show_command",
        "Show the versions and the state of a node's program.",
    ),
    "write": (
        "axisbus.cli.program:write_command",
        "Replace the program of a node by that of a file.",
    ),
    "verify": (
        "axisbus.cli.program:verify_command",
        "Compare the program of a node with a file; writes nothing.",
    ),
}


@click.group("program", cls=LazyGroup, table=PROGRAM_COMMANDS)
def program() -> None:
    """Show, write and verify the program (firmware) of a node that has the objects 1F50h to 1F57h of CiA 302-3.

    Exit codes: 0 all well, 1 something differs or was refused, 2 wrong use, 3 the bus or a node failed.
    """


# -- ``axisbus bridge``: a machine in the systems of a plant ---------------------------------------------------------------

BRIDGE_COMMANDS = {
    "metrics": ("axisbus.cli.bridge.metrics", "Serve the figures of a running machine for Prometheus."),
    "opcua": ("axisbus.cli.bridge.opcua", "Serve a machine by OPC UA."),
    "opcua-user": (
        "axisbus.cli.bridge.opcua_user:opcua_user_command",
        "Make a line for the file of users who may call methods.",
    ),
    "zenoh": ("axisbus.cli.bridge.zenoh", "Join a machine to a Zenoh network, for a fleet."),
}


@click.group("bridge", cls=LazyGroup, table=BRIDGE_COMMANDS)
def bridge() -> None:
    """Connect a machine to the systems of a plant. A bridge is one more client of the machine: ending or killing it does not
    affect the cycle.
    """


# -- ``axisbus fleet``: the cells of a plant -------------------------------------------------------------------------------

FLEET_COMMANDS = {
    "list": (
        "axisbus.cli.fleet.commands:list_command",
        "Show the cells of a plant, their axes, incidents and recordings, once.",
    ),
    "watch": (
        "axisbus.cli.fleet.commands:watch_command",
        "The same as a table that is updated continuously.",
    ),
    "stop": (
        "axisbus.cli.fleet.commands:stop_command",
        "Quick-stop all axes of all cells, or of some, whichever program has control.",
    ),
}


@click.group("fleet", cls=LazyGroup, table=FLEET_COMMANDS)
def fleet() -> None:
    """See and stop the cells of a plant over its Zenoh network.

    A cell joins the network by its bridge: axisbus bridge zenoh CELL --plant PLANT. Not a safety function: a stop that is sent
    over a network may not arrive.
    """


# -- ``axisbus record``: recordings of a cell; without a subcommand a recording is made ------------------------------------

_RECORD_START = "start"
RECORD_COMMANDS = {
    _RECORD_START: (
        "axisbus.cli.record.start",
        "Record the machine of a cell; the word start may be left out.",
    ),
    "faults": ("axisbus.cli.record.files:faults_command", "List the stored faults of a cell."),
    "export": ("axisbus.cli.record.files:export_command", "Write a recording as CSV or Parquet."),
    "diff": ("axisbus.cli.record.files:diff_command", "Compare two recordings of the same job."),
}


class _RecordGroup(LazyGroup):
    """A group whose default subcommand makes a recording."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Insert the omitted subcommand."""
        if args and args[0] not in RECORD_COMMANDS and args[0] not in HELP_OPTIONS:
            args = [_RECORD_START, *args]
        return super().parse_args(ctx, args)


@click.group(
    "record",
    cls=_RecordGroup,
    table=RECORD_COMMANDS,
)
def record() -> None:
    """Record each cycle of a cell's axes into an MCAP file: axisbus record cell.toml -o run.mcap

    Joins the machine of the cell if it is already running. See axisbus record start -h.
    """
