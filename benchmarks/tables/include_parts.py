"""A hook of MkDocs: on the site, a line that is only a link to a generated table is replaced by that table.

On a page of `docs/evidence/`, `[The table](parts/NAME.md)` on a line of its own is such a link. In the repository it
stays a link.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

_LINK = re.compile(r"^\[[^\]]+\]\((parts/[a-z-]+\.md)\)$", flags=re.M)
_HEADING = re.compile(r"^#", flags=re.M)


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Return a page's Markdown with its parts; MkDocs calls this for each page."""
    folder = Path(page.file.abs_src_path).parent
    return _LINK.sub(lambda link: part(folder / link[1]), markdown)


def part(path: Path) -> str:
    """Return a part as it stands on the page one folder above: without its title, with links from there."""
    _, _, text = path.read_text().partition("\n")
    return _HEADING.sub("##", text).replace("](../", "](").strip()
