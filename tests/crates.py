"""The validator of RO-Crates, without a network. It takes a third of a second to load, so its users' workers do it."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path

CONTEXT = "https://w3id.org/ro/crate/1.1/context"


def cached_context(folder: Path) -> Path:
    """Return a cache that answers the validator's one request.

    The `rocrate` package contains the JSON-LD context of RO-Crate 1.3, which has every term of 1.1. `sha256` is newer
    than 1.1 and is removed.
    """
    from requests_cache import CachedRequest, CachedResponse, CachedSession

    context = json.loads(files("rocrate").joinpath("data/ro-crate.jsonld").read_text())
    del context["@context"]["sha256"]
    path = folder / "http"
    request = CachedRequest(method="GET", url=CONTEXT)
    headers = {"Content-Type": "application/ld+json"}
    body = json.dumps(context).encode()
    response = CachedResponse(url=CONTEXT, content=body, headers=headers, request=request, status_code=200)
    CachedSession(cache_name=str(path), backend="sqlite").cache.save_response(response)
    return path


def crate_issues(folder: Path, cache: Path, profile: str, severity: str = "REQUIRED") -> list[str]:
    """Return the validator's messages on a crate."""
    from rocrate_validator.services import validate

    settings = {"rocrate_uri": str(folder), "profile_identifier": profile, "offline": True, "cache_path": cache}
    return [issue.message for issue in validate({**settings, "requirement_severity": severity}).get_issues()]
