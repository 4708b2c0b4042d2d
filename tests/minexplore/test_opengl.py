import ctypes
import os
import shutil
import subprocess
import sys

import pytest

from minexplore.pictures.opengl import egl_works, osmesa_works
from tests.mines import BuiltMine
from tests.project import ROOT

DRAW = """
import gymnasium, minexplore, sys
env = gymnasium.make("MineXplore/World-v0", world=sys.argv[1], render_mode="rgb_array")
env.reset(seed=0)
print(env.render().shape, env.render().std() > 1)
env.close()
"""

LEAVE_OPEN = """
import gymnasium, minexplore, sys
env = gymnasium.make("MineXplore/World-v0", world=sys.argv[1], render_mode="rgb_array")
env.reset(seed=0)
print(env.render().shape, __import__("os").environ["MUJOCO_GL"])
"""

WATCH = """
import gymnasium, minexplore, sys
env = gymnasium.make("MineXplore/World-v0", world=sys.argv[1], render_mode="human")
env.reset(seed=0)
for _ in range(3):
    env.step(env.action_space.sample())
if sys.argv[2] == "close":
    env.close()
print("done")
"""

FORK_AND_DRAW = """
import gymnasium, minexplore, sys
kwargs = {"world": sys.argv[1], "render_mode": "rgb_array"}
if __name__ == "__main__":
    env = gymnasium.make("MineXplore/World-v0", **kwargs)
    env.reset(seed=0)
    env.render()
    context = {"context": sys.argv[2]}
    many = gymnasium.make_vec("MineXplore/World-v0", 2, vectorization_mode="async", vector_kwargs=context, **kwargs)
    many.reset(seed=0)
    try:
        print(len(many.render()))
    finally:
        many.close()
"""

NOTHING = "import sys, minexplore.pictures.opengl as o; o.egl_works = o.osmesa_works = lambda: False; "


def run(*command, **variables):
    """Run Python in an environment without a display and without MuJoCo's choice of OpenGL."""
    clean = {k: v for k, v in os.environ.items() if k not in ("MUJOCO_GL", "DISPLAY", "WAYLAND_DISPLAY")}
    clean = {k: v for k, v in clean.items() if k != "PYOPENGL_PLATFORM"} | variables
    return subprocess.run(
        [sys.executable, *command], capture_output=True, text=True, cwd=ROOT, env=clean, timeout=300, check=False
    )


NO_EGL = "EGL draws nothing here (Debian: libegl1 and a driver, such as that of libegl-mesa0)"
NO_OSMESA = "OSMesa is not installed (Debian: libosmesa6)"
needs_opengl = pytest.mark.skipif(not (egl_works() or osmesa_works()), reason=NO_OSMESA)


@needs_opengl
def test_a_fork_of_a_process_that_has_drawn_is_refused_and_does_not_hang(tee: BuiltMine, tmp_path):
    script = tmp_path / "fork_and_draw.py"
    script.write_text(FORK_AND_DRAW)
    forked = run(str(script), str(tee.bundle), "fork", PYTHONPATH=str(ROOT))
    assert "DisplayError: this process is a fork of one that has drawn" in forked.stderr
    spawned = run(str(script), str(tee.bundle), "spawn", PYTHONPATH=str(ROOT))
    assert spawned.returncode == 0, spawned.stderr
    assert spawned.stdout.split("\n")[0] == "2"


@needs_opengl
@pytest.mark.parametrize("first", ["", "import mujoco\n"])
def test_pictures_need_no_display_and_no_variable(tee: BuiltMine, first):
    done = run("-c", first + DRAW, str(tee.bundle))
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n")[0] == "(480, 640, 3) True"


@pytest.mark.parametrize(
    "library",
    [
        pytest.param("egl", marks=pytest.mark.skipif(not egl_works(), reason=NO_EGL)),
        pytest.param("osmesa", marks=pytest.mark.skipif(not osmesa_works(), reason=NO_OSMESA)),
    ],
)
def test_a_script_that_does_not_close_its_environment_ends_well_and_keeps_the_users_library(tee: BuiltMine, library):
    done = run("-c", LEAVE_OPEN, str(tee.bundle), MUJOCO_GL=library)
    assert done.returncode == 0, done.stderr
    assert (done.stdout.strip(), done.stderr) == (f"(480, 640, 3) {library}", "")


def test_a_machine_without_any_library_gets_a_line_on_what_to_install(tee: BuiltMine):
    play = ["minexplore", "play", "World", "--world", str(tee.bundle), "--policy", "ahead", "--video", "videos"]
    done = run("-c", NOTHING + f"import minexplore.__main__ as m; sys.argv = {play}; sys.exit(m.main())")
    assert done.returncode == 2
    assert done.stderr.startswith("play: no display, and neither EGL nor OSMesa works; install one of them")
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    ("arguments", "variables", "words"),
    [
        ((), {}, "render_mode = 'human' needs a display"),
        (("--policy", "ahead", "--video", "videos"), {"MUJOCO_GL": "glfw"}, "MUJOCO_GL = 'glfw' needs a display"),
    ],
)
def test_what_needs_a_display_says_so_where_there_is_none(tee: BuiltMine, arguments, variables, words):
    done = run("-m", "minexplore", "play", "MineXplore/World-v0", "--world", str(tee.bundle), *arguments, **variables)
    assert done.returncode == 2
    assert words in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="Xvfb is not installed (Debian: xvfb)")
@pytest.mark.parametrize("end", [pytest.param("close", marks=pytest.mark.slow), "leave open"])
def test_the_viewer_s_process_ends_well(tee: BuiltMine, end):
    read, write = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", "640x480x24"], pass_fds=[write], stderr=subprocess.DEVNULL
    )
    try:
        os.close(write)
        display = os.read(read, 16).decode().strip()
        done = run("-c", WATCH, str(tee.bundle), end, DISPLAY=f":{display}")
    finally:
        os.close(read)
        server.terminate()
        server.wait()
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "done"


def test_a_library_that_is_not_there_does_not_work(monkeypatch):
    def missing(name):
        raise OSError(name)

    monkeypatch.setattr(ctypes, "CDLL", missing)
    assert not egl_works()
    assert not osmesa_works()
