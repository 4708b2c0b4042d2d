"""A plan's picture made ready to trace: a page drawn, a box cut out, turned, dark workings on light paper."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pypdfium2

from pipeline.errors import GeometryError, InputError
from pipeline.geometry.binarize import dark_pixels
from pipeline.geometry.line_drawing import fill_line_drawing
from pipeline.params.survey import PlanSurveyParams
from pipeline.survey.image import MAX_SIDE_PX, read_image, require_workings_drawn
from pipeline.survey.shapes import read_text_bytes
from pipeline.types import Image


def read_picture(path: Path, params: PlanSurveyParams) -> Image:
    """Read an image or a page of a PDF, as it is.

    Raises
    ------
    InputError
        If it cannot be read or is too large.
    """
    if path.suffix.lower() == ".pdf":
        return require_workings_drawn(path, draw_page(path, params.page, params.dpi, params.max_megapixels))
    return read_image(path, params.max_megapixels)


def draw_page(path: Path, page: int, dpi: float, max_megapixels: float) -> Image:
    """Draw a page of a PDF on white paper as (rows, cols, 3) uint8 BGR.

    Raises
    ------
    InputError
        If the file is no PDF, has no such page, or the page would be larger than is read.
    """
    try:
        document = pypdfium2.PdfDocument(read_text_bytes(path))
        try:
            if page > len(document):
                raise InputError(f"{path}: survey.page = {page}: it has {len(document)} pages")
            sheet = document[page - 1]
            wide, high = (side * dpi / 72 for side in sheet.get_size())
            if max(wide, high) > MAX_SIDE_PX or wide * high > max_megapixels * 1e6 or min(wide, high) < 8:
                raise InputError(
                    f"{path}: page {page} is {wide:.0f} x {high:.0f} px at survey.dpi = {dpi:g}; "
                    f"at most {MAX_SIDE_PX} px a side and {max_megapixels:g} megapixels are read"
                )
            return np.ascontiguousarray(sheet.render(scale=dpi / 72).to_numpy()[..., :3])
        finally:
            document.close()
    except pypdfium2.PdfiumError as error:
        raise InputError(f"{path}: not a PDF that can be read ({error})") from error


def make_ready(path: Path, picture: Image, params: PlanSurveyParams) -> Image:
    """Cut, clean and turn a picture as the parameters say, to dark on light.

    Raises
    ------
    InputError
        If the box lies beyond the picture.
    """
    if params.crop_px is not None:
        col0, row0, col1, row1 = params.crop_px
        if not (col0 >= 0 and row0 >= 0 and col1 <= picture.shape[1] and row1 <= picture.shape[0]):
            raise InputError(
                f"survey.crop_px = {[*params.crop_px]}: not inside {picture.shape[1]} x {picture.shape[0]} px"
            )
        picture = picture[row0:row1, col0:col1]
    for ignored in params.ignore_colours:
        apart = np.abs(picture.astype(int) - np.array(ignored.rgb[::-1])).max(axis=2)
        paper = np.median(picture[apart > ignored.within], axis=0) if (apart > ignored.within).any() else 255
        picture = np.where(apart[..., None] <= ignored.within, paper, picture).astype(np.uint8)
    if params.light_on_dark:
        picture = 255 - picture
    if params.turn_deg:
        picture, _ = turn_picture(picture, params.turn_deg)
    return picture


def fill_walls(path: Path, picture: Image, params: PlanSurveyParams) -> Image:
    """Return the plan with the workings filled dark, where it draws their walls as lines.

    Raises
    ------
    InputError
        If the walls enclose nothing, or a seed lies outside them.
    """
    dark = dark_pixels(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY))
    try:
        inside = fill_line_drawing(dark, list(params.seeds_px), params.wall_gap_px)
    except GeometryError as error:
        raise InputError(f"{path}: {error}") from error
    return np.where(inside[..., None], 40, 255).astype(np.uint8).repeat(3, axis=2)


def turn_picture(picture: Image, turn_deg: float, paper: int = 255) -> tuple[Image, np.ndarray]:
    """Turn a picture counter-clockwise onto larger paper; return it and the (2, 3) map of image points.

    `paper` is the grey value of what is added.

    Raises
    ------
    InputError
        If the turned picture is larger than is rendered.
    """
    rows, cols = picture.shape[:2]
    turn = cv2.getRotationMatrix2D((cols / 2, rows / 2), turn_deg, 1.0)
    cos, sin = abs(turn[0, 0]), abs(turn[0, 1])
    wide, high = int(np.ceil(cols * cos + rows * sin - 1e-6)), int(np.ceil(cols * sin + rows * cos - 1e-6))
    if max(wide, high) > MAX_SIDE_PX:
        raise InputError(
            f"survey.turn_deg = {turn_deg:g}: the picture would be {wide} x {high} px, at most {MAX_SIDE_PX} a side"
        )
    turn[:, 2] += wide / 2 - cols / 2, high / 2 - rows / 2
    on_centres = turn.copy()  # OpenCV counts from pixel centres, the image plane from corners
    on_centres[:, 2] += turn[:, :2] @ (0.5, 0.5) - 0.5
    turned = cv2.warpAffine(picture, on_centres, (wide, high), flags=cv2.INTER_AREA, borderValue=(paper, paper, paper))
    return turned, turn
