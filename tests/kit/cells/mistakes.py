"""The smallest cell file, and mistakes in the clean one: the replaced text, the new one, and the report with its line."""

from __future__ import annotations

MINIMAL = """\
[bus]
interface = "sim"
scan_period = "4ms"
[nodes.1]
eds = "builtin:gim6010-8"
[axes.x]
node = 1
unit = "deg"
scale = 364.0888888888889
"""


# old text, new text, line, message, remedy
SLIPS = [
    ("sync = true", "sinc = true", 8, "unknown key 'sinc' in [bus]", "did you mean sync?"),
    ("[groups.xy]", "[group.xy]", 66, "unknown table 'group' in a cell file", "did you mean groups?"),
    (
        "max_velocity = 200.0",
        "velocity = 200.0",
        29,
        "unknown key 'velocity' in [axes.x]",
        "it belongs in [axes.x.defaults]",
    ),
    (
        "torque_slope = 10.0",
        "max_torque = 10.0",
        36,
        "unknown key 'max_torque' in [axes.x.defaults]",
        "[axes.x], before its sub-tables",
    ),
    (
        "max_velocity = 200.0",
        "max_speed = 200.0",
        29,
        "unknown key 'max_speed'",
        "did you mean max_velocity?",
    ),
    ("sync = true", "scale = 1.0", 8, "unknown key 'scale' in [bus]", "it belongs in [axes.NAME]"),
    (
        "[nodes.2]",
        '[nodes.2]\nscan_period = "4ms"',
        21,
        "unknown key 'scan_period' in [nodes.2]",
        "it belongs in [bus]",
    ),
    ("max_velocity = 200.0", 'eds = "x.eds"', 29, "unknown key 'eds' in [axes.x]", "it belongs in [nodes.N]"),
    ("method = 35", "metod = 35", 64, "unknown key 'metod' in [axes.y.homing]", "did you mean method?"),
    ("[nodes.2]", "[nodes.128]", 20, "'128' is not a node ID", "1 to 127"),
    ("[nodes.2]", "[nodes.0x2]", 20, "'0x2' is not a node ID", "in decimal"),
    (
        "[nodes.2]",
        '[nodes.2]\nfirmware = "1.0"',
        21,
        "[nodes.2] speaks CANopen, and firmware has no effect",
        "leave firmware out",
    ),
    ("[nodes.1.pdo.tpdo2]", "[nodes.1.pdo.pdo2]", 17, "'pdo2' is not a PDO", "tpdo1"),
    ("master_id = 127", "master_id = 128", 6, "master_id in [bus] cannot be used", "correct master_id"),
    ("master_id = 127", "master_id = true", 6, "master_id in [bus] cannot be used", "correct master_id"),
    ("bitrate = 1_000_000", 'bitrate = "1M"', 5, "bitrate in [bus] cannot be used", "without quotes"),
    ('interface = "pcan"', "interface = 5", 3, "interface in [bus] cannot be used", '"5"'),
    ("sync = true", 'sync = "yes"', 8, "sync in [bus] cannot be used", "without quotes"),
    ("[0.0, 500.0]", "[500.0, 0.0]", 28, "position_limits in [axes.x] cannot be used", "exchange"),
    ("[0.0, 500.0]", "[0.0, 0.0]", 28, "position_limits in [axes.x] cannot be used", "exchange"),
    (
        "[0.0, 500.0]",
        "[0.0]",
        28,
        "position_limits in [axes.x] cannot be used",
        "correct position_limits",
    ),
    (
        "[0.0, 500.0]",
        "[0.0, inf]",
        28,
        "position_limits in [axes.x] cannot be used",
        "correct position_limits",
    ),
    (
        "velocity = 90.0",
        "velocity = 0",
        61,
        "velocity in [axes.y.defaults] cannot be used",
        "correct velocity",
    ),
    (
        "velocity = 90.0",
        "velocity = nan",
        61,
        "velocity in [axes.y.defaults] cannot be used",
        "correct velocity",
    ),
    ("method = 35", "method = 200", 64, "method in [axes.y.homing] cannot be used", "correct method"),
    (
        'modes = ["pp", "pv", "hm", "csp"]',
        'modes = ["pp", "xx"]',
        59,
        "modes in [axes.y] cannot be used",
        "one of these words",
    ),
    (
        'modes = ["pp", "pv", "hm", "csp"]',
        'modes = ["pp", "pp"]',
        59,
        "modes in [axes.y] cannot be used",
        "correct modes",
    ),
    ('axes = ["x", "y"]', 'axes = "x"', 67, "axes in [groups.xy] cannot be used", "brackets"),
    ('axes = ["x", "y"]', "", 66, "axes is missing in [groups.xy]", 'axes = ["x", "y"]'),
    ("[groups.xy]", "[groups.x]", 66, "'x' names both an axis and a group", "rename"),
    ("[axes.y.homing]", '[axes."y z".homing]', 63, "'y z' is not a name", "letters, digits"),
    ('"6065" = 4000', '"6065" = true', 16, "6065 in [nodes.1.objects] cannot be used", "1 or 0"),
    ('"6065" = 4000', "6099.1 = 4000", 16, "6099 in [nodes.1.objects] cannot be used", '"6099:01"'),
    (
        'map = ["606C", "6077:00"]',
        "map = [6077]",
        18,
        "map in [nodes.1.pdo.tpdo2] cannot be used",
        '"6077"',
    ),
    (
        "transmission = 1",
        "transmission = 256",
        19,
        "transmission in [nodes.1.pdo.tpdo2] cannot be used",
        "correct",
    ),
    (
        "transmission = 1",
        "event_timer = 20",
        19,
        "event_timer in [nodes.1.pdo.tpdo2] cannot be used",
        '"20ms"',
    ),
    ("[nodes.2]\n", '[nodes.2]\ndcf = "b.dcf"\n', 21, "[nodes.2] gives both eds and dcf", "leave one"),
    (
        '[nodes.2]\neds = "drive.eds"',
        "[nodes.2]\noptional = true",
        20,
        "[nodes.2] gives neither eds nor dcf",
        'eds = "drive.eds"',
    ),
]
