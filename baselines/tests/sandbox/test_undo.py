"""Policies that try to undo their sandbox: each attempt fails, and nothing outside changes."""

import os
import platform
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from baselines.base.errors import BaselineError
from baselines.base.result_file import RESULTS
from baselines.sandbox.confined import Confined, ConfinedPolicy
from minexplore.physics.robot import RobotParams
from minexplore.task import TaskParams
from tests.project import ROOT, eventually, is_running
from tests.sandbox import needs_sandbox

pytestmark = [
    needs_sandbox,
    pytest.mark.skipif(platform.machine() != "x86_64", reason="the attempts use the numbers of x86-64's system calls"),
]
HERE = (TaskParams(), RobotParams())
# Each attempt returns what it gained, or raises. They share one process: what one undoes, the later ones could use.
ATTEMPTS = r"""
import ctypes, mmap, os, resource, struct, threading
import numpy as np

libc = ctypes.CDLL(None, use_errno=True)
libc.syscall.restype = ctypes.c_long


def call(number, *words):
    found = libc.syscall(ctypes.c_long(number), *(ctypes.c_long(w) if isinstance(w, int) else w for w in words))
    if found < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return True

def setattr_mount(path, flags):
    cleared = (ctypes.c_uint64 * 4)(0, 1, 0, 0)  # clear the read-only flag
    return call(442, -100, path, flags, ctypes.byref(cleared), 32)

def mounted_writable(): return setattr_mount(b"/", 0)
def mounted_writable_below(): return setattr_mount(b"/", 0x8000)
def project_writable(): return setattr_mount(b"/project/minexplore", 0)
def unmounted(): return call(166, b"/project/minexplore", 2)
def unmounted_proc(): return call(166, b"/proc", 2)
def remounted(): return call(165, b"none", b"/", b"", 0x20 | 0x1000, 0)
def remounted_proc(): return call(165, b"none", b"/proc", b"", 0x20, 0)
def mounted(): return call(165, b"none", b"/tmp", b"tmpfs", 0, 0)
def opened_file_system(): return call(430, b"tmpfs", 0)
def cloned_tree(): return call(428, -100, b"/", 1)
def pivoted(): return call(155, b".", b".")
def changed_root(): return call(161, b"/project")
def made_user_namespace(): return call(272, 0x10000000)
def made_mount_namespace(): return call(272, 0x20000)
def joined_namespace(): return call(308, os.open("/proc/self/ns/mnt", os.O_RDONLY), 0)
def traced_first_process(): return call(101, 16, 1, 0, 0)
def traced_parent(): return call(101, 16, OUTSIDE_PID, 0, 0)
def wrote_memory(): return bool(os.open("/proc/1/mem", os.O_RDWR))
def read_other_memory(): return bool(os.open(f"/proc/{OUTSIDE_PID}/mem", os.O_RDONLY))
def copied_memory(): return call(310, 1, 0, 0, 0, 0, 0)
def signalled(): return os.kill(OUTSIDE_PID, 0) is None
def found_processes(): return [name for name in os.listdir("/proc") if name.isdigit()] != ["1"]
def outlives_parent(): return call(157, 1, 0, 0, 0, 0)
def gains_privileges(): return call(157, 38, 0, 0, 0, 0)
def left_filter(): return call(157, 22, 0, 0, 0, 0)
def ambient_capability(): return call(157, 47, 2, 21, 0, 0)
def has_capability():
    lines = [line.split() for line in open("/proc/self/status") if line.startswith("Cap")]
    return any(int(value, 16) for _, value in lines)
def set_capabilities():
    header, data = struct.pack("Ii", 0x20080522, 0), struct.pack("6I", *[0xFFFFFFFF] * 6)
    return call(126, header, data)
def became_root(): return os.setuid(0) is None
def forked():
    for _ in range(50):
        if os.fork() == 0:
            os._exit(0)
    return True
def vforked_by_clone(): return call(56, 0x11, 0, 0, 0, 0)
def cloned(): return call(435, (ctypes.c_uint64 * 11)(), 88)
def forked_by_other_interface(): return call(0x40000000 | 57)
def started_thread(): return threading.Thread(target=print).start() is None
def spawned(): return bool(os.posix_spawn("/bin/true", ["true"], {}))
def raised_memory(): return resource.setrlimit(resource.RLIMIT_AS, (-1, -1)) is None
def raised_file_size(): return resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 20, 1 << 20)) is None
def raised_time(): return resource.prlimit(0, resource.RLIMIT_CPU, (-1, -1)) is not None
def raised_files(): return resource.setrlimit(resource.RLIMIT_NOFILE, (4096, 4096)) is None
def unlimited(): return any(resource.getrlimit(k)[1] == -1 for k in (resource.RLIMIT_AS, resource.RLIMIT_CPU))
def opened_sockets():
    found = []
    for family in range(64):
        for kind in (1, 2, 3, 5):
            try:
                found.append(call(41, family, kind, 0))
            except OSError:
                pass
    return bool(found)
def paired_sockets(): return call(53, 1, 1, 0, (ctypes.c_int * 2)())
def read_keyring(): return call(250, 0, -3, 0)
def added_key(): return call(248, b"user", b"k", b"v", 1, -3)
def requested_key(): return call(249, b"user", b"k", 0, -3)
def handled_faults(): return call(323, 1)
def ringed(): return call(425, 8, (ctypes.c_uint8 * 120)())
def loaded_bpf(): return call(321, 0, (ctypes.c_uint8 * 48)(), 48)
def measured(): return call(298, (ctypes.c_uint8 * 112)(), 0, -1, -1, 0)
def shared_memory(): return call(29, 0, 1 << 30, 0o1600)
def queued_messages(): return call(68, 0, 0o1600)
def opened_by_handle(): return call(304, -100, (ctypes.c_uint8 * 16)(), 0)
def ran_program():
    try:
        os.execv("/absent", ["absent"])
    except FileNotFoundError:
        return True
def watched(): return call(294, 0)
def watched_all(): return call(300, 0x200, 0)
def took_requests(): return call(206, 1, ctypes.byref(ctypes.c_ulong()))
def took_timers(): return all(call(222, 1, None, ctypes.byref(ctypes.c_int())) for _ in range(1000))
def read_kernel_messages(): return call(103, 10, 0, 0)
def made_device(): return os.mknod("/tmp/device", 0o60600, os.makedev(254, 0)) is None
def wrote_kernel_setting(): return bool(os.open("/proc/sys/kernel/core_pattern", os.O_RDWR))
def wrote_sysrq(): return bool(os.open("/proc/sysrq-trigger", os.O_WRONLY))
def filled_memory_file():
    descriptor = os.memfd_create("x")
    return os.write(descriptor, b"x") > 0
def wrote_temporary(): return bool(os.open("/tmp/x", os.O_CREAT | os.O_WRONLY))
def made_folder(): return os.mkdir("/tmp/x") is None
def sees_variables(): return "THE_SECRET" in os.environ
def read_outside(): return any(readable(path) for path in OUTSIDE)
def listed_outside(): return any(listable(os.path.dirname(path)) for path in OUTSIDE)
def wrote_any(): return on_all(lambda path: os.open(path, os.O_WRONLY))
def created_beside(): return on_all(lambda path: os.open(path + ".new", os.O_CREAT | os.O_WRONLY))
def renamed_over(): return on_all(lambda path: os.rename("/policy/undo.py", path))
def renamed_away(): return on_all(lambda path: os.rename(path, path + ".old"))
def linked(): return on_all(lambda path: os.symlink("/tmp", path + ".link"))
def hard_linked(): return on_all(lambda path: os.link(path, path + ".hard"))
def truncated(): return on_all(lambda path: os.truncate(path, 0))
def removed(): return on_all(os.unlink)
def changed_mode(): return on_all(lambda path: os.chmod(path, 0o777))
def changed_times(): return on_all(lambda path: os.utime(path, (0, 0)))


def readable(path):
    try:
        return bool(open(path, "rb").read(1))
    except OSError:
        return False

def listable(path):
    try:
        return os.path.basename(OUTSIDE[0]) in os.listdir(path) or "ChileanMine-v0" in os.listdir(path)
    except OSError:
        return False

def on_all(attempt):
    gained = []
    for path in [*OUTSIDE, *INSIDE]:
        try:
            attempt(path)
            gained.append(path)
        except OSError:
            pass
    return bool(gained)
"""
NAMES = [line.split("(")[0][4:] for line in ATTEMPTS.split("\n\n\ndef readable")[0].splitlines() if line[:4] == "def "]
NAMES = [name for name in NAMES if name not in ("call", "setattr_mount")]
POLICY = '''

class Undoes:
    def __init__(self, count, task, robot):
        self.count = count
    def reset(self, robots, seeds):
        pass
    def act(self, observation, info):
        return np.array([[gain(name), 0.0] for name in NAMES])


def gain(name):
    try:
        return float(bool(globals()[name]()))
    except (OSError, ValueError, RuntimeError):
        return 0.0


class Interrupts(Undoes):
    """Calls the kernel by the interface of 32-bit programs, in which `fork` is number 2."""
    def act(self, observation, info):
        code = mmap.mmap(-1, 4096, prot=mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC)
        code.write(bytes.fromhex("b802000000cd80c3"))
        ctypes.CFUNCTYPE(ctypes.c_int)(ctypes.addressof(ctypes.c_char.from_buffer(code)))()
        return np.zeros((self.count, 2))


class Stays(Undoes):
    """Stays when the process that started it ends."""
    def act(self, observation, info):
        gain("outlives_parent")
        while True:
            pass
'''


@pytest.fixture(scope="module")
def undoing(tmp_path_factory):
    """Return a folder with a module of policies that know files of the user and of the project, inside and outside."""
    folder = tmp_path_factory.mktemp("undo")
    secret = folder / "secret.txt"
    secret.write_text("a secret of the user")
    outside = [secret, folder / "undo.py", RESULTS / "driven_here.json", ROOT / "README.md", Path("/etc/passwd")]
    inside = [
        "/policy/undo.py",
        "/project/baselines/policies/policy_lookup.py",
        "/project/minexplore/world.py",
        np.__file__,
    ]
    stated = f"OUTSIDE, INSIDE = {[*map(str, outside)]}, {inside}\nOUTSIDE_PID, NAMES = {os.getpid()}, {NAMES}\n"
    (folder / "undo.py").write_text(stated + ATTEMPTS + POLICY)
    return folder


def state(folder):
    """Return what a policy could have changed."""
    files = [
        *sorted(folder.iterdir()),
        RESULTS / "driven_here.json",
        ROOT / "baselines/policies/policy_lookup.py",
        Path(np.__file__),
    ]
    about = [(path, path.stat()) for path in files]
    settings = Path("/proc/sys/kernel/core_pattern").read_text()
    return [(path, path.read_bytes(), s.st_mode, s.st_mtime_ns) for path, s in about], settings


@pytest.fixture(scope="module")
def gained(undoing):
    """Return what the attempts gained, by their names."""
    before, here = state(undoing), Path.cwd()
    os.environ["THE_SECRET"] = "42"
    try:
        os.chdir(undoing)
        with ConfinedPolicy("undo:Undoes", len(NAMES), *HERE, Confined()) as policy:
            found = policy.act(np.zeros((len(NAMES), 19), np.float32), {"pose_m_rad": np.zeros((len(NAMES), 3))})
    finally:
        os.chdir(here)
        del os.environ["THE_SECRET"]
    assert state(undoing) == before
    return dict(zip(NAMES, found[:, 0].tolist(), strict=True))


@pytest.mark.parametrize("name", NAMES)
def test_a_policy_undoes_nothing(gained, name):
    assert gained[name] == 0.0


def test_the_attempts_succeed_where_nothing_confines_them(undoing):
    """Those that need no rights gain something outside a sandbox: they are no attempts that cannot succeed."""
    names = ["read_outside", "listed_outside", "forked", "started_thread", "opened_sockets", "sees_variables"]
    names += ["filled_memory_file", "outlives_parent", "found_processes"]
    names += ["ran_program", "watched", "watched_all", "took_requests", "took_timers"]
    code = f"import os; os.environ['THE_SECRET'] = ''; import undo; print([undo.gain(n) for n in {names}])"
    done = subprocess.run([sys.executable, "-c", code], cwd=undoing, capture_output=True, text=True, check=True)
    assert done.stdout.split("[")[-1].strip(" ]\n").split(", ") == ["1.0"] * len(names)


def test_the_attempts_undo_a_sandbox_that_keeps_its_capabilities(undoing):
    names = ["mounted_writable", "remounted", "mounted", "opened_file_system", "made_mount_namespace"]
    names += ["joined_namespace", "read_keyring", "handled_faults", "ringed", "shared_memory"]
    code = f"import undo; print([undo.gain(n) for n in {names}])"
    command = ["bwrap", "--unshare-all", "--cap-add", "ALL", "--uid", "0", "--gid", "0", "--die-with-parent"]
    command += ["--ro-bind", "/", "/", "--proc", "/proc", "--dev", "/dev", "--chdir", str(undoing)]
    done = subprocess.run([*command, sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout == f"{[1.0] * len(names)}\n"


def test_a_policy_that_calls_by_the_interface_of_32_bit_programs_is_ended(undoing, monkeypatch):
    monkeypatch.chdir(undoing)
    with (
        ConfinedPolicy("undo:Interrupts", 1, *HERE, Confined()) as policy,
        pytest.raises(BaselineError, match="it ended"),
    ):
        policy.act(np.zeros((1, 19), np.float32), {"pose_m_rad": np.zeros((1, 3))})


@pytest.mark.slow  # it imports all that a policy may use, twice
def test_a_policy_ends_with_the_process_that_started_it(undoing):
    code = (
        "import numpy as np\n"
        "from baselines.sandbox.bubblewrap import Limits\n"
        "from baselines.tests.sandbox.test_undo import HERE, Confined, ConfinedPolicy\n"
        "policy = ConfinedPolicy('undo:Stays', 1, *HERE, Confined(Limits(time_s=600)))\n"
        "print(policy._process.pid, flush=True)\n"
        "policy.act(np.zeros((1, 19), np.float32), {'pose_m_rad': np.zeros((1, 3))})\n"
    )
    variables = {**os.environ, "PYTHONPATH": str(ROOT)}
    words = [sys.executable, "-c", code]
    with subprocess.Popen(words, cwd=undoing, env=variables, stdout=subprocess.PIPE, text=True) as parent:
        sandbox = int(parent.stdout.readline())
        inside = int(Path(f"/proc/{sandbox}/task/{sandbox}/children").read_text())
        time.sleep(0.3)  # the policy is driving
        parent.send_signal(signal.SIGKILL)
    assert eventually(lambda: not is_running(inside))
