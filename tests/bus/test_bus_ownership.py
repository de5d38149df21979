"""A CAN channel has one owner on this computer, until the last of its processes is gone."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
import threading
import time
from contextlib import suppress

import pytest

from axisbus.bus.link import claims, ownership
from axisbus.bus.link.claims import CellFileId, ChannelClaim
from axisbus.bus.link.ownership import Adapter
from axisbus.errors import SecondMasterError
from kit.other_user import STRANGER, as_user, needs_root

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the lock is one of Linux")
NAME = f"test{os.getpid()}"
HOLD = """\
import time, sys
from axisbus.bus.link import ownership
lock = ownership.take("pcan", sys.argv[1])
print("has it", flush=True)
time.sleep(30)
"""


def test_a_channel_is_taken_once_and_free_again_when_it_is_given_back():
    lock = ownership.take("pcan", NAME)
    assert lock is not None
    with pytest.raises(SecondMasterError, match=f"pcan:{NAME}"):
        ownership.take("pcan", NAME)
    other = ownership.take("pcan", f"{NAME}-2")
    assert other is not None
    other.close()
    lock.close()
    again = ownership.take("pcan", NAME)
    assert again is not None
    again.close()


@pytest.mark.parametrize("interface", ["virtual", "udp_multicast"])
def test_a_bus_without_an_adapter_may_be_shared(interface):
    assert ownership.take(interface, NAME) is None


def test_another_program_that_has_it_is_named_and_its_death_frees_it():
    with subprocess.Popen([sys.executable, "-c", HOLD, NAME], stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline().strip() == "has it"
        with pytest.raises(SecondMasterError) as caught:
            ownership.take("pcan", NAME)
        assert f"process {holder.pid} (" in caught.value.observed
        assert "import time, sys" in caught.value.observed
        assert "axisbus stop" in caught.value.remedy
        assert caught.value.heard
        assert ownership.take("pcan", NAME, beside=True) is None
        holder.kill()
        holder.wait()
    lock = _taken_soon()
    lock.close()


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.2, "0 s"),
        (7.0, "7 s"),
        (119.4, "119 s"),
        (120.0, "2 min"),
        (600.0, "10 min"),
        (7199.0, "120 min"),
        (7200.0, "2.0 h"),
        (36000.0, "10.0 h"),
    ],
)
def test_the_age_of_a_program_is_reported_in_whole_seconds_minutes_or_in_hours(seconds, text):
    assert ownership._ago(seconds) == text


def test_a_program_is_reported_by_its_command_and_its_age_and_one_that_has_ended_as_that():
    text = ownership.described(os.getpid())
    assert re.fullmatch(rf"process {os.getpid()} \(.+\), which began \d+(\.\d)? (s|min|h) ago", text)
    assert re.search(r", which began at \d\d:\d\d:\d\d$", ownership.described(os.getpid(), kept=True))
    with subprocess.Popen(["true"]) as ended:
        ended.wait()
    assert ownership.described(ended.pid).startswith(f"process {ended.pid}, which has ended")


def test_the_age_of_a_program_counts_from_its_own_start():
    with subprocess.Popen(["sleep", "30"]) as young:
        text = ownership.described(young.pid)
        young.kill()
    assert re.search(r" \(.*\), which began \d\d? s ago$", text), text


def test_after_any_number_of_refusals_the_next_one_is_immediate_and_names_the_owner():
    """No process takes their requests out of the queue of the owner."""
    lock = ownership.take("pcan", NAME)
    assert lock is not None
    refused = []

    def ask() -> None:
        for _ in range(300):
            with pytest.raises(SecondMasterError) as caught:
                ownership.take("pcan", NAME)
            refused.append(caught.value)

    with lock:
        asking = threading.Thread(target=ask, daemon=True)
        asking.start()
        asking.join(60.0)
        assert len(refused) == 300
        assert {error.observed.partition(" (")[0] for error in refused} == {
            f"it is used by process {os.getpid()}"
        }
        assert "starting a machine (axisbus run), wait until it has booted" in refused[0].remedy
    asking.join(10.0)


def test_a_process_that_has_inherited_the_lock_keeps_it_after_its_owner_closed_it():
    lock = ownership.take("pcan", NAME)
    assert lock is not None
    with subprocess.Popen(["sleep", "30"], pass_fds=[lock.fileno()]) as child:
        lock.close()
        with pytest.raises(SecondMasterError):
            ownership.take("pcan", NAME)
        child.kill()
        child.wait()
    _taken_soon().close()


def _taken_soon():
    until = time.monotonic() + 5.0
    while True:
        try:
            lock = ownership.take("pcan", NAME)
        except SecondMasterError:
            if time.monotonic() > until:
                raise
            time.sleep(0.01)
            continue
        assert lock is not None
        return lock


# -- whose claim keeps others off ------------------------------------------------------------------------------------------------


def claimed(user, name="\0axisbus", group=STRANGER):
    return ChannelClaim(name, True, False, "-", CellFileId.of(None), "", 1, user, group)


def linked(tmp_path, monkeypatch, *rows):
    """A kernel that lists these filters of its CAN links."""
    (tmp_path / "net/can").mkdir(parents=True)
    head = "\nreceive list 'rx_fil':\n  device   can_id   can_mask  function  userdata   matches  ident\n"
    (tmp_path / "net/can/rcvlist_fil").write_text(head + "".join(rows), encoding="utf-8")
    monkeypatch.setattr(claims, "_PROC", tmp_path)
    return Adapter("socketcan:can0", True, "can0")


@pytest.mark.parametrize(
    "adapter", [Adapter("pcan:x"), Adapter("socketcan:can0", True), Adapter("device:/x")]
)
def test_a_claim_of_the_same_user_or_of_root_counts_on_every_adapter(adapter):
    assert ownership._counts(claimed(os.geteuid()), adapter)
    assert ownership._counts(claimed(0), adapter)


@pytest.mark.parametrize("user", [STRANGER, claims.UNKNOWN_ID])
def test_on_socketcan_the_claim_of_another_user_counts_only_with_the_link_open(user, tmp_path, monkeypatch):
    name = "\0axisbus mine"
    can_id, mask = claims._filter(name)
    assert can_id & 0xC0000000 == 0xC0000000  # a remote frame with an extended identifier: CANopen has none
    assert not ownership._counts(
        claimed(user, name), Adapter("socketcan:can0", True)
    )  # there is no such link
    row = f"   can0  {can_id:08x}  {mask:08x}  0000000000000000  0000000000000000         0  raw\n"
    others = [row.replace("can0", "can1"), row.replace(f"{can_id:08x}", "c0000123"), "\n", "   any\n"]
    adapter = linked(tmp_path, monkeypatch, *others)
    assert not ownership._counts(claimed(user, name), adapter)
    with (tmp_path / "net/can/rcvlist_fil").open("a") as file:
        file.write(row)
    assert ownership._counts(claimed(user, name), adapter)
    assert not ownership._counts(claimed(user, "\0axisbus other"), adapter)


@pytest.mark.parametrize(
    ("mode", "owner", "group", "counts"),
    [
        (0o660, 0, 0, False),
        (0o660, 0, STRANGER, True),
        (0o640, 0, STRANGER, False),
        (0o600, STRANGER, 0, True),
        (0o666, 0, 0, True),
        (0o606, 0, STRANGER, False),
    ],
)
@needs_root
def test_on_a_device_file_the_claim_of_another_user_counts_if_that_user_may_open_it(
    tmp_path, mode, owner, group, counts
):
    device = tmp_path / "tty"
    device.touch()
    os.chown(device, owner, group)
    device.chmod(mode)
    assert ownership._counts(claimed(STRANGER), Adapter("device:1:1", device=device)) is counts


def test_if_the_owner_cannot_be_verified_the_claim_of_another_user_counts():
    assert ownership._counts(claimed(STRANGER), Adapter("pcan:PCAN_USBBUS1"))


@needs_root
@pytest.mark.parametrize("name", ["axisbus socketcan:can7", "axisbus xn {key} - - 0000000000000000aaaaaaaa"])
def test_a_socket_of_another_user_without_a_bus_excludes_no_program(name):
    name = "\0" + name.format(key=claims.digest("socketcan:can7"))
    with as_user(lambda: claims.HeldClaim(name, None)):
        assert claims._holder(name, "0")[1] == STRANGER
        lock = ownership.take("socketcan", "can7")
        assert lock is not None
        with lock, pytest.raises(SecondMasterError, match=r"can7"):
            ownership.take("socketcan", "can7")
    assert "socketcan:can7" not in str(ownership.holder("socketcan", "can7"))


@needs_root
def test_two_users_of_one_adapter_exclude_each_other_and_the_other_one_is_named():
    with as_user(lambda: ownership.take("pcan", NAME)):
        with pytest.raises(SecondMasterError, match=f"of user {STRANGER}"):
            ownership.take("pcan", NAME)
        assert ownership.take("pcan", NAME, beside=True) is None
    _taken_soon().close()


@needs_root
def test_a_claim_of_another_user_whose_queue_is_full_is_still_found():
    with as_user(lambda: claims.HeldClaim("\0axisbus xn - - - 0000000000000000bbbbbbbb", None)) as holder:
        name, waiting = "\0axisbus xn - - - 0000000000000000bbbbbbbb", []
        with suppress(BlockingIOError):
            for _ in range(claims._BACKLOG + 10):
                waiting.append(socket.socket(socket.AF_UNIX))
                waiting[-1].setblocking(False)
                waiting[-1].connect(name)
        assert len(waiting) < claims._BACKLOG + 10
        inode = dict(claims._listening())[name]
        assert claims._holder(name, inode) == (holder, STRANGER, STRANGER)  # root sees every descriptor
        for line in waiting:
            line.close()


# -- names of one adapter --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("interface", "channel", "same"),
    [
        (
            "socketcan",
            "can1",
            [("socketcan_native", "can1"), ("SocketCAN", " can1 "), ("socketcan_ctypes", "can1")],
        ),
        ("pcan", "PCAN_USBBUS1", [("PCAN", "PCAN_USBBUS1 "), ("pcan", 81), ("pcan", "81")]),
        ("kvaser", 0, [("kvaser", "0"), ("Kvaser", "00"), ("kvaser", " 0")]),
        (
            "slcan",
            "/dev/null@115200",
            [("slcan", "/dev/null"), ("modbus", "/dev/../dev/null"), ("robotell", "/dev/null@9600")],
        ),
        ("socketcan", "lo", [("socketcan", "lo ")]),
    ],
)
def test_names_of_one_adapter_are_one_channel(interface, channel, same):
    assert {Adapter.of(*each).key for each in same} == {Adapter.of(interface, channel).key}


def test_a_device_under_two_links_is_one_channel(tmp_path):
    (tmp_path / "by-id").symlink_to("/dev/null")
    assert Adapter.of("slcan", str(tmp_path / "by-id")) == Adapter.of("slcan", "/dev/null")
    assert Adapter.of("slcan", "/dev/null").key != Adapter.of("slcan", "/dev/zero").key


def test_other_adapters_are_other_channels():
    names = [
        ("socketcan", "can0"),
        ("socketcan", "CAN0"),
        ("pcan", "can0"),
        ("kvaser", 0),
        ("kvaser", 1),
        ("kvaser", None),
    ]
    assert len({Adapter.of(*each).key for each in names}) == len(names)


def test_other_names_of_an_interface_without_an_adapter_take_nothing():
    assert ownership.take("Virtual ", NAME) is None


# -- at the same time ------------------------------------------------------------------------------------------------------------


def test_of_many_that_take_a_channel_at_the_same_time_exactly_one_has_it():
    for _ in range(5):
        begin, locks, refused = threading.Barrier(6), [], []

        def take(begin=begin, locks=locks, refused=refused) -> None:
            begin.wait(10)
            try:
                locks.append(ownership.take("pcan", NAME))
            except SecondMasterError as error:
                refused.append(error)

        threads = [threading.Thread(target=take) for _ in range(6)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(30)
        assert (len(locks), len(refused)) == (1, 5)
        locks[0].close()


@pytest.mark.parametrize("stays", [True, False])
def test_a_process_that_sees_another_claim_after_making_its_own_withdraws_and_retries(monkeypatch, stays):
    """The other one has looked before this claim was there, and so may have the channel."""
    key, made, rivals = Adapter.of("pcan", NAME).key, claims.claim, []

    def claim(*arguments, **options):
        own = made(*arguments, **options)
        if not rivals:
            rivals.append(made(key, CellFileId.of(None), exclusive=True, accepts_clients=False))
        return own

    def wait(_):
        if not stays:
            rivals[0].close()

    monkeypatch.setattr(ownership, "claim", claim)
    monkeypatch.setattr(ownership.time, "sleep", wait)
    if stays:
        with pytest.raises(SecondMasterError):
            ownership.take("pcan", NAME)
        rivals[0].close()
    else:
        lock = ownership.take("pcan", NAME)
        assert lock is not None
        lock.close()
    assert ownership.holder("pcan", NAME) is None
