"""Write the figures of the evidence: the replay on the published plan, and the results of the proof targets."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from baselines.base.markdown import markdown_table, write_table
from benchmarks.results import read_written, run_benchmark
from pipeline.build.world import make_world
from pipeline.compose import compose
from pipeline.report.results import shrink_picture
from pipeline.store.files import write_atomically

PLAN = Path("artifacts/benchmarks/plan")
PROOF = Path("artifacts/proof")
DOCS = Path("docs")
_REPLAYED = (
    *("sweep", "returns used", "median, m", "p90, m", "within 0.25 m", "within 0.5 m", "bias, m"),
    *("median on the rough surface, m", "median without range and angle gates, m", "correction of the pose, m, deg"),
)


def replay_table(report: dict[str, Any]) -> list[str]:
    """Return the replay's results as Markdown."""
    rows = []
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
        rows.append(shown)
    low, high = (scale * report["plan_px_per_m"] for scale in report["scale_interval"])
    return [
        "## LiDAR replay on the published plan (`survey=plan`)",
        "",
        markdown_table(_REPLAYED, rows),
        f"The sweeps imply a scale of {report['implied_px_per_m']:.2f} px/m ({low:.2f} to {high:.2f}); the plan's bar "
        f"gives {report['plan_px_per_m']:.2f}. All poses are rotated by {report['turn_deg']:.2f} deg.",
    ]


def certificate_table(title: str, certificate: dict[str, Any]) -> list[str]:
    """Return a certificate as Markdown."""
    rows = (
        (f"`{name}`", c["value"], ", ".join(f"{k} {v:g}" for k, v in c["limit"].items()), "yes" if c["holds"] else "NO")
        for name, c in certificate["clauses"].items()
    )
    table = markdown_table(("clause", "value", "limit", "holds"), rows)
    return [f"## Certificate: {title}, {certificate['contacts']:,} contacts", "", table]


def proof_tables() -> list[str]:
    """Return the results of the stress test, parity, holdout and mutants as Markdown."""
    parity, holdout = read_written(PROOF / "parity.json", "parity"), read_written(PROOF / "holdout.json", "holdout")
    mutants = read_written(PROOF / "mutants.json", "mutants")
    backends = [
        (name, f"{p['rays']:,}", f"{p['agree']:,}", f"{p['tolerance_m']:g}", f"{p['worst_m']:g}")
        for name, p in parity["backends"].items()
    ]
    left_out = [(name, f"not run: {reason}", "", "", "") for name, reason in parity["left_out"].items()]
    windows = [f"{w:g} m" for w in holdout["splits"][0]["window_m"]]
    splits = (
        (", ".join(s["built_from"]), ", ".join(s["held_out"]), *(f"{r:.2f}" for r in s["built_vs_held_out"]))
        for s in holdout["splits"]
    )
    caught = ((r["fault"], r["expected"], "caught" if r["caught"] else "MISSED") for r in mutants["rows"])
    return [
        *certificate_table("the embedded survey", read_written(PROOF / "certificate.json", "stress-test")),
        "## Backends",
        "",
        markdown_table(("backend", "rays", "agree", "within, m", "worst, m"), [*backends, *left_out]),
        "## Held-out sweeps: roughness of the built wall / roughness of the held-out sweeps",
        "",
        markdown_table(("built from", "held out", *windows), splits),
        f"The typical factor is {holdout['built_factor']:.2f}; between the two halves of the sweeps it is "
        f"{holdout['source_factor']:.2f}.",
        "",
        f"## Mutants: {mutants['caught']} of {mutants['total']} caught",
        "",
        markdown_table(("fault", "check", ""), caught),
        f"{mutants.get('random', 'no random mutants')}.",
    ]


def main() -> int:
    """Run the pipeline on the plan if necessary, and write `evidence-figures.md` and `docs/replay.jpg`."""
    proof = proof_tables()
    make_world(compose(["survey=plan"]), PLAN)
    report = read_written(PLAN / "validation/evidence/replay.json", "figures")
    plan = read_written(PLAN / "validation/certificate.json", "figures")
    lines = [*replay_table(report), "", *certificate_table("the published plan", plan), *proof]
    write_table(DOCS / "evidence/parts/evidence-figures.md", "\n".join(lines))
    write_atomically(DOCS / "replay.jpg", shrink_picture(PLAN / "validation/evidence/replay.png"))
    print(f"{DOCS / 'evidence/parts/evidence-figures.md'} and {DOCS / 'replay.jpg'} are written")
    return 0


if __name__ == "__main__":
    sys.exit(run_benchmark("figures", main))
