"""Prepare a plan's picture for tracing: crop, rotate, and make workings dark on light paper."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from minesurveys.errors import GeometryError, InputError
from minesurveys.limits import FILE, reader_limits
from minesurveys.pictures.image import read_image, require_workings_drawn
from minesurveys.pictures.pages import read_page
from minesurveys.pictures.picture_header import MAX_SIDE_PX
from minesurveys.remarks import warn_user
from pipeline.geometry.drawing.bounded import read_bounded
from pipeline.geometry.drawing.line_drawing import fill_line_drawing
from pipeline.geometry.outline.binarize import dark_pixels
from pipeline.params.survey import PlanSurveyParams
from pipeline.survey.drawing.light import BETTER_LIGHT, even_light
from pipeline.survey.drawing.reduction import reduce_picture, size_read
from pipeline.types import Image

_DARK, _LEAST_DARK = 160, 1e-3  # ink on evened paper, and its least share of a photograph


def read_picture(path: Path, params: PlanSurveyParams) -> Image:
    """Read an image or a PDF page without changing it.

    Raises
    ------
    InputError
        If it cannot be read or is too large.
    """
    if path.suffix.lower() == ".pdf":
        return require_workings_drawn(path, read_page(path, params.page, params.dpi, params.max_megapixels))
    return read_image(path, params.max_megapixels)


def make_ready(path: Path, picture: Image, params: PlanSurveyParams) -> tuple[Image, bool]:
    """Crop, reduce, clean and rotate a picture by the parameters; the result is dark on light.

    Returns
    -------
    picture : (rows, cols, 3) uint8
    evened : bool
        Whether its light was uneven, as in a photograph, and was evened out, with a remark.

    Raises
    ------
    InputError
        If the crop box is not inside the picture, or a photograph shows nothing but paper.
    """
    if params.crop_px is not None:
        col0, row0, col1, row1 = params.crop_px
        if not (col0 >= 0 and row0 >= 0 and col1 <= picture.shape[1] and row1 <= picture.shape[0]):
            raise InputError(
                f"survey.crop_px = {[*params.crop_px]}: not inside the picture of "
                f"{picture.shape[1]} x {picture.shape[0]} px"
            )
        picture = picture[row0:row1, col0:col1]
    picture = reduce_picture(picture, params.reduction)
    picture, darkest = even_light(255 - picture if params.light_on_dark else picture)
    if darkest < 1:
        if (picture.max(axis=2) < _DARK).mean() < _LEAST_DARK:
            raise InputError(f"{path}: nothing in it is much darker than its paper{BETTER_LIGHT}")
        warn_user(
            "light is uneven, as in a photograph, and is evened out: the darkest paper has "
            f"{100 * darkest:.0f} % of the light of the lightest",
            of=path.name,
        )
    for ignored in params.ignore_colours:
        colour = np.array(ignored.rgb[::-1])
        colour = 255 - colour if params.light_on_dark else colour
        has_colour = cv2.inRange(picture, colour - ignored.within, colour + ignored.within) > 0
        paper = 255 if has_colour.all() else np.median(picture[~has_colour], axis=0).astype(np.uint8)
        picture = picture.copy()
        picture[has_colour] = paper
    if params.turn_deg:
        picture, _ = turn_picture(picture, params.turn_deg)
    return picture, darkest < 1


def require_few_regions(path: Path, picture: Image) -> None:
    """Refuse a picture with more separate dark regions than the limit, such as noise.

    Raises
    ------
    InputError
        The message names the file, the count and the limit.
    """
    dark = dark_pixels(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)).astype(np.uint8)
    count = cv2.connectedComponents(dark)[0] - 1
    most = reader_limits().regions
    if count > most:
        raise InputError(
            f"{path}: {count} separate dark regions, the limit is {most} (regions in {FILE}); is it noise? "
            "--crop reads a part"
        )


def fill_walls(path: Path, picture: Image, params: PlanSurveyParams) -> Image:
    """Fill the workings of a line drawing, so that they are dark on light paper; parameters are in its px.

    Raises
    ------
    InputError
        If the walls enclose no area, or a seed is outside the walls.
    """
    dark = dark_pixels(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY))
    try:
        inside = fill_line_drawing(dark, list(params.seeds_px), params.wall_gap_px)
    except GeometryError as error:
        raise InputError(f"{path}: {error}{size_read(params.reduction)}") from error
    return np.where(inside[..., None], 40, 255).astype(np.uint8).repeat(3, axis=2)


def keep_workings(path: Path, picture: Image, params: PlanSurveyParams) -> Image:
    """Remove everything but the workings from a drawing; they are dark on light paper.

    Raises
    ------
    InputError
        If the workings are not found beyond doubt. The message names the option that settles it.
    """
    try:
        inside = read_bounded(picture, params.level, params.reduction).mask
    except GeometryError as error:
        raise InputError(f"{path}: {error}") from error
    return np.where(inside[..., None], 40, 255).astype(np.uint8).repeat(3, axis=2)


def turn_picture(picture: Image, turn_deg: float) -> tuple[Image, np.ndarray]:
    """Rotate a picture counter-clockwise. Return it and the (2, 3) affine map of image points.

    The result is large enough to hold the whole picture. The added pixels are white.

    Raises InputError if the rotated picture exceeds 16,384 px a side.
    """
    rows, cols = picture.shape[:2]
    turn = cv2.getRotationMatrix2D((cols / 2, rows / 2), turn_deg, 1.0)
    cos, sin = abs(turn[0, 0]), abs(turn[0, 1])
    width, height = int(np.ceil(cols * cos + rows * sin - 1e-6)), int(np.ceil(cols * sin + rows * cos - 1e-6))
    if max(width, height) > MAX_SIDE_PX:
        raise InputError(
            f"survey.turn_deg = {turn_deg:g}: the picture would be {width} x {height} px, "
            f"the limit is {MAX_SIDE_PX} px a side"
        )
    turn[:, 2] += width / 2 - cols / 2, height / 2 - rows / 2
    on_centres = turn.copy()  # OpenCV's origin is a pixel's centre, that of the image plane its corner
    on_centres[:, 2] += turn[:, :2] @ (0.5, 0.5) - 0.5
    white = (255, 255, 255)
    return cv2.warpAffine(picture, on_centres, (width, height), flags=cv2.INTER_AREA, borderValue=white), turn
