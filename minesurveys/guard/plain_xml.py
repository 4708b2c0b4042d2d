"""Parse XML of a user's file: nothing in it is expanded, and it names no other file."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element, ParseError

from defusedxml import DefusedXmlException
from defusedxml.ElementTree import fromstring

from minesurveys.errors import InputError


def read_plain_xml(path: Path, data: bytes) -> Element:
    """Return the root of a file's XML.

    Parameters
    ----------
    path : Path
        Messages name it.
    data : bytes
        The file's content.

    Raises
    ------
    InputError
        If it is not well formed, or has a document type, which could expand texts and name other files.
    """
    try:
        return fromstring(data, forbid_dtd=True)
    except DefusedXmlException as error:
        raise InputError(
            f"{path}: has a document type (<!DOCTYPE>), which is not read; delete it from the file"
        ) from error
    except (ParseError, ValueError, LookupError) as error:
        line = f":{error.position[0]}" if isinstance(error, ParseError) else ""
        raise InputError(f"{path}{line}: not well-formed XML; it is broken or cut off") from error


def plain_name(element: Element) -> str:
    """Return an element's name without its namespace, whose version differs between programs."""
    return element.tag.rpartition("}")[2]
