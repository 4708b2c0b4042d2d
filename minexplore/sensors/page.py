"""The part of the environment's page on its sensors: what there is, and the numbers with their sources."""

from __future__ import annotations

import textwrap

from minexplore.pictures.cameras import CameraParams
from minexplore.sensing.odometry import fitted_odometry
from minexplore.sensing.params import preset_names, preset_numbers
from minexplore.sensing.scanners import LABELS, load_pattern, pattern_names
from minexplore.sensors.table import kind_of, sensor_names

_WIDE = 118  # characters of a line
_PAGE = """## Sensors

All sensors are off unless they are asked for, and cost nothing until they are read. The robot's own observation, the
physics and the rewards do not depend on them. `conditions` other than `"ideal"` degrade the robot's own beams too: a
beam that returns from dust sees no cell beyond it, and one without a return reads 10 m and sees none.

![What each sensor reads: images, LiDARs, turn rates and odometry, ideal above, in dust below](../sensors.jpg)

Images are 62 deg high, clouds are seen from above, and colours are labels. On the right are the IMU's three turn rates,
and the way of a robot along a wall for two minutes, the true one in white and the counted one in red.

```python
env = gymnasium.make("MineXplore/ChileanMine-v0", sensors=("depth", "os1-64"), conditions="dusty")
observation, info = env.reset(seed=0)  # {{"robot": (19,), "depth": (240, 320), "os1-64": (65536,)}}
cloud = env.unwrapped.capture("mid-360")  # any sensor, at any time
```

| sensor | in the observation | `capture` gives |
|---|---|---|
{sensors}

The camera looks ahead from the robot's front, {width_px} x {height_px} pixels, {fovy_deg:g} deg upwards, in the light
of the headlamp. Depths are along its axis, at most {depth_m:g} m before noise; 0 means none. The label image is that of
the surfaces, whatever the dust. The labels of images and clouds are
{labels}.

### LiDARs

A cloud has `points_m`, `range_m`, `ring`, `time_s`, `intensity` and `label`. Rays hit the visible rock, furniture and
the floor that wheels stand on, within 1 mm of MuJoCo's own rays. `Scanner` in `minexplore.sensing.scanners` takes a
mounting pose and, for motion within a scan, the robot's pose when the scan began. `scanner_of("own.json", world)` makes
one of a file with the fields of those in `minexplore/sensing/scanners/patterns`.

| name | range, m | at 10 % reflectivity, m | noise, mm | scans/s | rays a scan |
|---|---|---|---|---|---|
{lidars}

{lidar_sources}

### Conditions

Dust takes light by the law of Beer and Lambert, and its particles return a part of the rays before they reach rock. A
return is lost where its power falls below that of the data sheet's limit: at grazing incidence, far away, on wet
ground. Standing water mirrors rays. What a mirrored ray hits next may return as a ghost point below the floor.

| number | {presets} |
|---|{rule}
{conditions}

{condition_sources}

### Odometry and IMU

`pose="odometry"` gives the pose that wheels count. Its errors are those of a real wheel log of the embedded mine, not
calibrated (`python -m benchmarks odometry-fit`): {slip:.1%} of the travel slips on dry ground, and on mud and water
the more the less friction they have; the heading drifts by {drift:.3f} rad/m, to either side, and wanders by
{wander:.3f} rad times the root of the way in metres. The IMU reads turn rates (rad/s) and specific forces (m/s2),
means over a control step.

### Recordings

```sh
python -m minexplore record MineXplore/ChileanMine-v0 --policy nearest-frontier --sensors os1-64,depth --steps 50 \\
    --every 10 --out episode.mcap
python -m minexplore record MineXplore/ChileanMine-v0 --sensors mid-360,rgb --live
```

The first writes MCAP with ROS 2 messages (extra `record`): `/clock`, `/tf`, `/odom`, `/imu`, `/camera/depth/image` with
`camera_info`, `/os1_64/points`. The frames are `map`, `odom`, `base_link`, and one a sensor; `base_link` is at its true
place in `map`. The second shows the same in a browser (extra `live`).
"""


def sensors_section() -> str:
    """Return the section on sensors as Markdown."""
    camera, fit = CameraParams(), fitted_odometry()
    return _PAGE.format(
        sensors="\n".join(_sensor_row(name) for name in sensor_names()),
        width_px=camera.width_px,
        height_px=camera.height_px,
        fovy_deg=camera.fovy_deg,
        depth_m=camera.depth_m,
        labels=textwrap.fill(", ".join(f"{number} {name}" for number, name in enumerate(LABELS)), _WIDE),
        lidars="\n".join(_lidar_row(name) for name in pattern_names()),
        lidar_sources="\n".join(_item(f"`{name}`", load_pattern(name).source) for name in pattern_names()),
        presets=" | ".join(preset_names()),
        rule="---|" * len(preset_names()),
        conditions="\n".join(_condition_rows()),
        condition_sources="\n".join(_condition_sources()),
        slip=fit.slip,
        drift=fit.heading_drift_radpm,
        wander=fit.heading_noise_rad_rtm,
    )


def _sensor_row(name: str) -> str:
    kind = kind_of(name)
    space = kind.space(name)
    return f"| `{name}` | {space.shape} {space.dtype} | {kind.gives(name)} |"


def _lidar_row(name: str) -> str:
    pattern = load_pattern(name)
    near, far = pattern.range_m
    numbers = f"{near:g} to {far:g} | {pattern.range_at_ten_percent_m:g} | {1000 * pattern.noise_m:g}"
    return f"| `{name}` | {numbers} | {pattern.rate_hz:.2g} | {pattern.rays:,} |"


def _condition_rows() -> list[str]:
    """Return a row for each number, with its value in each preset; the ideal one has nothing where others degrade."""
    presets = [preset_numbers(name) for name in preset_names()]
    fields = dict.fromkeys(field for numbers in presets for field in numbers)
    return [
        f"| `{field}` | {' | '.join(f'{numbers[field][0]:g}' if field in numbers else '' for numbers in presets)} |"
        for field in fields
    ]


def _condition_sources() -> list[str]:
    """Return an item for each number and source, which names the presets where a number has several."""
    found: dict[tuple[str, str], list[str]] = {}
    for preset in preset_names():
        for field, (_, source) in preset_numbers(preset).items():
            found.setdefault((field, source), []).append(preset)

    def named(presets: list[str]) -> str:
        return f" ({', '.join(presets)})"

    several = [field for field, _ in found if sum(other == field for other, _ in found) > 1]
    return [
        _item(f"`{field}`{named(presets) if field in several else ''}", source)
        for (field, source), presets in found.items()
    ]


def _item(name: str, text: str) -> str:
    """Return an item of a list in lines that a screen holds."""
    item = f"- {name}: {text.rstrip('.')}."
    return textwrap.fill(item, _WIDE, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
