"""Write the figures of the evidence: the replay on the published plan, and the results of the proof targets."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from benchmarks.comparisons.compare_paper import run_pipeline
from pipeline.compose import compose
from pipeline.errors import ArtifactError, MineError
from pipeline.report.results import shrink_picture
from pipeline.store.files import write_atomically

PLAN = Path("artifacts/benchmarks/plan")
PROOF = Path("artifacts/proof")
DOCS = Path("docs")


def read(path: Path, target: str) -> Any:
    """Return the content of a JSON file.

    Raises
    ------
    ArtifactError
        If the file is missing. The message names the command that writes it.
    """
    try:
        return json.loads(path.read_text())
    except FileNotFoundError:
        raise ArtifactError(f"{path}: missing; run `python -m benchmarks {target}` first") from None


def replay_table(report: dict[str, Any]) -> list[str]:
    """Return the replay's results as Markdown."""
    lines = [
        "## LiDAR replay on the published plan (`survey=plan`)",
        "",
        "| sweep | returns used | median, m | p90, m | within 0.25 m | within 0.5 m | bias, m "
        "| median on the rough surface, m | median without range and angle gates, m "
        "| correction of the pose, m, deg |",
        "|---" * 10 + "|",
    ]
    for name, s in report["sweeps"].items():
        c = s["collision"]
        dx, dy = s["correction_m"]
        shown = [
            name,
            f"{s['used']:,} of {s['returns']:,}",
            f"{c['median_m']:.3f}",
            f"{c['p90_m']:.2f}",
            f"{c['within_0_25_m']:.2f}",
            f"{c['within_0_5_m']:.2f}",
            f"{c['bias_m']:+.3f}",
            f"{s['visible']['median_m']:.3f}",
            f"{s['every_return_median_m']:.3f}",
            f"{dx:+.2f}, {dy:+.2f}, {s['correction_deg']:+.2f}",
        ]
        lines.append(f"| {' | '.join(shown)} |")
    low, high = (scale * report["plan_px_per_m"] for scale in report["scale_interval"])
    lines += [
        "",
        f"The sweeps imply a scale of {report['implied_px_per_m']:.2f} px/m ({low:.2f} to {high:.2f}); the plan's bar "
        f"gives {report['plan_px_per_m']:.2f}. All poses are rotated by {report['turn_deg']:.2f} deg.",
    ]
    return lines


def certificate_table(title: str, certificate: dict[str, Any]) -> list[str]:
    """Return a certificate as Markdown."""
    rows = [
        f"| `{name}` | {clause['value']} | {', '.join(f'{k} {v:g}' for k, v in clause['limit'].items())} "
        f"| {'yes' if clause['holds'] else 'NO'} |"
        for name, clause in certificate["clauses"].items()
    ]
    return [
        f"## Certificate: {title}, {certificate['contacts']:,} contacts",
        "",
        "| clause | value | limit | holds |",
        "|---|---|---|---|",
        *rows,
    ]


def proof_tables() -> list[str]:
    """Return the results of the stress test, parity, holdout and mutants as Markdown."""
    lines = certificate_table("the embedded survey", read(PROOF / "certificate.json", "stress-test"))
    parity = read(PROOF / "parity.json", "parity")
    lines += ["", "## Backends", "", "| backend | rays | agree | within, m | worst, m |", "|---|---|---|---|---|"]
    lines += [
        f"| {name} | {p['rays']:,} | {p['agree']:,} | {p['tolerance_m']:g} | {p['worst_m']:g} |"
        for name, p in parity["backends"].items()
    ]
    lines += [f"| {name} | not run: {reason} | | | |" for name, reason in parity["left_out"].items()]
    holdout = read(PROOF / "holdout.json", "holdout")
    lines += ["", "## Held-out sweeps: roughness of the built wall / roughness of the held-out sweeps", ""]
    windows = holdout["splits"][0]["window_m"]
    lines += [
        "| built from | held out | " + " | ".join(f"{w:g} m" for w in windows) + " |",
        "|---" * (len(windows) + 2) + "|",
    ]
    for split in holdout["splits"]:
        ratios = " | ".join(f"{r:.2f}" for r in split["built_vs_held_out"])
        lines.append(f"| {', '.join(split['built_from'])} | {', '.join(split['held_out'])} | {ratios} |")
    lines += [
        "",
        f"The typical factor is {holdout['built_factor']:.2f}; between the two halves of the sweeps it is "
        f"{holdout['source_factor']:.2f}.",
    ]
    mutants = read(PROOF / "mutants.json", "mutants")
    lines += [
        "",
        f"## Mutants: {mutants['caught']} of {mutants['total']} caught",
        "",
        "| fault | check | |",
        "|---|---|---|",
    ]
    lines += [f"| {r['fault']} | {r['expected']} | {'caught' if r['caught'] else 'MISSED'} |" for r in mutants["rows"]]
    return [*lines, "", f"{mutants.get('random', 'no random mutants')}."]


def main() -> int:
    """Run the pipeline on the plan if necessary, and write `evidence-figures.md` and `docs/replay.jpg`."""
    try:
        proof = proof_tables()
        run_pipeline(PLAN, compose(["survey=plan"]).model_dump(mode="json"))
        report = read(PLAN / "artifacts/validation/replay.json", "evidence")
        plan = read(PLAN / "artifacts/validation/certificate.json", "evidence")
        head = [
            "# Figures of the evidence",
            "",
            "Written by `python -m benchmarks evidence`. [The page](../certificate.md) explains the figures.",
            "",
        ]
        lines = [*head, *replay_table(report), "", *certificate_table("the published plan", plan), "", *proof]
        write_atomically(DOCS / "evidence/parts/evidence-figures.md", ("\n".join(lines) + "\n").encode())
        write_atomically(DOCS / "replay.jpg", shrink_picture(PLAN / "artifacts/validation/replay.png"))
    except MineError as error:
        print(f"evidence: {error}", file=sys.stderr)
        return 2
    print(f"{DOCS / 'evidence/parts/evidence-figures.md'} and {DOCS / 'replay.jpg'} are written")
    return 0


if __name__ == "__main__":
    sys.exit(main())
