"""``axisbus lss`` as its user types it, on a simulated cell whose node 2 waits for a node-ID."""

import json
from functools import partial

import pytest

from axisbus.bus import lss as bus_lss
from axisbus.bus.link import bitrate_change
from axisbus.bus.link.bitrate_change import Opening
from axisbus.bus.lss import LssMaster
from axisbus.cia305.scan_result import Check, Scanned, Unconfigured
from axisbus.cia305.services import LssAddress
from axisbus.cli.groups import LSS_COMMANDS
from axisbus.cli.lss import set_bitrate as lss_set_bitrate
from axisbus.sim.fault_injection import LssFaults

CELL = """
[bus]
interface = "sim"
scan_period = "4ms"
[bus.options]
unconfigured = {unconfigured}
[nodes.1]
eds = "builtin:gim6010-8"
[nodes.2]
eds = "builtin:gim6010-8"
"""
WHO = ("-s", "0xC0B00", 0, 0, 2)
PATIENT = ("--timeout", "0.05")


@pytest.fixture
def lss(axisbus):
    return partial(axisbus, "lss")


@pytest.fixture
def cell(tmp_path):
    return written(tmp_path, [2])


def written(folder, unconfigured):
    path = folder / "cell.toml"
    path.write_text(CELL.format(unconfigured=unconfigured))
    return path


def test_find_lists_slaves_without_a_node_id_and_the_next_command(lss, cell):
    code, out, _ = lss("find", cell, *PATIENT)
    assert code == 0
    assert "1 without a node-ID:\n  vendor 0xC0B00, product 0x0, revision 0x0, serial 0x2\n" in out
    assert f"axisbus lss set-node-id NODE_ID {cell} -s 0xC0B00 0x0 0x0 0x2 --store" in out


def test_find_as_json_with_known_numbers(lss, cell):
    code, out, _ = lss(
        "find", cell, "--vendor", "0xC0B00", "--revision", 0, "--json", "--beside-operation", *PATIENT
    )
    assert code == 0
    assert json.loads(out) == {
        "slaves": [
            {
                "vendor_id": 0xC0B00,
                "product_code": 0,
                "revision_number": 0,
                "serial_number": 2,
                "twins": False,
                "answers_on": False,
                "check": "not_needed",
                "node_id": None,
            }
        ],
        "others": False,
        "incomplete": None,
    }


def test_find_if_every_node_has_a_node_id(lss, tmp_path):
    code, out, _ = lss("find", written(tmp_path, []), "--beside-operation")
    assert code == 1
    assert "no LSS slave without a node-ID answers" in out
    assert "next: to list nodes with a node-ID: axisbus scan" in out


def test_find_if_there_are_only_slaves_of_another_vendor(lss, cell):
    code, out, _ = lss("find", cell, "--vendor", 5, "--beside-operation")
    assert code == 1
    assert "there are other slaves without a node-ID" in out


def test_inquire(lss, cell):
    code, out, _ = lss("inquire", cell, *WHO, "--beside-operation")
    assert (code, "no node-ID\n" in out) == (0, True)
    code, out, _ = lss("inquire", cell, "-s", "0xC0B00", 0, 0, 2, "--json", "--beside-operation")
    assert json.loads(out)["node_id"] is None


def test_set_node_id_of_the_one_that_is_found(lss, cell):
    code, out, _ = lss("set-node-id", 7, cell, "--found", "--store", "--beside-operation", *PATIENT)
    assert code == 0
    assert "serial 0x2: node-ID 7, stored" in out
    assert "it booted as node 7" in out
    assert f"next: axisbus scan {cell}" in out


@pytest.fixture
def stubborn(monkeypatch):
    """The simulated drives continue answering fast scan after they were found."""
    plain = LssFaults.__init__

    def turned(self, *values, **named):
        plain(self, *values, **named)
        self.answers_on = True

    monkeypatch.setattr(LssFaults, "__init__", turned)


KNOWN = ("--vendor", "0xC0B00", "--product", 0, "--revision", 0)


def test_find_reports_slaves_that_continue_answering_and_finds_the_others(lss, tmp_path, stubborn):
    both = written(tmp_path, [1, 2])
    code, out, _ = lss("find", both, *KNOWN, "--beside-operation", "--timeout", "0.02")
    assert code == 0
    note = (
        "    continues to answer fast scan after it was found, against CiA 305: it was excluded by its address\n"
        "    address: the four numbers were read from it and are the same\n"
    )
    assert out.startswith(
        "2 without a node-ID:\n"
        f"  vendor 0xC0B00, product 0x0, revision 0x0, serial 0x1\n{note}"
        f"  vendor 0xC0B00, product 0x0, revision 0x0, serial 0x2\n{note}"
        f"next: give each a node-ID: axisbus lss set-node-id NODE_ID {both} -s 0xC0B00 0x0 0x0 0x1 --store"
    )


def test_find_reports_a_slave_that_continues_answering_as_json(lss, cell, monkeypatch):
    told = Scanned((one_slave(check=Check.CONFIRMED, node_id=5),), incomplete="reason")
    monkeypatch.setattr(LssMaster, "find", lambda *_: told)
    code, out, _ = lss("find", cell, "--beside-operation", "--json")
    assert code == 1
    assert json.loads(out) == {
        "slaves": [
            {
                "vendor_id": 1,
                "product_code": 2,
                "revision_number": 3,
                "serial_number": 4,
                "twins": False,
                "answers_on": True,
                "check": "confirmed",
                "node_id": 5,
            }
        ],
        "others": False,
        "incomplete": "reason",
    }


def test_set_node_id_of_the_found_slave_that_continues_answering(lss, cell, stubborn):
    code, out, _ = lss(
        "set-node-id", 7, cell, "--found", "--store", "--beside-operation", "--timeout", "0.02"
    )
    assert (code, "it booted as node 7" in out) == (0, True)
    assert "serial 0x2: node-ID 7, stored" in out


@pytest.mark.parametrize("store", [False, True])
def test_a_slave_that_does_not_boot_is_not_switched_off_with_a_node_id_that_is_not_stored(
    lss, cell, monkeypatch, store
):
    monkeypatch.setattr(bus_lss, "_boots", lambda _: False)
    more = ["--store"] if store else []
    code, out, _ = lss("set-node-id", 7, cell, "--found", "--beside-operation", *PATIENT, *more)
    assert code == 3
    assert "--reset" in out
    assert ("switch it off and on" in out) is store
    assert ("do not switch it off" in out) is not store


def one_slave(**told):
    return Unconfigured(LssAddress(1, 2, 3, 4), answers_on=True, **told)


@pytest.mark.parametrize(
    ("scanned", "code", "words"),
    [
        (Scanned((), incomplete="reason"), 1, "NOT ALL MAY HAVE BEEN FOUND: reason\n"),
        (
            Scanned((one_slave(node_id=5),)),
            0,
            "serial 0x4, has node-ID 5 and answers fast scan nevertheless\n",
        ),
        (
            Scanned((one_slave(check=Check.UNSELECTABLE),)),
            0,
            "address: it cannot be selected by its address: only the only slave on a bus can be set so\n"
            "next: connect only this slave, and give it a node-ID: axisbus lss set-node-id NODE_ID {cell} --only --store",
        ),
        (Scanned((one_slave(check=Check.SILENT),)), 0, "address: it does not report its numbers"),
    ],
)
def test_uncertain_results_of_find_are_reported(lss, cell, monkeypatch, scanned, code, words):
    monkeypatch.setattr(LssMaster, "find", lambda *_: scanned)
    done, out, _ = lss("find", cell, "--beside-operation")
    assert (done, words.format(cell=cell) in out) == (code, True), out


@pytest.mark.parametrize(
    ("scanned", "words"),
    [
        (Scanned((one_slave(),), incomplete="somebody hides the others"), "somebody hides the others"),
        (Scanned((one_slave(node_id=5),)), "no LSS slave without a node-ID answers"),
        (
            Scanned((one_slave(check=Check.UNSELECTABLE),)),
            "the LSS slave 0x1 0x2 0x3 0x4 cannot be selected by its address",
        ),
    ],
)
def test_an_ambiguous_found_slave_is_not_configured(lss, cell, monkeypatch, scanned, words):
    monkeypatch.setattr(LssMaster, "find", lambda *_: scanned)
    code, out, err = lss("set-node-id", 7, cell, "--found", "--beside-operation")
    assert (code, out, words in err) == (1, "", True)


def test_set_node_id_that_another_node_has(lss, cell):
    code, out, err = lss("set-node-id", 1, cell, *WHO)
    assert (code, out) == (1, "")
    assert "node-ID 1 is in use" in err


def test_set_node_id_as_json(lss, cell):
    code, out, _ = lss("set-node-id", 7, cell, *WHO, "--json", "--beside-operation")
    assert code == 0
    told = json.loads(out)
    assert (told["old_node_id"], told["node_id"], told["stored"], told["booted"]) == (255, 7, False, True)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("set-node-id", 7), "name the slave by one of these"),
        (("set-node-id", 7, *WHO, "--only"), "name the slave by one of these"),
        (("set-node-id", 0, *WHO), "node-ID 0 cannot be assigned"),
        (("set-node-id", "x", *WHO), "'x' is not a number"),
        (("set-node-id", 7, "-s", 1, 2, 3, 1 << 32), "not a number of 32 bits"),
        (("inquire", *WHO, "--timeout", 0), "is not a valid time"),
        (("set-bitrate", 100_000, *WHO, "--yes"), "no bit rate of 100000"),
        (("set-bitrate", 500_000, "--yes"), "name the slaves"),
        (("set-bitrate", 500_000, *WHO, "--all", "--yes"), "name the slaves"),
        (("set-bitrate", 500_000, *WHO, "--activate", "--delay", 99, "--yes"), "switch delay of 99 s"),
        (("find",), "give a cell file, or the bus with -i and -c"),
    ],
)
def test_misuse_is_reported_before_the_bus_is_opened(lss, arguments, words):
    code, out, err = lss(*arguments)
    assert (code, out) == (2, "")
    assert words in err


def test_set_bitrate_warns_of_other_nodes_and_needs_yes(lss, cell):
    code, out, err = lss("set-bitrate", 500_000, cell, *WHO, "--activate")
    assert (code, out) == (2, "")
    assert "loses every node that does not" in err
    assert "--yes" in err


def test_set_bitrate_without_activation_changes_nothing_yet(lss, cell):
    code, out, _ = lss("set-bitrate", 500_000, cell, *WHO, "--store", "--yes", "--beside-operation")
    assert code == 0
    assert "set: 500000 bit/s, stored" in out
    assert "nothing has changed yet: the new rate applies from their next power-up" in out
    assert f"axisbus scan {cell} -b 500000" in out


def test_set_bitrate_of_all_with_activation(lss, cell):
    code, out, _ = lss(
        "set-bitrate",
        500_000,
        cell,
        "--all",
        "--activate",
        "--delay",
        0.02,
        "--yes",
        "--json",
        "--beside-operation",
    )
    assert code == 0
    assert json.loads(out) == {
        "bitrate": 500_000,
        "slaves": "all",
        "stored": False,
        "activated": True,
        "adapter": "none",
        "asked": True,
        "answered": [],
        "silent": [],
        "nodes": [1],
        "commands": [],
    }


def test_set_bitrate_of_one_with_activation_reports_that_it_answers(lss, cell):
    code, out, _ = lss(
        "set-bitrate",
        500_000,
        cell,
        *WHO,
        "--activate",
        "--delay",
        0.02,
        "--yes",
        "--beside-operation",
        *PATIENT,
    )
    assert code == 0
    assert "set: 500000 bit/s, changed over; the adapter of this computer has no rate" in out
    assert "not stored: after the next power-up they have the old rate again" in out
    assert "  answers at 500000 bit/s: 0xC0B00 0x0 0x0 0x2" in out
    assert f"next: axisbus scan {cell} -b 500000" in out


def test_set_bitrate_on_a_system_link_prints_the_lines_to_type_in_order(lss, cell, monkeypatch):
    """The simulated bus passed off as can0: its rate is the system's, so no slave is asked at the new one."""
    monkeypatch.setattr(lss_set_bitrate, "opening_of", lambda *_: Opening("socketcan", "can0", 1_000_000))
    code, out, _ = lss(
        "set-bitrate", 250_000, cell, "--all", "--activate", "--delay", 0.02, "--yes", "--beside-operation"
    )
    assert code == 0
    lines = out.splitlines()
    at = lines.index(
        "THE BUS IS HALF CHANGED OVER: this computer still has the old rate, and would destroy the slaves' frames"
    )
    assert lines[at + 1 : at + 5] == [
        "type, in this order:",
        "  sudo ip link set can0 down",
        "  sudo ip link set can0 up type can bitrate 250000 restart-ms 100",
        "  sudo ip link set can0 txqueuelen 1000",
    ]
    assert lines[-1] == f"next: axisbus scan {cell} -b 250000"


def test_an_interrupted_change_over_warns_that_the_slaves_continue(lss, cell, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(bitrate_change, "change_over", interrupted)
    code, _, err = lss("set-bitrate", 250_000, cell, "--all", "--activate", "--yes", "--beside-operation")
    assert code == 130
    assert (
        f"the slaves may nevertheless be changing over to 250000 bit/s: check with axisbus scan {cell} -b 250000"
        in err
    )


def test_a_slave_that_does_not_change_its_rate_is_named_and_sets_the_exit_code(lss, cell, monkeypatch):
    there, gone = LssAddress(0xC0B00, 0, 0, 2), LssAddress(0xC0B00, 0, 0, 3)
    done = bitrate_change.ChangedOver(
        250_000, bitrate_change.OwnRate.REOPENED, answered=(there,), silent=(gone,)
    )
    monkeypatch.setattr(bitrate_change, "change_over", lambda *_: done)
    code, out, _ = lss("set-bitrate", 250_000, cell, *WHO, "--activate", "--yes", "--beside-operation")
    assert code == 3
    assert "  answers at 250000 bit/s: 0xC0B00 0x0 0x0 0x2" in out
    assert "  DOES NOT ANSWER at 250000 bit/s: 0xC0B00 0x0 0x0 0x3" in out
    assert "THE BUS IS HALF CHANGED OVER: switch the silent slaves off and on" in out


def test_store(lss, cell):
    code, out, _ = lss("store", cell, *WHO, "--beside-operation")
    assert (code, "stored: node-ID and bit rate survive a power-off" in out) == (0, True)


def test_a_slave_that_is_not_there_is_a_failure_of_the_bus(lss, cell):
    code, out, err = lss("inquire", cell, "-s", 1, 2, 3, 4, "--beside-operation")
    assert (code, out) == (3, "")
    assert "no LSS slave has the identity 0x1 0x2 0x3 0x4" in err


def test_only_is_refused_if_two_slaves_answer(lss, cell):
    code, _, err = lss("store", cell, "--only", "--beside-operation")
    assert code == 3
    assert "several LSS slaves answered inquire vendor-ID" in err


def test_unconfigured_must_name_nodes_of_the_cell(lss, tmp_path):
    code, _, err = lss("find", written(tmp_path, [9]))
    assert code == 1
    assert "unconfigured = [9] is not a list of nodes of this cell" in err


@pytest.mark.parametrize("name", LSS_COMMANDS)
def test_each_lss_subcommand_has_help(lss, name):
    code, out, _ = lss(name, "-h")
    assert code == 0
    assert f"axisbus lss {name} [OPTIONS]" in out.splitlines()[0]
