"""A filter of system calls for the process of a policy, as a program for the kernel (`man 2 seccomp`)."""

from __future__ import annotations

import ctypes
import errno
import os
import platform
import struct

from baselines.base.errors import BaselineError

# From <asm/unistd.h>. What is refused, and why:
_NUMBERS: dict[str, tuple[int, int]] = {  # name: number on x86-64, on arm64; -1 where there is none
    # one process with one thread: RLIMIT_NPROC does not bind root
    **{"fork": (57, -1), "vfork": (58, -1), "clone": (56, 220), "clone3": (435, 435)},
    # one program: nobody can write to a file while it runs as a program
    **{"execve": (59, 221), "execveat": (322, 281)},
    # what is stated of a file: bubblewrap can give the machine's devices only, with a mount that may be written to
    **{"chmod": (90, -1), "fchmod": (91, 52), "fchmodat": (268, 53), "fchmodat2": (452, 452)},
    **{"chown": (92, -1), "fchown": (93, 55), "lchown": (94, -1), "fchownat": (260, 54)},
    **{"utime": (132, -1), "utimes": (235, -1), "futimesat": (261, -1), "utimensat": (280, 88)},
    **{"setxattr": (188, 5), "lsetxattr": (189, 6), "fsetxattr": (190, 7)},
    **{"removexattr": (197, 14), "lremovexattr": (198, 15), "fremovexattr": (199, 16)},
    # what the kernel counts for all processes of a user, or of the machine
    **{"inotify_init": (253, -1), "inotify_init1": (294, 26), "fanotify_init": (300, 262), "io_setup": (206, 0)},
    # messages of the kernel
    **{"syslog": (103, 116)},
    # other namespaces and mounts
    **{"unshare": (272, 97), "setns": (308, 268), "chroot": (161, 51), "pivot_root": (155, 41)},
    **{"mount": (165, 40), "umount2": (166, 39), "mount_setattr": (442, 442), "open_tree": (428, 428)},
    **{"move_mount": (429, 429), "fsopen": (430, 430), "fsconfig": (431, 431), "fsmount": (432, 432)},
    **{"fspick": (433, 433)},
    # other processes
    **{"ptrace": (101, 117), "process_vm_readv": (310, 270), "process_vm_writev": (311, 271)},
    # sockets: not all families know network namespaces (vsock)
    **{"socket": (41, 198), "socketpair": (53, 199)},
    # keys of the user's session
    **{"add_key": (248, 217), "request_key": (249, 218), "keyctl": (250, 219)},
    # memory that no limit counts
    **{"shmget": (29, 194), "semget": (64, 190), "msgget": (68, 186), "mq_open": (240, 180)},
    **{"vmsplice": (278, 75), "tee": (276, 77)},  # a pipe keeps 2 MB of a huge page for each byte
    # parts of the kernel that a policy does not need, and that were attacked
    **{"bpf": (321, 280), "userfaultfd": (323, 282), "perf_event_open": (298, 241), "io_uring_setup": (425, 425)},
    **{"io_uring_enter": (426, 426), "io_uring_register": (427, 427), "kexec_load": (246, 104)},
    **{"kexec_file_load": (320, 294)},
}
_PRCTL, _FLOCK, _FCNTL, _IOCTL = (157, 167), (73, 32), (72, 25), (16, 29)
_SET_DEATH_SIGNAL = 1  # of prctl: the process must end with the one that started it
# Commands that are allowed, of fcntl: descriptors are copied and made non-blocking; no locks, leases, owners, seals.
_FCNTL_COMMANDS = (0, 1, 2, 3, 4, 1030)  # F_DUPFD, F_GETFD, F_SETFD, F_GETFL, F_SETFL, F_DUPFD_CLOEXEC
# Of ioctl: TCGETS and TIOCGWINSZ ask for a terminal; FIONREAD, FIONBIO, FIONCLEX and FIOCLEX are of descriptors.
_IOCTL_COMMANDS = (0x5401, 0x5413, 0x541B, 0x5421, 0x5450, 0x5451)
_NEWER = 463  # calls from this number on are of Linux 6.13 or later; they set attributes of files, for example
_MACHINES = {"x86_64": (0, 0xC000003E), "aarch64": (1, 0xC00000B7)}  # column above, AUDIT_ARCH
_LINE = struct.Struct("<HBBI")
_X32 = 0x40000000  # calls of x86-64's other interface have this bit
_LOAD, _EQUAL, _AT_LEAST, _RETURN = 0x20, 0x15, 0x35, 0x06  # BPF: ld abs, jeq, jge, ret
_ALLOW, _KILL, _REFUSE = 0x7FFF0000, 0x80000000, 0x00050000 | errno.EPERM
_ABSENT = 0x00050000 | errno.ENOSYS  # libraries then do without, as on an older system
_NUMBER_AT, _ARCH_AT, _FIRST_AT, _SECOND_AT = 0, 4, 16, 24  # bytes in struct seccomp_data; of arguments the low half
_SET_FILTER, _BY_PROGRAM = 22, 2  # PR_SET_SECCOMP, SECCOMP_MODE_FILTER

_Line = tuple[int, int, int, int]


def install_filter() -> None:
    """Filter the system calls of this process from now on. It must have renounced new privileges, as bubblewrap does.

    Raises
    ------
    BaselineError
        If there is no filter for this machine.
    OSError
        If the kernel does not take it.
    """
    program = filter_program()
    kept = ctypes.create_string_buffer(program, len(program))
    stated = struct.pack("@HP", len(program) // _LINE.size, ctypes.addressof(kept))
    words = ctypes.c_ulong(_BY_PROGRAM), stated, ctypes.c_ulong(0), ctypes.c_ulong(0)
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_SET_FILTER, *words):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))


def filter_program() -> bytes:
    """Return the program for this machine.

    Raises
    ------
    BaselineError
        If the numbers of this machine's system calls are not in the table.
    """
    machine = platform.machine()
    if machine not in _MACHINES:
        raise BaselineError(f"no filter of system calls for {machine}, only for {', '.join(_MACHINES)}")
    column, architecture = _MACHINES[machine]
    lines: list[_Line] = [(_LOAD, 0, 0, _ARCH_AT), (_EQUAL, 1, 0, architecture), (_RETURN, 0, 0, _KILL)]
    lines += [(_LOAD, 0, 0, _NUMBER_AT), (_AT_LEAST, 0, 1, _X32), (_RETURN, 0, 0, _REFUSE)]
    lines += [(_AT_LEAST, 0, 1, _NEWER), (_RETURN, 0, 0, _ABSENT)]
    lines += [(_EQUAL, 0, 1, _FLOCK[column]), (_RETURN, 0, 0, _ABSENT)]
    for numbers in _NUMBERS.values():
        if numbers[column] >= 0:
            lines += [(_EQUAL, 0, 1, numbers[column]), (_RETURN, 0, 0, _REFUSE)]
    lines += _by_argument(_PRCTL[column], _FIRST_AT, (_SET_DEATH_SIGNAL,), _REFUSE, _ALLOW)
    lines += _by_argument(_FCNTL[column], _SECOND_AT, _FCNTL_COMMANDS, _ALLOW, _REFUSE)
    lines += _by_argument(_IOCTL[column], _SECOND_AT, _IOCTL_COMMANDS, _ALLOW, _REFUSE)
    return b"".join(_LINE.pack(*line) for line in [*lines, (_RETURN, 0, 0, _ALLOW)])


def _by_argument(number: int, place: int, values: tuple[int, ...], found: int, other: int) -> list[_Line]:
    """Return the lines that answer a call by one of its arguments: `found` for the values, else `other`."""
    lines: list[_Line] = [(_LOAD, 0, 0, place)]
    for value in values:
        lines += [(_EQUAL, 0, 1, value), (_RETURN, 0, 0, found)]
    lines.append((_RETURN, 0, 0, other))
    return [(_EQUAL, 0, len(lines), number), *lines]
