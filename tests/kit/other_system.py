"""Play Windows or macOS on Linux, as far as possible: a process in which the modules and names are missing that the system lacks.

On Windows texts have its line ends and its code page, where the program does not say otherwise, and names of files its limits. The
modules of Python and of other packages are imported before that, so they are those of Linux. A success proves that axisbus needs
nothing that is missing there; it proves nothing about an adapter, its driver or the real time.
"""

from __future__ import annotations

import builtins
import errno
import fnmatch
import importlib
import io
import os
import stat
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from types import ModuleType

from kit.pages import ROOT

MODULES = {
    "win32": (
        "fcntl termios resource pwd grp tty pty syslog curses readline posix spwd crypt nis _curses _posixshmem "
        "_posixsubprocess"
    ),
    "darwin": ("spwd"),
}
# Names that a module lacks there.
MISSING = {
    "win32": {
        "os": (
            "fork forkpty register_at_fork geteuid getuid getgid getegid getgroups getgrouplist setuid setgid "
            "seteuid setegid getpgid getpgrp setpgid setsid getsid killpg nice getpriority setpriority PRIO_* "
            "sched_* SCHED_* uname sysconf sysconf_names confstr openpty ttyname ctermid tcgetpgrp tcsetpgrp "
            "login_tty fchmod fchown chown lchown chroot mkfifo mknod statvfs fstatvfs WNOHANG WUNTRACED wait "
            "wait3 wait4 waitid WIF* WEXITSTATUS WTERMSIG pidfd_open memfd_create MFD_* eventfd* EFD_* O_NOFOLLOW "
            "O_CLOEXEC O_DIRECTORY O_NONBLOCK O_SYNC O_DSYNC O_NOCTTY O_PATH set_blocking get_blocking sendfile "
            "posix_* pread pwrite preadv pwritev readv writev getloadavg sync fdatasync lockf initgroups pipe2 "
            "getrandom getxattr setxattr listxattr removexattr fchdir fpathconf pathconf copy_file_range splice "
            "major minor makedev"
        ),
        "signal": (
            "SIGHUP SIGQUIT SIGKILL SIGUSR1 SIGUSR2 SIGALRM SIGTSTP SIGCONT SIGSTOP SIGCHLD SIGPIPE SIGTTIN "
            "SIGTTOU SIGWINCH SIGPOLL SIGRT* pthread_* sigwait* sigtimedwait sigpending setitimer getitimer alarm "
            "pause siginterrupt pidfd_send_signal ITIMER_*"
        ),
        "_socket": (
            "AF_UNIX AF_CAN PF_CAN CAN_* SOL_CAN_* AF_PACKET AF_NETLINK AF_VSOCK SO_PEERCRED SO_PASSCRED "
            "SO_REUSEPORT SO_BINDTODEVICE SO_PRIORITY SO_MARK MSG_DONTWAIT MSG_NOSIGNAL SOCK_NONBLOCK "
            "SOCK_CLOEXEC SCM_* socketpair"
        ),
        "socket": ("send_fds recv_fds"),
        "time": ("clock_gettime* clock_settime* clock_getres CLOCK_* tzset pthread_getcpuclockid"),
        "select": ("poll epoll EPOLL* POLL*"),
        "mmap": ("MAP_* PROT_* MADV_*"),
    },
    "darwin": {
        "os": (
            "sched_getscheduler sched_setscheduler sched_getparam sched_setparam sched_param sched_getaffinity "
            "sched_setaffinity sched_rr_get_interval SCHED_* pidfd_open memfd_create MFD_* eventfd* EFD_* O_PATH "
            "posix_fadvise posix_fallocate fdatasync pipe2 getrandom getxattr setxattr listxattr removexattr "
            "copy_file_range splice"
        ),
        "signal": ("SIGPOLL SIGRT* sigtimedwait sigwaitinfo pidfd_send_signal"),
        "_socket": (
            "AF_CAN PF_CAN CAN_* SOL_CAN_* AF_PACKET AF_NETLINK AF_VSOCK SO_PEERCRED SO_PASSCRED SO_BINDTODEVICE "
            "SO_PRIORITY SO_MARK SOCK_NONBLOCK SOCK_CLOEXEC SCM_CREDENTIALS"
        ),
        "time": ("CLOCK_BOOTTIME CLOCK_MONOTONIC_RAW CLOCK_TAI"),
        "select": ("epoll EPOLL*"),
        "mmap": ("MAP_POPULATE MAP_DENYWRITE MAP_EXECUTABLE"),
    },
}
# Packages that look for the system when they are imported.
OTHERS = (
    "asyncio concurrent.futures.process ctypes getpass http.server multiprocessing.shared_memory platform pydoc "
    "shutil socketserver ssl subprocess tempfile urllib.request uuid webbrowser zipfile can "
    "can.interfaces.virtual can.interfaces.socketcan canopen click msgspec rich.live rich.progress rich.table"
)
OF_EXTRAS = (
    "asyncua cantools matplotlib.pyplot mcap.writer nicegui odrive prometheus_client pyarrow.parquet "
    "pymodbus.client pymodbus.server rosbags serial serial.tools.list_ports uvicorn uvloop zenoh"
)
FORBIDDEN = frozenset('<>:"|?*')  # in the name of a file of Windows


SYSTEMS = tuple(MODULES)


def played(
    system: str, *words: str, folder: Path, code: str = "", others: str = ""
) -> subprocess.CompletedProcess[bytes]:
    """Run axisbus with these words, or a program, as on another system; ``others``: packages to be imported before."""
    program = code or "import sys; from axisbus.cli.main import main; main()"
    whole = (
        f"from kit.other_system import OTHERS, play; play({system!r}, OTHERS + {' ' + others!r})\n{program}"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT / "src"), str(ROOT / "tests")])}
    return subprocess.run(
        [sys.executable, "-c", whole, *words],
        cwd=folder,
        env=environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=False,
    )


def play(system: str, others: str = OTHERS) -> None:
    """Become a process of ``system``, as far as Linux can; ``others`` are imported before."""
    assert "socket" not in sys.modules, "socket has read its names already"
    take_away(system, "_socket")  # socket then makes its pairs of TCP, as on Windows
    for name in others.split():
        with suppress(ImportError):
            importlib.import_module(name)
    for name in MISSING[system].keys() - {"_socket"}:
        take_away(system, name)
    msvcrt = locks_of_windows()
    for name in MODULES[system].split():
        sys.modules[name] = None  # type: ignore[assignment]
    sys.platform = system
    import selectors
    import shutil
    import ssl

    shutil._USE_CP_SENDFILE = False  # type: ignore[attr-defined]  # of Linux
    selectors.DefaultSelector = selectors.PollSelector  # of macOS it would be the one of kqueue
    if system == "win32":
        sys.modules["msvcrt"] = msvcrt
        ssl.enum_certificates = lambda _: []  # type: ignore[attr-defined]
        write_as_windows()
        sockets_as_windows()


def locks_of_windows() -> ModuleType:
    """Return the functions of ``msvcrt`` for locks, by those of Linux."""
    import fcntl

    def locking(file: int, mode: int, count: int) -> None:
        assert (mode, count) == (module.LK_NBLCK, 1)
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)

    module = ModuleType("msvcrt")
    module.LK_NBLCK, module.locking = 2, locking  # type: ignore[attr-defined]
    return module


def take_away(system: str, name: str) -> None:
    """Delete the names that a module lacks there."""
    module = importlib.import_module(name)
    for pattern in MISSING[system][name].split():
        for each in fnmatch.filter(dir(module), pattern):
            delattr(module, each)


def write_as_windows() -> None:
    """Write texts with CR LF and the code page 1252 where nothing else is said; refuse names and folders that Windows refuses."""
    real_open, real_os_open, real_rename, real_mkdir = io.open, os.open, os.rename, os.mkdir

    def opened(file, mode="r", buffering=-1, encoding=None, errors=None, newline=None, *args, **kwargs):
        named(file)
        if "b" not in mode:
            encoding = "cp1252" if encoding in (None, "locale") else encoding
            newline = "\r\n" if newline is None and set(mode) & set("wax+") else newline
        return real_open(file, mode, buffering, encoding, errors, newline, *args, **kwargs)

    def os_opened(path, flags, mode=0o777, **kwargs):
        named(path)
        if os.path.isdir(path):
            raise PermissionError(13, "Permission denied: a folder", os.fspath(path))
        return real_os_open(path, flags, mode, **kwargs)

    def renamed(source, target, **kwargs):
        if os.path.exists(target):
            raise FileExistsError(17, "Cannot create a file when that file already exists", os.fspath(target))
        named(target)
        real_rename(source, target, **kwargs)

    def made(path, mode=0o777, **kwargs):
        named(path)
        real_mkdir(path, mode, **kwargs)

    io.open = builtins.open = opened
    os.open, os.rename, os.mkdir = os_opened, renamed, made
    for stream in (sys.stdout, sys.stderr):
        stream.reconfigure(encoding="cp1252", newline="\r\n")  # as into a pipe or a file


def named(path) -> None:
    """Refuse a name that Windows refuses."""
    name = os.path.basename(os.fspath(path)) if not isinstance(path, int) else ""
    if FORBIDDEN & set(os.fsdecode(name)):
        raise OSError(22, "Invalid argument: a name that Windows does not allow", path)


def sockets_as_windows() -> None:
    """Refuse what sockets of Windows lack: messages with descriptors, calls for files, and waiting for anything but sockets."""
    import select
    import selectors
    import socket

    def missing(self):
        raise AttributeError("sockets have it on Unix only")

    for name in ("sendmsg", "recvmsg", "recvmsg_into", "sendmsg_afalg"):
        setattr(socket.socket, name, property(missing))
    real_fstat, real_select = os.fstat, select.select

    def of_files(call):
        def called(number, *rest):
            if stat.S_ISSOCK(real_fstat(number).st_mode):
                raise OSError(errno.EBADF, "Bad file descriptor: a socket of Windows is no file")
            return call(number, *rest)

        return called

    def selected(*arguments):
        ends = [one for each in arguments[:3] for one in each]
        numbers = [each if isinstance(each, int) else each.fileno() for each in ends]
        if not numbers or not all(stat.S_ISSOCK(real_fstat(each).st_mode) for each in numbers):
            raise OSError(10038, "An operation was attempted on something that is not a socket")
        return real_select(*arguments)

    for name in ("fstat", "read", "write", "close", "dup", "dup2", "set_inheritable", "isatty"):
        setattr(os, name, of_files(getattr(os, name)))
    select.select = selected
    selectors.DefaultSelector = selectors.SelectSelector
    selectors.SelectSelector._select = staticmethod(lambda r, w, _, timeout=None: selected(r, w, [], timeout))
