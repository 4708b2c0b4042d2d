"""A bundle with all that an export reads of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pipeline.commands.proofs import limits_of_kind
from pipeline.export.extract import load_checked, read_scene
from pipeline.export.scene import ExportScene, ReadScene
from pipeline.mjcf.bundle import OpenedBundle, open_bundle, read_made_by
from pipeline.params.validation import ValidationParams
from pipeline.proof.claims import allowed_claims


@dataclass(frozen=True)
class ExportedWorld:
    """A bundle with all that an export reads of it."""

    bundle: Path
    opened: OpenedBundle
    scene: ExportScene
    params: ValidationParams

    @classmethod
    def at(cls, bundle: Path, *overrides: str) -> ExportedWorld:
        """Open a bundle."""
        opened, claims = open_bundle(bundle), read_made_by(bundle)
        scene = read_scene(opened.record, load_checked(bundle), "CC-BY-4.0")
        return cls(bundle, opened, scene, allowed_claims(bundle, claims, limits_of_kind(claims.kind, list(overrides))))

    @property
    def read(self) -> ReadScene:
        """Return the scene as a loader without faults would read it."""
        scene = self.scene
        return ReadScene(scene.facts.to_json(), scene.parts, scene.surfaces, len(scene.lights))
