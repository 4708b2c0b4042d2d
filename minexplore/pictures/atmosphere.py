"""Haze, sky and headlamps of a look in MuJoCo's models and scenes."""

from __future__ import annotations

from collections.abc import Collection

import mujoco

from minexplore.looks import EXTENT_M, LAMP_CUTOFF_DEG, NO_HAZE_M, Look

_SHADOW_PX = 2048  # with 1024 grazing faces shadow themselves in dots; 4096 takes OSMesa a quarter longer


def let_light_pass(scene: mujoco.MjvScene, geoms: Collection[int]) -> None:
    """Let geoms of a scene, by their numbers in the model, cast no shadow; a clear plane would cast a full one."""
    for geom in scene.geoms[: scene.ngeom]:
        if geom.objtype == mujoco.mjtObj.mjOBJ_GEOM and geom.objid in geoms:
            geom.category = mujoco.mjtCatBit.mjCAT_DECOR


def has_haze(model: mujoco.MjModel) -> bool:
    """Return whether a model states a haze of its own; MuJoCo draws haze only where a scene's flag asks for it."""
    stated = EXTENT_M * float(model.vis.map.fogstart), EXTENT_M * float(model.vis.map.fogend)
    return stated != NO_HAZE_M


def add_haze(model: mujoco.MjModel, scene: mujoco.MjvScene) -> None:
    """Let a scene show the haze of its model, if that has any."""
    scene.flags[mujoco.mjtRndFlag.mjRND_FOG] = has_haze(model)


def add_sky(spec: mujoco.MjSpec, look: Look) -> None:
    """Give a model a background in the haze's colour, where a view ends beyond all that is drawn."""
    if look.hazy:
        sky = spec.add_texture(name="haze", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, width=8, height=8)
        sky.builtin, sky.rgb1 = mujoco.mjtBuiltin.mjBUILTIN_FLAT, look.haze_rgb
        sky.rgb2 = look.haze_rgb


def add_headlamp(spec: mujoco.MjSpec, robot: str, look: Look, height_m: float) -> None:
    """Give a robot a lamp that casts shadows, `height_m` above its body's origin; a look without one leaves it."""
    if look.lamp_rgb is None:
        return
    spec.body(robot).add_light(
        name=f"{robot}_lamp",
        pos=[0, 0, height_m],
        dir=[1, 0, -0.06],
        type=mujoco.mjtLightType.mjLIGHT_SPOT,
        cutoff=LAMP_CUTOFF_DEG,
        exponent=4.0,
        castshadow=True,
        attenuation=[0.8, 0.02, 0.004],
        diffuse=look.lamp_rgb,
        specular=[look.glint] * 3,
    )
    spec.visual.quality.shadowsize = _SHADOW_PX
