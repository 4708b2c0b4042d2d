"""What describes a corpus: its index, its data card and Croissant metadata."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import date, datetime, time
from pathlib import Path
from typing import Any

import mlcroissant as mlc
import yaml
from pydantic import TypeAdapter, ValidationError

from baselines.base.markdown import markdown_table
from benchmarks.corpus.members import CorpusMember
from minexplore import __version__
from minexplore.bundle import RECORD
from minexplore.extra.corpus import BUNDLE, FORMAT, INDEX, WORLDS
from pipeline.errors import ArtifactError
from pipeline.store.files import write_atomically
from pipeline.store.hashing import read_text_file, sha256_bytes, sha256_file

CARD, TABLE, WRITTEN = "README.md", "worlds.csv", "written.json"
CROISSANT = "croissant.json"
# Column of worlds.csv, its type, and what it is.
_COLUMNS = {
    "name": (mlc.DataType.TEXT, "Name of the world: `minexplore.load('corpus:NAME')`."),
    "kind": (mlc.DataType.TEXT, "surveyed, a style of generated mines, or a kind of mines with heights."),
    "world_sha256": (mlc.DataType.TEXT, "Hash of the world, as in its record."),
    "licence": (mlc.DataType.TEXT, "SPDX identifier of the world's licence."),
    "drifts": (mlc.DataType.INTEGER, "Number of drifts."),
    "loops": (mlc.DataType.INTEGER, "Number of loops of drifts."),
    "tunnel_m2": (mlc.DataType.FLOAT, "Floor area in plan, square metres."),
    "certificate": (mlc.DataType.BOOL, "Whether every clause of its certificate holds."),
    "bytes": (mlc.DataType.INTEGER, "Size of the bundle."),
}


@dataclass(frozen=True)
class CorpusEntry:
    """A world in the corpus's folder: the member, its record, whether its certificate holds, and its bundle's size."""

    member: CorpusMember
    record: dict[str, Any]
    record_sha256: str
    holds: bool
    size: int

    def row(self) -> list[object]:
        """Return the values of `_COLUMNS`."""
        member, record = self.member, self.record
        facts = [member.name, member.kind, record["world_sha256"], member.licence, record["drifts"], record["loops"]]
        return [*facts, round(record["areas"]["tunnel_m2"], 1), self.holds, self.size]


def read_entry(folder: Path, member: CorpusMember) -> CorpusEntry:
    """Return what the corpus's folder has of a member."""
    place = folder / WORLDS / member.name
    text = (place / BUNDLE / RECORD).read_bytes()
    holds = json.loads((place / "certificate.json").read_text())["holds"]
    size = sum(path.stat().st_size for path in (place / BUNDLE).rglob("*") if path.is_file())
    return CorpusEntry(member, json.loads(text), sha256_bytes(text), holds, size)


def write_metadata(folder: Path, entries: list[CorpusEntry], published: date) -> None:
    """Write index, table, data card and Croissant file beside the worlds; equal worlds give equal bytes.

    Raises
    ------
    ArtifactError
        If the folder has another file of one of these names.
    """
    index = {"format": FORMAT, "version": __version__, "worlds": {e.member.name: _index_entry(e) for e in entries}}
    lines = [",".join(_COLUMNS), *(",".join(str(value) for value in entry.row()) for entry in entries)]
    files = {INDEX: _json(index).encode(), TABLE: ("\n".join(lines) + "\n").encode()}
    hashes = {name: sha256_bytes(data) for name, data in files.items()}
    files[CARD] = _card(entries, hashes[INDEX]).encode()
    files[CROISSANT] = _json(_croissant(hashes, entries, published)).encode()
    listed = require_ours(folder)
    for name, data in files.items():
        listed[name] = [sha256_bytes(data), *listed.get(name, [])[:1]]  # and the earlier one, until it is replaced
    for name, data in {WRITTEN: _json(listed).encode(), **files}.items():
        write_atomically(folder / name, data)


def require_ours(folder: Path) -> dict[str, list[str]]:
    """Return the hashes of the description that an earlier call wrote into a folder.

    Raises
    ------
    ArtifactError
        If the folder has another file of one of its names; the message has the name.
    """
    try:
        listed = TypeAdapter(dict[str, list[str]]).validate_json(read_text_file(folder / WRITTEN))
    except FileNotFoundError:
        listed = {}
    except ValidationError as error:
        raise ArtifactError(f"{folder / WRITTEN}: not the list of what was written here; move it away") from error
    for name in (INDEX, TABLE, CARD, CROISSANT):
        path = folder / name
        if os.path.lexists(path) and (path.is_symlink() or sha256_file(path) not in listed.get(name, [])):
            raise ArtifactError(f"{path}: is not as {WRITTEN} lists it; move it away, or give another --out")
    return listed


def _json(value: object) -> str:
    return json.dumps(value, indent=1, ensure_ascii=False) + "\n"


def _index_entry(entry: CorpusEntry) -> dict[str, Any]:
    member = entry.member
    return {
        "record_sha256": entry.record_sha256,
        "world_sha256": entry.record["world_sha256"],
        "kind": member.kind,
        "about": member.about,
        "licence": member.licence,
        "source": member.source,
        "bytes": entry.size,
    }


def _card(entries: list[CorpusEntry], digest: str) -> str:
    """Return the data card."""
    kinds: dict[str, list[CorpusEntry]] = {}
    for entry in entries:
        kinds.setdefault(entry.member.kind, []).append(entry)
    rows = [
        (
            kind,
            len(some),
            f"{min(areas):,.0f} to {max(areas):,.0f}",
            ", ".join(sorted({e.member.licence for e in some})),
        )
        for kind, some in kinds.items()
        for areas in [[e.record["areas"]["tunnel_m2"] for e in some]]
    ]
    surveyed = [(e.member.name, e.member.about, e.member.source, e.member.licence) for e in kinds.get("surveyed", [])]
    sizes = sum(entry.size for entry in entries) / 1e6
    return f"""# Corpus of underground worlds

{len(entries)} worlds for MuJoCo, {sizes:,.0f} MB, made by MineXplore {__version__} (`make corpus`). The certificate of
{sum(entry.holds for entry in entries)} holds.

```python
import gymnasium, minexplore

world = minexplore.load("corpus:{entries[0].member.name}", "FOLDER OR ADDRESS")
env = gymnasium.make("MineXplore/corpus:{entries[0].member.name}-v0")
```

`sha256={digest!r}` as a third argument accepts this index and no other.

{markdown_table(("kind", "worlds", "area, m2", "licence"), rows)}
## Surveyed mines

{markdown_table(("world", "what", "survey", "licence"), surveyed)}
## What a world is

| file below `worlds/NAME` | content |
|---|---|
| `world/` | the bundle: model, visible rock, maps, drift network, record with the hash of each file |
| `certificate.json`, `metrics.json` | how faithful the world is to its survey, each figure with its limit |
| `report.html` | the report: one page that needs no network |
| `mine.png`, `contours.png`, `views.png` | the plan, the traced walls, and views where rock is visible |

`{TABLE}` has a row a world; `{CROISSANT}` describes it all for programs.

## Use and limits

- Meant for learning and judging exploration and navigation underground. Mines of the split `test` are for judging:
  training refuses them by the name in their record.
- Generated mines are drawn by rules from seeds. They are no survey of a place, and their rock is not visible.
- Of surveys with heights, a world has the longest part that wheels can drive.
- No person is in the data. The surveys were published by their authors under the licences above.
"""


def _croissant(hashes: dict[str, str], entries: list[CorpusEntry], published: date) -> dict[str, Any]:
    """Return Croissant 1.0 metadata: the table of worlds as a record set, and the index.

    References
    ----------
    Croissant 1.0, https://docs.mlcommons.org/croissant/docs/croissant-spec.html
    """
    citation = yaml.safe_load(Path("CITATION.cff").read_text())
    files = [
        mlc.FileObject(
            id=name,
            name=name,
            content_url=name,
            encoding_formats=[kind],
            sha256=hashes[name],
        )
        for name, kind in {TABLE: "text/csv", INDEX: "application/json"}.items()
    ]
    fields = [
        mlc.Field(
            id=f"worlds/{column}",
            name=column,
            description=about,
            data_types=[kind],
            source=mlc.Source(file_object=TABLE, extract=mlc.Extract(column=column)),
        )
        for column, (kind, about) in _COLUMNS.items()
    ]
    metadata = mlc.Metadata(
        name="minexplore-corpus",
        description=f"{len(entries)} underground worlds for MuJoCo, each with its certificate and report.",
        url=citation["repository-code"],
        version=__version__,
        date_published=datetime.combine(published, time()),
        license=[f"https://spdx.org/licenses/{licence}" for licence in _licences(entries)],
        creators=[mlc.Organization(name=author["name"]) for author in citation["authors"]],
        cite_as=f"{citation['title']}, version {__version__}, {citation['repository-code']}",
        distribution=files,
        record_sets=[
            mlc.RecordSet(
                id="worlds", name="worlds", description="One record a world.", key="worlds/name", fields=fields
            )
        ],
    )
    described: dict[str, Any] = metadata.to_json()
    return described


def _licences(entries: Iterable[CorpusEntry]) -> list[str]:
    return sorted({entry.member.licence for entry in entries})
