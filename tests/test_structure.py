"""Rules of the package structure that no linter checks: every package has a docstring and is not empty, no imports form a circle,
the names on the pages exist, and no test imports another.
"""

import ast
import importlib
import inspect
import re

import grimp
import pytest

from axisbus import Cam, Machine, Signal
from axisbus.cia401.signal import IoPoint
from kit.pages import PAGES as ALL_PAGES
from kit.pages import README, ROOT, blocks, blocks_of_all, name_of, text_of
from kit.slow import IN_REAL_TIME, IN_VIRTUAL_TIME, NAMES, REAL_TIME

SOURCE = ROOT / "src" / "axisbus"
README_WORDS = 900


def folders():
    return sorted({path.parent for path in SOURCE.rglob("*.py")})


@pytest.mark.parametrize("folder", folders(), ids=lambda folder: folder.relative_to(SOURCE).as_posix())
def test_every_package_has_a_docstring(folder):
    first = (folder / "__init__.py").read_text(encoding="utf-8").splitlines()[0]
    assert re.fullmatch(r'"""[A-Z`a-z].*[.:]("""|)', first)


def test_no_package_is_empty():
    assert [folder for folder in SOURCE.rglob("*/") if folder.is_dir() and _is_empty(folder)] == []


def _is_empty(folder):
    names = {path.name for path in folder.iterdir()}
    return folder.name != "__pycache__" and names <= {"__init__.py", "__pycache__"}


def test_no_module_imports_itself_through_others():
    graph = grimp.build_graph("axisbus", exclude_type_checking_imports=True)
    circles = [
        (one, other)
        for one in sorted(graph.modules)
        for other in sorted(graph.find_modules_directly_imported_by(one))
        if one < other and graph.chain_exists(importer=other, imported=one)
    ]
    assert circles == []


# -- time ----------------------------------------------------------------------------------------------------------------

# The modules of these packages that may wait or run in real time, whatever the clock of a channel is.
IN_CLOCKED_PACKAGES = (
    *("bus", "boot", "configuration", "core", "sim"),
    *(f"drives/gim6010/{part}" for part in ("bus", "boot", "core", "sim")),
)
REAL_NAMES = {
    "time": {"monotonic", "monotonic_ns", "perf_counter", "perf_counter_ns", "sleep"},
    "threading": {"Barrier", "BoundedSemaphore", "Condition", "Event", "Semaphore", "Thread", "Timer"},
    "queue": {"LifoQueue", "PriorityQueue", "Queue", "SimpleQueue"},
    "axisbus.clock": {"REAL", "SystemClock"},
}
ADAPTER = "reads an adapter of the computer, in whose driver it blocks"
SCAN = "the scan in real time: its thread, what watches over it, and how a program waits for it"
PROCESS = "a core in a process of its own: the programs that speak with it, and its other processes, live in real time"
SERVES = "simulated drives in real time, for programs that reach them through a bus or a port of the computer"
REAL_BY_NATURE = {
    "bus.link.channel": f"{ADAPTER}; its clock is the real one if none is given",
    "bus.link.listen": ADAPTER,
    "bus.link.ownership": "two programs that take an adapter at the same time give way to each other",
    "bus.link.raw_sockets": "the stamps of the kernel are in the time of the computer",
    "bus.link.socketpair_bus": ADAPTER,
    "core.realtime_setup": SCAN,
    "core.scan_thread": SCAN,
    "core.waiting": SCAN,
    "core.sim_server": SERVES,
    "core.process.client": PROCESS,
    "core.process.client_handler": PROCESS,
    "core.process.clients": PROCESS,
    "core.process.listener": PROCESS,
    "core.process.persistence.faults": f"{PROCESS}; files are written beside the scan",
    "core.process.persistence.journal": f"{PROCESS}; files are written beside the scan",
    "core.process.persistence.plant_log": f"{PROCESS}; simulated drives there",
    "core.process.rescue": PROCESS,
    "core.process.rpc_client": PROCESS,
    "core.process.server": PROCESS,
    "core.process.session": PROCESS,
    "core.process.simulated_drives": PROCESS,
    "core.process.trajectory_feeder": f"{PROCESS}; a program's own code is called beside it",
    "core.process.watchdog_process": PROCESS,
    "drives.gim6010.bus.modbus_bus": f"{ADAPTER}: a serial port",
    "drives.gim6010.bus.one_module_line": PROCESS,
    "drives.gim6010.sim.modbus.terminal": SERVES,
    "sim.node.network": SERVES,
    "sim.socketcand_server": SERVES,
}


def real_names(tree):
    """The names of REAL_NAMES that a module uses, under whatever name they were imported."""
    modules, found = {}, set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            modules |= {each.asname or each.name: each.name for each in node.names if each.name in REAL_NAMES}
        elif isinstance(node, ast.ImportFrom):
            taken = REAL_NAMES.get(node.module, set())
            found |= {f"{node.module}.{each.name}" for each in node.names if each.name in taken}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            module = modules.get(node.value.id)
            if module is not None and node.attr in REAL_NAMES[module]:
                found.add(f"{module}.{node.attr}")
    return found


def test_only_listed_modules_bypass_the_clock_of_their_channel():
    """All others run in virtual time too: a wait in real time would keep the one thread that runs there."""
    paths = [path for package in IN_CLOCKED_PACKAGES for path in (SOURCE / package).rglob("*.py")]
    found = {
        ".".join(path.relative_to(SOURCE).with_suffix("").parts): names
        for path in paths
        if (names := real_names(ast.parse(path.read_text(encoding="utf-8"))))
    }
    assert {name: names for name, names in found.items() if name not in REAL_BY_NATURE} == {}
    assert (
        REAL_BY_NATURE.keys() - found.keys() == set()
    )  # and a module that does so no more is not on the list


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("import time\ntime.sleep(1)", {"time.sleep"}),
        ("import time as t\nasked = t.monotonic", {"time.monotonic"}),
        ("from time import perf_counter as now", {"time.perf_counter"}),
        ("import threading\nthreading.Timer(1, print)", {"threading.Timer"}),
        ("from axisbus.clock import REAL, Clock", {"axisbus.clock.REAL"}),
        ("import time, threading\ntime.time()\nthreading.Lock()\nclock.sleep(1)", set()),
    ],
)
def test_names_that_bypass_the_clock(text, names):
    assert real_names(ast.parse(text)) == names


# -- pages ----------------------------------------------------------------------------------------------------------------------

each_page = pytest.mark.parametrize("page", ALL_PAGES, ids=name_of)


@each_page
def test_every_file_that_a_page_names_is_there(page):
    named = re.findall(r"`((?:src|tests|examples|eds|docs)/[\w./-]+)`", text_of(page))
    assert [path for path in named if not (ROOT / path).exists()] == []


def test_the_pages_name_files():
    assert len(ALL_PAGES) > 10
    assert any("`src/" in text_of(page) for page in ALL_PAGES)


def anchors(page):
    """The anchors of the page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", re.sub(r"^```.*?^```", "", text_of(page), flags=re.S | re.M), re.M)
    return {re.sub(r"[^\w\- ]", "", heading).strip().lower().replace(" ", "-") for heading in headings}


def links(page):
    return re.findall(r"\]\((?!https?:)([^)\s#]*)#?([^)\s]*)\)", text_of(page))


@each_page
def test_every_link_of_a_page_has_a_target(page):
    for path, anchor in links(page):
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), path
        assert not anchor or anchor in anchors(target), f"{path}#{anchor}"


def test_every_page_is_reached_from_the_readme():
    reached, new = set(), {README}
    while new:
        reached |= new
        linked = {(page.parent / path).resolve() for page in new for path, _ in links(page) if path}
        new = (linked & set(ALL_PAGES)) - reached
    assert reached == set(ALL_PAGES)


def test_the_readme_is_short():
    assert len(text_of(README).split()) <= README_WORDS


# -- public names -----------------------------------------------------------------------------------------------------------------

API = {
    name: ROOT / "docs" / "api" / f"{name.rpartition('.')[2]}.md"
    for name in ("axisbus", "axisbus.drives", "axisbus.drives.gim6010", "axisbus.eds", "axisbus.errors")
} | {"axisbus.testing": ROOT / "docs" / "testing.md"}
# Members of public classes that are not for users: name, and purpose.
BETWEEN_ROOMS = {
    "Machine.disown": "a forked child gives its parent's machine up",
    "Machine.session": "Recorder attaches to the core by it",
    "Axis._absolute_command": "groups make commands by it",
    "Axis._absolute_increments": "groups make commands by it",
    "Axis._absolute_position": "groups make commands by it",
    "Axis._checked_position": "couplings are checked by it",
    "Axis._require_master": "couplings are checked by it",
    "Axis._require_homed": "couplings are checked by it",
    "Axis._stream_limits": "streams are checked by it",
    "Axis._require_at_start": "streams are checked by it",
    "Axis._require_stream_limits": "streams are checked by it",
    "Axis.room_from": "ways are checked by it",
    "Axis.increment": "ways by samples are as fine as that",
    "Axis.start_tolerance": "ways by samples begin where the axes stand",
    "Axis.scan_period": "paths of groups are made of what a cycle makes",
    "Axis.commanded_position": "paths of groups begin there",
    "Axis.unwrapped_position": "what an endless axis tells of its position is within it",
    "Axis.default_acceleration": "groups make commands by it",
    "FleetCell.axis_info": "its axes tell by it what the cell file says of them",
    "FleetCell._send_command": "its axes send commands by it",
    "FleetCell.last_state": "its axes and the tables of the command line read by it what was told last",
    "FleetCell.stop_axes": "its axes send stops by it",
    "Signal.point": "outputs are set by it",
    "Behaviour.of_axis": "a cell file overrides these keys",
    "Behaviour.lines": "boot-up and the command line show the behaviour by it",
    "DrivePlugin.detail": "of several plug-ins that match, the closest is used",
    "DrivePlugin.same_drives": "two drive files for the same drives are an error",
    "Handle._finish": "the end of its command ends a handle by it",
    "Handle._on_event": "what the core tells of its command reaches it so",
    "Handle.send": "asyncio drives a handle by it",
    "Handle.throw": "asyncio drives a handle by it",
    "Handle.close": "asyncio drives a handle by it",
    "ProbeHandle._finish": "as of a Handle",
    "ProbeHandle._on_event": "as of a Handle",
    "ProbeHandle.send": "as of a Handle",
    "ProbeHandle.throw": "as of a Handle",
    "ProbeHandle.close": "as of a Handle",
}
each_public_module = pytest.mark.parametrize("module", API)


def public(module):
    return set(importlib.import_module(module).__all__)


def sections(page):
    """The headings in code of a page, each with the names that begin a row of its tables."""
    found, names = {}, None
    for line in text_of(page).splitlines():
        if line.startswith("## "):
            names = found.setdefault(line.removeprefix("## ").strip("`") if "`" in line else "", set())
        elif line.startswith("### `"):
            names = found.setdefault(line.removeprefix("### ").strip("`"), set())
        elif names is not None and (row := re.match(r"\| `(\w+)[`(]", line)):
            names.add(row[1])
    return found


def members(what):
    """The names without underscore of a class: its methods, properties and fields, and those of its objects that it annotates."""
    return {name for name in (*dir(what), *getattr(what, "__annotations__", ())) if not name.startswith("_")}


@pytest.fixture(scope="module")
def cell():
    with Machine.simulated(ROOT / "examples" / "cell.toml") as cell:
        yield cell


@each_public_module
def test_the_page_of_a_public_module_names_all_that_is_public_and_nothing_else(module):
    found = sections(API[module])
    classes = {heading for heading in found if heading and "(" not in heading}
    assert classes | found.get("", set()) == public(module)


@each_public_module
def test_the_page_names_the_members_of_each_public_class(module, cell):
    group, halt = cell.group("x", "y"), cell["x"].halt()
    cam = Cam([(0.0, 0.0), (1.0, 1.0)])
    spare = Signal(
        IoPoint("lamp", 1, 0x6200, 1, 8, False, output=True, bit=0), cell.session, cell._commanding
    )
    given = {"Machine": cell, "Axis": cell["x"], "Cam": cam, "Group": group, "Handle": halt, "Signal": spare}
    for heading, named in sections(API[module]).items():
        what = getattr(importlib.import_module(module), heading, None)
        if not inspect.isclass(what):
            continue
        has = members(what) | set(
            vars(given.get(heading, object)) if hasattr(given.get(heading), "__dict__") else ()
        )
        has = {name for name in has if not name.startswith("_") and not hasattr(BaseException, name)}
        if issubclass(what, int):
            has -= set(dir(int))
        has -= {"name", "value"} if hasattr(what, "__members__") else set()
        assert {name for name in has - named if f"{heading}.{name}" not in BETWEEN_ROOMS} == set(), heading
        assert named - has == set(), heading


def test_the_objects_of_a_machine_have_the_names_on_the_page(cell):
    expressions = {heading: names for heading, names in sections(API["axisbus"]).items() if "(" in heading}
    assert len(expressions) == 2
    for expression, names in expressions.items():
        assert {name for name in names if name not in dir(eval(expression, {"cell": cell}))} == set()


@each_page
def test_a_page_names_no_module_and_no_name_that_is_not_public(page):
    for dotted in re.findall(r"`(axisbus(?:\.\w+)*)", text_of(page)):
        module = max((name for name in API if f"{dotted}.".startswith(f"{name}.")), key=len)
        rest = dotted.removeprefix(module).strip(".").partition(".")[0]
        assert not rest or rest in public(module), dotted


def test_the_programs_on_the_pages_import_only_public_names():
    for page, program in blocks_of_all("python"):
        for node in ast.walk(ast.parse(program)):
            if isinstance(node, ast.ImportFrom) and node.module.split(".")[0] == "axisbus":
                assert {alias.name for alias in node.names} <= public(node.module) | {"eds", "errors"}, page
            if isinstance(node, ast.Import):
                assert all(
                    alias.name in API or not alias.name.startswith("axisbus") for alias in node.names
                ), page


def test_every_exception_is_public_and_in_the_tree():
    errors = importlib.import_module("axisbus.errors")
    classes = {name: each for name, each in vars(errors).items() if inspect.isclass(each)}
    assert set(classes) == set(errors.__all__)
    (tree_of_the_page,) = blocks(API["axisbus.errors"], "text")
    tree = re.findall(r"^([│ ├└─]*)(\w+)", tree_of_the_page, re.M)
    path: list[str] = []
    for indent, name in tree:
        path[len(indent) // 4 :] = [name]
        assert len(path) == 1 or path[-2] == classes[name].__bases__[0].__name__, name
    assert {name for _, name in tree} == set(classes)


# -- the tests ---------------------------------------------------------------------------------------------------------

TESTS = ROOT / "tests"
FILES = sorted(TESTS.rglob("*.py"))
TOOL = TESTS / "mutation"  # a separate package
IMPORT = re.compile(r"^ *(?:from|import) ([\w.]+)", re.MULTILINE)


def test_no_test_imports_another_test_or_a_file_of_its_folder():
    rooms = [path for path in FILES if not {TESTS / "kit", TOOL} & set(path.parents)]
    shared = {path.stem for path in rooms}
    found = {
        (file.name, name)
        for file in FILES
        for name in IMPORT.findall(file.read_text(encoding="utf-8"))
        if name.split(".")[0] in shared
    }
    assert found == set()


def test_no_test_puts_a_folder_on_the_path():
    changing = re.compile(r"\bsys\.path(\.(insert|append|extend)|\[.*\] *=[^=])")
    assert [file.name for file in FILES if changing.search(file.read_text(encoding="utf-8"))] == []


@pytest.mark.parametrize("name", sorted(NAMES | IN_REAL_TIME | IN_VIRTUAL_TIME))
def test_every_test_named_as_slow_or_with_a_time_exists(name):
    path, _, function = name.partition("::")
    assert (TESTS / path).exists()
    assert not function or re.search(rf"^ *def {function}\(", (TESTS / path).read_text("utf-8"), re.MULTILINE)


def test_each_test_in_real_time_is_named_once_with_its_reason_and_not_in_virtual_time():
    names = [name for names in REAL_TIME.values() for name in names]
    assert len(names) == len(set(names))
    assert all(reason.strip() for reason in REAL_TIME)
    assert set() == IN_REAL_TIME & IN_VIRTUAL_TIME
