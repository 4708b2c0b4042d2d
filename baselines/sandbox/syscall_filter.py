"""A filter of system calls for the process of a policy, as a program for the kernel (`man 2 seccomp`)."""

from __future__ import annotations

import errno
import platform
import struct

from baselines.base.errors import BaselineError

# From <asm/unistd.h>. What is refused, and why:
_NUMBERS: dict[str, tuple[int, int]] = {  # name: number on x86-64, on arm64; -1 where there is none
    # one process with one thread: RLIMIT_NPROC does not bind root
    **{"fork": (57, -1), "vfork": (58, -1), "clone": (56, 220), "clone3": (435, 435)},
    # other namespaces and mounts
    **{"unshare": (272, 97), "setns": (308, 268), "chroot": (161, 51), "pivot_root": (155, 41)},
    **{"mount": (165, 40), "umount2": (166, 39), "mount_setattr": (442, 442), "open_tree": (428, 428)},
    **{"move_mount": (429, 429), "fsopen": (430, 430), "fsconfig": (431, 431), "fsmount": (432, 432)},
    **{"fspick": (433, 433), "open_tree_attr": (467, 467)},
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
_PRCTL = (157, 167)
_SET_DEATH_SIGNAL = 1  # of prctl: the process must end with the one that started it
_MACHINES = {"x86_64": (0, 0xC000003E), "aarch64": (1, 0xC00000B7)}  # column above, AUDIT_ARCH
_X32 = 0x40000000  # calls of x86-64's other interface have this bit
_LOAD, _EQUAL, _AT_LEAST, _RETURN = 0x20, 0x15, 0x35, 0x06  # BPF: ld abs, jeq, jge, ret
_ALLOW, _KILL, _REFUSE = 0x7FFF0000, 0x80000000, 0x00050000 | errno.EPERM
_NUMBER_AT, _ARCH_AT, _FIRST_ARGUMENT_AT = 0, 4, 16  # bytes in struct seccomp_data


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
    lines = [(_LOAD, 0, 0, _ARCH_AT), (_EQUAL, 1, 0, architecture), (_RETURN, 0, 0, _KILL)]
    lines += [(_LOAD, 0, 0, _NUMBER_AT), (_AT_LEAST, 0, 1, _X32), (_RETURN, 0, 0, _REFUSE)]
    for numbers in _NUMBERS.values():
        if numbers[column] >= 0:
            lines += [(_EQUAL, 0, 1, numbers[column]), (_RETURN, 0, 0, _REFUSE)]
    lines += [(_EQUAL, 0, 3, _PRCTL[column]), (_LOAD, 0, 0, _FIRST_ARGUMENT_AT)]
    lines += [(_EQUAL, 0, 1, _SET_DEATH_SIGNAL), (_RETURN, 0, 0, _REFUSE), (_RETURN, 0, 0, _ALLOW)]
    return b"".join(struct.pack("<HBBI", *line) for line in lines)
