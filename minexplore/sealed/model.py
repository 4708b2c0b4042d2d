"""The names in `mine.xml`: elements and attributes that a world has, and files of the bundle alone.

Elements that read other files, load plugins or make many of one (`include`, `attach`, `extension`, `replicate`, ...)
are none of them; neither are attributes that move the folders of files or size a buffer.
"""

from __future__ import annotations

import re
from collections.abc import Collection

from minexplore.bundle import HFIELDS, MESHES, MODEL, ROCK_TEXTURE, BundleError
from minexplore.sealed.xml import BoundedReader, walk_xml


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


ELEMENTS = _words(
    "asset body camera compiler default geom global headlight hfield inertial light map material mesh mujoco rgba "
    "statistic texture visual worldbody"
)
TEXTS = _words(
    "angle castshadow class colorspace content_type file hfield inertia material mesh model name texture type"
)
NUMBERS = _words(
    "ambient attenuation center conaffinity contype cutoff diaginertia diffuse dir emission exponent extent fog fogend "
    "fogstart fovy friction group mass offheight offwidth pos priority quat reflectance rgba shininess size specular "
    "texcoord vertex xyaxes zfar znear"
)
_FILES = {"mesh": MESHES, "hfield": HFIELDS, "texture": ROCK_TEXTURE}  # what the files of an element begin with
_CONTENTS = ("model/vnd.mujoco.msh", "image/png")  # MuJoCo reads others by other readers
_BUFFER = ("offwidth", "offheight")  # of the renderer, in pixels
_MOST_PIXELS = 4096
_MOST_TEXT, _SHOWN = 200, 60  # characters
_NUMBERS = re.compile(r"[-+.0-9e ]*", re.ASCII)  # finite decimal numbers, as a builder writes them


def check_names(data: bytes, files: Collection[str]) -> None:
    """Refuse a model with other elements or attributes than worlds have, or that names other files than its bundle's.

    Parameters
    ----------
    data : bytes
        Of `mine.xml`.
    files : collection of str
        The names of the bundle's files.

    Raises
    ------
    BundleError
        With the element's path, what it has and what a world has; or as `walk_xml` and `BoundedReader`.
    """
    walk_xml(MODEL, data, _NameReader(files))


class _NameReader(BoundedReader):
    def __init__(self, files: Collection[str]) -> None:
        super().__init__(MODEL)
        self._files = files

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        super().start(tag, attributes)
        if tag not in ELEMENTS:
            raise BundleError(f"{MODEL}: {self.path}: <{tag[:_SHOWN]}> is not allowed; worlds have {_listed(ELEMENTS)}")
        for name, value in attributes.items():
            if name in NUMBERS:
                if not _NUMBERS.fullmatch(value) or (name in _BUFFER and not value.isdecimal()):
                    raise BundleError(f"{self._at(name, value)}, want plain numbers")
                if name in _BUFFER and int(value[:_SHOWN]) > _MOST_PIXELS:
                    raise BundleError(f"{self._at(name, value)}, want at most {_MOST_PIXELS}")
            elif name not in TEXTS:
                known = _listed(TEXTS | NUMBERS)
                raise BundleError(f"{self._at(name[:_SHOWN], value)} is not allowed; worlds have {known}")
            elif len(value) > _MOST_TEXT:
                raise BundleError(f"{self._at(name, value)}, want at most {_MOST_TEXT} characters")
        file, content = attributes.get("file"), attributes.get("content_type")
        if file is not None and not (file in self._files and tag in _FILES and file.startswith(_FILES[tag])):
            raise BundleError(f"{self._at('file', file)}, want a file of the bundle for a <{tag}>")
        if content is not None and content not in _CONTENTS:
            raise BundleError(f"{self._at('content_type', content)}, want {' or '.join(_CONTENTS)}")

    def _at(self, attribute: str, value: str) -> str:
        shown = value if len(value) <= _SHOWN else value[:_SHOWN] + "..."
        return f"{MODEL}: {self.path}@{attribute}: {shown!r}"


def _listed(names: Collection[str]) -> str:
    return ", ".join(sorted(names))
