"""Pictures that state how they are to be turned, pages, and pixels of other kinds."""

import io

import cv2
import numpy as np
import pytest
import rasterio
from PIL import Image as Pillow
from rasterio.transform import Affine

from minesurveys.pictures.georeference import find_placement
from minesurveys.pictures.image import read_image
from pipeline.errors import InputError
from pipeline.survey.detect import detect_survey
from tests.mines import TEE, frame_for, plan_of


def picture():
    """Return a grey picture without any symmetry."""
    grey = np.full((40, 64), 255, np.uint8)
    grey[4:12, 6:50] = 0
    grey[4:34, 6:14] = 90
    return grey


def saved(kind, orientation):
    exif, stream = Pillow.Exif(), io.BytesIO()
    exif[274] = orientation
    Pillow.fromarray(picture()).save(stream, kind, **({"tiffinfo": exif} if kind == "TIFF" else {"exif": exif}))
    return stream.getvalue()


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "TIFF"])
@pytest.mark.parametrize("orientation", [0, 1, 2, 3, 4, 5, 6, 7, 8, 9])
def test_a_picture_is_read_as_it_is_to_be_shown(tmp_path, kind, orientation):
    data = saved(kind, orientation)
    (tmp_path / "a.img").write_bytes(data)
    shown = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)  # OpenCV's own reading of the tag
    read = read_image(tmp_path / "a.img", 1.0)
    np.testing.assert_array_equal(read, shown)
    assert read.flags.c_contiguous  # else OpenCV does not draw in it


@pytest.mark.parametrize("kind", ["JPEG", "PNG"])
def test_a_broken_exif_block_leaves_the_picture_as_it_is_stored(tmp_path, kind):
    data = saved(kind, 6)
    block = data.index(b"II*\0") if b"II*\0" in data else data.index(b"MM\0*")
    for at in range(block, block + 26):  # a header, and a list of one tag
        (tmp_path / "a.jpg").write_bytes(data[:at] + b"\xff" + data[at + 1 :])
        try:
            assert sorted(read_image(tmp_path / "a.jpg", 1.0).shape) == [3, 40, 64]
        except InputError as error:
            assert "a.jpg" in str(error)  # noqa: PT017  some of these bytes are the picture's own


def test_a_turned_picture_with_a_georeference_is_refused(tmp_path):
    (tmp_path / "a.jpg").write_bytes(saved("JPEG", 6))
    (tmp_path / "a.jgw").write_text("0.1 0 0 -0.1 0 0")
    with pytest.raises(InputError, match=r"a\.jpg: it is stored turned \(orientation 6\)"):
        find_placement(tmp_path / "a.jpg")


@pytest.mark.parametrize(
    ("pixels", "message"),
    [
        (np.int16, "pixels of int16; uint8, uint16, and shares"),
        (np.int32, "pixels of int32"),
        (np.float32, "pixels of float32 from 0 to 255"),
    ],
)
def test_pixels_that_are_no_grey_values_are_refused(tmp_path, pixels, message):
    with rasterio.open(
        tmp_path / "a.tif", "w", driver="GTiff", width=64, height=40, count=1, dtype=pixels.__name__
    ) as out:
        out.write(picture().astype(pixels), 1)
    with pytest.raises(InputError, match=message):
        read_image(tmp_path / "a.tif", 1.0)


def test_of_several_pages_the_first_is_read_with_a_warning(tmp_path, capsys):
    one = Pillow.fromarray(picture())
    one.save(tmp_path / "a.tif", save_all=True, append_images=[one.transpose(Pillow.Transpose.FLIP_LEFT_RIGHT)] * 2)
    np.testing.assert_array_equal(read_image(tmp_path / "a.tif", 1.0)[..., 0], picture())
    assert "a.tif: the first of 3 pages is read" in capsys.readouterr().err
    one.save(tmp_path / "b.tif")
    read_image(tmp_path / "b.tif", 1.0)
    assert not capsys.readouterr().err


def test_a_world_file_that_is_a_link_out_of_the_folder_is_not_read(tmp_path):
    (tmp_path / "in").mkdir()
    cv2.imwrite(str(tmp_path / "in/plan.png"), plan_of(TEE, frame_for(TEE)))
    (tmp_path / "secret").write_text("a secret")
    (tmp_path / "in/plan.pgw").symlink_to(tmp_path / "secret")
    with pytest.raises(InputError, match=r"plan\.pgw: a link that leads out of") as error:
        detect_survey(tmp_path / "in/plan.png")
    assert "a secret" not in str(error.value)


@pytest.mark.parametrize(
    ("transform", "message"),
    [
        (Affine(0.125, 0, 0, 0, 0.125, 0), "must be square, north up and not mirrored"),
        (Affine(0.125, 0, 1e17, 0, -0.125, 0), r"its first pixel is at \(1e\+17, .*expected coordinates within"),
    ],
)
def test_a_georeference_that_cannot_be_used_is_named_and_no_bar_is_looked_for(tmp_path, transform, message):
    plan = plan_of(TEE, frame_for(TEE))[..., 0]
    rows, cols = plan.shape
    with rasterio.open(
        tmp_path / "a.tif", "w", driver="GTiff", width=cols, height=rows, count=1, dtype="uint8", transform=transform
    ) as out:
        out.write(plan, 1)
    with pytest.raises(InputError, match=message):
        detect_survey(tmp_path / "a.tif")
