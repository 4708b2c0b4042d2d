"""The choice of an OpenGL library where there is no display, and the end of its contexts."""

from __future__ import annotations

import atexit
import ctypes
import functools
import importlib
import os
import weakref
from contextlib import suppress

import mujoco
from mujoco.rendering.classic import gl_context

from minexplore.limits import has_display

_EGL, _OSMESA = "libEGL.so.1", ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so")
_EGL_PLATFORM_DEVICE, _MOST_DEVICES = 0x313F, 32
_DRAWING: set[int] = set()  # processes that have made a context: this one, and those that it is a fork of
_RENDERERS: weakref.WeakSet[mujoco.Renderer] = weakref.WeakSet()


class DisplayError(RuntimeError):
    """Nothing can be drawn on this machine as it is; the message says what to install or set."""


def prepare_opengl(render_mode: str) -> None:
    """Choose EGL or OSMesa for MuJoCo where a Linux machine has no display.

    MuJoCo chooses by `MUJOCO_GL` when it is imported, and takes GLFW where that is unset, which needs a display. A
    value that the user set is kept.

    Raises
    ------
    DisplayError
        If nothing can draw in this mode; the message says what to install or set.
    """
    if has_display():
        return
    if render_mode == "human":
        raise DisplayError("render_mode = 'human' needs a display, and DISPLAY is not set; 'rgb_array' needs none")
    chosen = os.environ.get("MUJOCO_GL", "").strip().lower()
    if chosen == "glfw":
        raise DisplayError("MUJOCO_GL = 'glfw' needs a display, and DISPLAY is not set; 'egl' and 'osmesa' need none")
    if chosen:
        return
    works = next((name for name, test in (("egl", egl_works), ("osmesa", osmesa_works)) if test()), None)
    if works is None:
        raise DisplayError(
            "no display, and neither EGL nor OSMesa works; install one of them, on Debian by "
            "`apt install libegl1 libgl1-mesa-dri` or `apt install libosmesa6`"
        )
    os.environ["MUJOCO_GL"] = works
    importlib.reload(gl_context)  # MuJoCo is imported already, and has chosen GLFW


def new_renderer(model: mujoco.MjModel, size_px: tuple[int, int], max_geom: int) -> mujoco.Renderer:
    """Return a renderer of pictures of `size_px` (width, height) that is closed before the process ends.

    MuJoCo ends its EGL display at exit, and frees the contexts of open renderers afterwards, which fails.

    Raises
    ------
    DisplayError
        In a fork of a process that has drawn: the threads of its OpenGL are not in the fork, which would wait for them.
    """
    if _DRAWING and os.getpid() not in _DRAWING:
        raise DisplayError(
            "this process is a fork of one that has drawn, and would wait for ever; start it by 'spawn', which "
            "gymnasium.make_vec takes as vector_kwargs={'context': 'spawn'}, or draw nothing before the fork"
        )
    _DRAWING.add(os.getpid())
    renderer = mujoco.Renderer(model, size_px[1], size_px[0], max_geom=max_geom)
    _RENDERERS.add(renderer)
    _close_all_at_exit()
    return renderer


@functools.cache
def _close_all_at_exit() -> None:
    """Register once, after the first context: functions at exit run in reverse order, and MuJoCo's comes first."""
    atexit.register(lambda: [renderer.close() for renderer in list(_RENDERERS)])


def egl_works() -> bool:
    """Return whether EGL initialises on a device without a display, as MuJoCo asks it to."""
    try:
        egl = ctypes.CDLL(_EGL)
    except OSError:
        return False
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    addresses = [egl.eglGetProcAddress(name) for name in (b"eglQueryDevicesEXT", b"eglGetPlatformDisplayEXT")]
    if not all(addresses):
        return False
    query = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(addresses[0])
    display_of = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p)(addresses[1])
    devices, count = (ctypes.c_void_p * _MOST_DEVICES)(), ctypes.c_int(0)
    if not query(_MOST_DEVICES, devices, ctypes.byref(count)):
        return False
    for device in devices[: count.value]:
        display = display_of(_EGL_PLATFORM_DEVICE, device, None)
        if display and egl.eglInitialize(ctypes.c_void_p(display), None, None):
            egl.eglTerminate(ctypes.c_void_p(display))
            return True
    return False


def osmesa_works() -> bool:
    """Return whether OSMesa, Mesa's renderer into memory, can be loaded."""
    for name in _OSMESA:
        with suppress(OSError):
            ctypes.CDLL(name)
            return True
    return False
