import struct
import zlib

import numpy as np
import pytest

from minexplore.bundle import BundleError
from minexplore.sealed.png import PALETTE, RGB, check_png
from pipeline.errors import ParamsError
from pipeline.schema.png import inflate_png
from pipeline.store.codecs import decode
from pipeline.store.palette_png import encode_palette_png
from pipeline.surface.texture.coordinates import relax_texture
from pipeline.surface.texture.layers import Layers, _Canvas, make_rock_texture, reduce_colours
from pipeline.types import Image
from tests.composed import compose

BARE = Layers(0.0, 0.0, 0.0, 0.0, 0.0)
DRY = Layers(1.0, 0.8, 0.6, 0.2, 0.2)
GREY = (140, 130, 120)


def texture(layers, seed=1, size_px=256, colours=32):
    return make_rock_texture(size_px, 3.0, GREY, layers, colours, np.random.default_rng(seed))


def test_a_texture_has_no_more_colours_than_asked_and_repeats_without_a_seam():
    picture = texture(DRY)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) <= 32
    brightness = picture.astype(float).mean(axis=2)
    for axis in (0, 1):
        within = np.abs(np.diff(brightness, axis=axis)).mean()
        across = np.abs(np.take(brightness, 0, axis) - np.take(brightness, -1, axis)).mean()
        assert across < 1.3 * within


def test_the_same_seed_gives_the_same_texture_and_another_seed_another():
    assert (texture(DRY) == texture(DRY)).all()
    assert (texture(DRY) != texture(DRY, seed=2)).mean() > 0.5


@pytest.mark.parametrize(
    ("shortest_m", "longest_m", "across"), [(0.15, 1.5, 1.0), (0.08, 0.8, 0.15), (0.004, 3.0, 1.0)]
)
def test_noise_has_the_digits_of_transforms_of_all_columns(shortest_m, longest_m, across):
    size, step_m = 128, 3.0 / 128
    frequency = np.hypot(np.fft.fftfreq(size, step_m)[:, None] / across, np.fft.rfftfreq(size, step_m)[None, :])
    frequency[0, 0] = np.inf
    kept = (frequency >= 1 / longest_m) & (frequency <= 1 / max(shortest_m, 2.2 * step_m))
    white = np.fft.rfft2(np.random.default_rng(3).standard_normal((size, size)))
    field = np.fft.irfft2(np.where(kept, white * frequency**-1.3, 0.0), s=(size, size))
    made = _Canvas(size, 3.0, np.random.default_rng(3)).noise(shortest_m, longest_m, 1.3, across)
    assert made.tobytes() == (field / field.std()).tobytes()


def test_classes_of_colours_are_those_of_a_sort_of_wide_numbers():
    picture = np.random.default_rng(5).integers(0, 256, (64, 64, 3)).astype(np.uint8)
    pixels = picture.reshape(-1, 3).astype(int)
    bright, warm = pixels @ [2, 5, 1], pixels[:, 0] - pixels[:, 2]
    wanted = np.zeros_like(pixels)
    for members in np.array_split(np.lexsort((warm, bright)), 8):
        for part in np.array_split(members[np.argsort(warm[members], kind="stable")], 4):
            wanted[part] = np.round(pixels[part].mean(axis=0))
    assert (reduce_colours(picture, 32).reshape(-1, 3) == wanted).all()


def test_a_palette_holds_256_colours_in_order_and_no_more(tmp_path):
    colours = np.sort(np.random.default_rng(6).choice(1 << 24, 257, replace=False))[:, None] >> [0, 8, 16] & 255
    picture = colours[np.random.default_rng(7).permutation(np.arange(512) % 256)].reshape(16, 32, 3).astype(np.uint8)
    data = encode_palette_png(picture)
    (tmp_path / "t.png").write_bytes(data)
    assert (decode(tmp_path / "t.png", Image) == picture).all()
    assert colours[:256, ::-1].astype(np.uint8).tobytes() in data
    picture = np.concatenate([picture, np.tile(colours[256], (1, 32, 1)).astype(np.uint8)])
    assert encode_palette_png(picture) is None


def test_wet_streaks_are_dark_and_longer_down_the_wall_than_along_it():
    wet = Layers(0.0, 0.0, 0.0, 1.0, 0.0)
    assert texture(wet).mean() < 0.85 * texture(BARE).mean()
    added, bare = (texture(layers, colours=256).astype(float).mean(axis=2) for layers in (wet, BARE))
    streaks = added / bare  # the same noise lies under both
    down, along = (np.abs(np.diff(streaks, axis=axis)).mean() for axis in (0, 1))
    assert down < 0.8 * along


def test_dust_hides_grain_and_stain():
    dirty = Layers(0.0, 0.8, 0.8, 0.0, 0.0)
    spread = [texture(layers).std(axis=(0, 1)) for layers in (Layers(0.0, 0.8, 0.8, 0.0, 1.0), dirty)]
    assert (spread[0] < 0.7 * spread[1]).all()


def test_a_palette_png_reads_back_the_same_and_a_broken_palette_is_refused(tmp_path):
    picture = texture(DRY)
    data = encode_palette_png(picture)
    (tmp_path / "t.png").write_bytes(data)
    assert (decode(tmp_path / "t.png", Image) == picture).all()
    assert check_png("t.png", data, (RGB, PALETTE), 1 << 20) == (256, 256)
    inflate_png("t.png", data)
    with pytest.raises(BundleError, match="want at most"):
        check_png("t.png", data, (RGB,), 1 << 20)
    many = np.zeros((1, 257, 3), np.uint8)
    many[0, :, 0], many[0, 256, 1] = np.arange(257) % 256, 1
    assert encode_palette_png(many) is None


def test_a_pixel_beyond_the_palette_is_refused():

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    data = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 2, 1, 8, 3, 0, 0, 0))
    data += chunk(b"PLTE", b"\0\0\0\1\1\1") + chunk(b"IDAT", zlib.compress(b"\0\0\2")) + chunk(b"IEND", b"")
    check_png("t.png", data, (PALETTE,), 100)
    with pytest.raises(BundleError, match="colour 2 of a palette of 2"):
        inflate_png("t.png", data)


def ridge(slope):
    """Return a wall in the plane x, z with a ridge along z whose sides are a quarter of a metre wide each."""
    x, z = np.meshgrid(np.linspace(0, 2, 81), np.linspace(0, 1, 21), indexing="ij")
    y = slope * np.clip(0.25 - np.abs(x - 1), 0, None)
    number = np.arange(x.size).reshape(x.shape)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.concatenate([np.stack(f, axis=-1).reshape(-1, 3) for f in ((a, b, c), (a, c, d))])
    return np.column_stack([x.ravel(), y.ravel(), z.ravel()]), faces


def test_a_relaxed_texture_stretches_less_on_a_steep_ridge_and_stays_on_a_plane():
    axes = np.array([[1.0, 0, 0], [0, 0, 1.0]])
    vertices, faces = ridge(2.0)
    laid = vertices[faces][:, :, [0, 2]]
    offset = relax_texture(vertices, faces, laid, np.broadcast_to(axes, (len(faces), 2, 3)), 1.0)
    side = np.abs(vertices[:, 0] - 0.875) < 0.1
    length = np.hypot(1.0, 2.0)  # of ridge in a metre of wall: how far the plan's texture is stretched
    steepness = np.polyfit(vertices[side, 0], vertices[side, 0] + offset[side, 0], 1)[0]
    assert 0.75 * length < steepness < 1.05 * length
    flat, faces = ridge(0.0)
    laid = flat[faces][:, :, [0, 2]]
    assert np.abs(relax_texture(flat, faces, laid, np.broadcast_to(axes, (len(faces), 2, 3)), 1.0)).max() < 1e-9


def test_a_texture_that_leaves_the_plan_needs_a_look():
    with pytest.raises(ParamsError, match="needs a look other than"):
        compose(["look=plain", "fittings=none", "surface.texture.tether_m=0.6"])
    assert compose([]).realism.look == "dry"
