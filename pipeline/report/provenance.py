"""The manifests as an RO-Crate: the files of the default world, and the stage run and code that made each file."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import yaml
from rocrate.model import ContextEntity, Entity
from rocrate.rocrate import ROCrate

from pipeline.errors import ArtifactError
from pipeline.store.files import replace_folder
from pipeline.store.hashing import read_text_file, sha256_bytes
from pipeline.store.manifest import Manifest, read_manifest
from pipeline.store.registry import Entry, read_registry
from pipeline.store.verify import verify_chain, verify_world
from pipeline.store.written import Written

WORLD = Path("artifacts/realism/world")
_METADATA = "ro-crate-metadata.json"
_CRATE_VERSION, _PROFILE = "1.1", "https://w3id.org/ro/wfrun/process/0.5"
_SHA256 = "https://w3id.org/ro/terms/workflow-run#sha256"  # RO-Crate 1.1 has no term of its own
_FORMATS = {
    ".csv": "text/csv",
    ".dot": "text/vnd.graphviz",
    ".geojson": "application/geo+json",
    ".jpg": "image/jpeg",
    ".json": "application/json",
    ".png": "image/png",
    ".py": "text/x-python",
    ".xml": "application/xml",
    ".yaml": "application/yaml",
}


def write_crate(folder: Path, published: date) -> int:
    """Write the default world, its inputs and its stages as an RO-Crate with copies of the files.

    The working directory must be the project's root. Each stage run is a `CreateAction`: its instrument is the stage's
    code, its objects are inputs and parameters, its results are outputs. The only date in the crate is `published`, so
    equal artifacts give equal bytes.

    Parameters
    ----------
    folder : Path
        The folder of the crate; an earlier crate there is replaced, a folder with anything else is refused.
    published : date
        The date of publication, which RO-Crate requires; the command uses the day of the last commit.

    Returns
    -------
    int
        Number of files in the crate, without its metadata.

    Raises
    ------
    ArtifactError, InputError
        If `python -m pipeline verify` would fail; a crate is written only from valid manifests.

    References
    ----------
    RO-Crate 1.1, doi:10.5281/zenodo.4541002; Process Run Crate 0.5, https://w3id.org/ro/wfrun/process/0.5
    """
    verify_chain(Path())
    crate = _describe_project(published)
    registry, files = read_registry(), dict[str, bytes]()
    actions = [
        _record_run(crate, files, registry, read_manifest(path), path.as_posix())
        for path in sorted(Path().glob("artifacts/*/manifest.json"))
    ]
    crate.root_dataset["mentions"] = actions
    _group_world(crate, files)
    metadata = json.dumps(crate.metadata.generate(), indent=1, sort_keys=True, ensure_ascii=False) + "\n"
    replace_folder(folder, {**files, _METADATA: metadata.encode()}, _earlier_crate(folder))
    return len(files)


def _earlier_crate(folder: Path) -> Written:
    """Return the files of the crate that a folder holds, by its metadata; none if it holds no crate."""
    try:
        entities = json.loads(read_text_file(folder / _METADATA))["@graph"]
        files = {str(e["@id"]): str(e["sha256"]) for e in entities if "sha256" in e and not e["@id"].startswith("#")}
    except (OSError, ArtifactError, ValueError, TypeError, LookupError, AttributeError, RecursionError):
        return {}
    return {_METADATA: None, **{unquote(name): digest for name, digest in files.items()}} if files else {}


def last_commit_date() -> date:
    """Return the day of the project's last commit.

    Raises
    ------
    ArtifactError
        If the project is no git repository or has no commit.
    """
    done = subprocess.run(["git", "log", "-1", "--format=%cs"], capture_output=True, text=True)
    if done.returncode != 0:
        raise ArtifactError("crate: git knows no commit in this folder, whose date the crate needs; give --date")
    return date.fromisoformat(done.stdout.strip())


def _describe_project(published: date) -> ROCrate:
    """Return a crate with title, authors and licence from `CITATION.cff`."""
    citation = yaml.safe_load(Path("CITATION.cff").read_text())
    crate = ROCrate(version=_CRATE_VERSION)
    crate.metadata.extra_terms["sha256"] = _SHA256
    root = crate.root_dataset
    root["name"] = citation["title"]
    root["description"] = "A mine world for MuJoCo: its survey, every intermediate result, and every stage run."
    root["datePublished"] = published.isoformat()
    root["conformsTo"] = _context(crate, _PROFILE, "CreativeWork", name="Process Run Crate", version="0.5")
    root["license"] = _licence(crate, citation["license"])
    authors = [_author(crate, number, author) for number, author in enumerate(citation["authors"], start=1)]
    root["author"] = authors if len(authors) > 1 else authors[0]
    return crate


def _author(crate: ROCrate, number: int, author: dict[str, str]) -> Entity:
    """Return the entity of a person or an organization in `CITATION.cff`."""
    if "family-names" in author:
        return _context(crate, f"#author-{number}", "Person", name=f"{author['given-names']} {author['family-names']}")
    return _context(crate, f"#author-{number}", "Organization", name=author["name"])


def _record_run(
    crate: ROCrate, files: dict[str, bytes], registry: dict[str, Entry], manifest: Manifest, manifest_file: str
) -> Entity:
    """Add one stage run: its code, inputs, parameters, outputs and manifest."""
    stage = manifest.stage
    inputs = [
        _input(crate, files, registry[name.removeprefix("data/")])
        if name.startswith("data/")
        else _file(crate, files, name)
        for name in manifest.inputs
    ]
    params = [
        _context(crate, f"#{stage}.{name}", "PropertyValue", name=name, value=value)
        for name, value in flatten(manifest.params)
    ]
    code = _file(
        crate,
        files,
        f"stages/{stage}.py",
        type=["File", "SoftwareSourceCode"],
        version=manifest.code_sha256,
        description="The version is one sha256 over this file and all modules of the project that it imports.",
    )
    action = crate.add_action(
        code,
        f"#run-{stage}",
        object=inputs + params,
        result=[_file(crate, files, name) for name in manifest.outputs],
        properties={"name": f"Stage {stage}", "description": f"Run of stage {stage}, MineXplore {manifest.version}"},
    )
    _file(crate, files, manifest_file, description=f"What the run of stage {stage} recorded")["about"] = action
    return action


def flatten(params: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield parameters with dotted names; a list is one value in JSON, and null is the text `null`."""
    for name, value in params.items():
        if isinstance(value, dict):
            yield from flatten(value, f"{prefix}{name}.")
        else:
            yield prefix + name, value if isinstance(value, str | int | float) else json.dumps(value)


def _input(crate: ROCrate, files: dict[str, bytes], entry: Entry) -> Entity:
    """Add an input of the registry; without a stated licence, only name and hash are added, not the file."""
    if entry.licence == "none stated":
        name = f"data/{entry.name}"
        described = {"name": name, "sha256": entry.sha256, "description": f"Origin: {entry.origin}. No licence stated."}
        return _context(crate, f"#{name}", "CreativeWork", **described)
    return _file(
        crate,
        files,
        f"data/{entry.name}",
        description=f"Origin: {entry.origin}",
        license=_licence(crate, entry.licence),
    )


def _file(crate: ROCrate, files: dict[str, bytes], name: str, **properties: Any) -> Entity:
    """Return the entity of a file of the project; if it is new, add it to the crate and its bytes to `files`."""
    if name not in files:
        files[name] = data = Path(name).read_bytes()
        kind = properties.pop("type", "File")
        described = {"name": name, "sha256": sha256_bytes(data), "contentSize": str(len(data))}
        described["encodingFormat"] = _FORMATS.get(Path(name).suffix, "application/octet-stream")
        return crate.add_file(dest_path=name, properties={"@type": kind, **described, **properties})
    return next(entity for entity in crate.data_entities if entity.get("name") == name)


def _group_world(crate: ROCrate, files: dict[str, bytes]) -> None:
    """Add the world bundle as a folder with the world's own hash."""
    inside = [_file(crate, files, name) for name in files if Path(name).is_relative_to(WORLD)]
    described = {"name": "World bundle", "identifier": verify_world(WORLD), "hasPart": inside}
    described["description"] = "The MuJoCo world; its identifier is `world_sha256` of world.json."
    crate.add_dataset(dest_path=WORLD, properties=described)


def _licence(crate: ROCrate, licence: str) -> Entity:
    """Return the entity of a licence: an SPDX identifier, or another text from the registry."""
    spdx = f"https://spdx.org/licenses/{licence}"
    return _context(
        crate,
        spdx if " " not in licence else f"#licence-{sha256_bytes(licence.encode())[:8]}",
        "CreativeWork",
        name=licence,
        description=f"Licence {licence}",
    )


def _context(crate: ROCrate, identifier: str, kind: str, **properties: Any) -> Entity:
    return crate.add(ContextEntity(crate, identifier, properties={"@type": kind, **properties}))
