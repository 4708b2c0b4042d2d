"""The same bytes on every machine, and figures that can be compared in every clone."""

import json
import subprocess
import sys

import pytest
import yaml

from pipeline.errors import ArtifactError
from pipeline.report.results import ROWS, flat_walls_note, read_metrics, results_table
from tests.project import ROOT, Project

# Kernels of a machine with AVX2 only and of one with SSE only, and one BLAS thread instead of all.
AVX2 = {
    "OPENBLAS_CORETYPE": "Haswell",
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR",
    "LP_NATIVE_VECTOR_WIDTH": "128",
}
SSE_BLAS = {"OPENBLAS_CORETYPE": "Prescott", "OPENBLAS_NUM_THREADS": "2"}


@pytest.mark.slow
@pytest.mark.parametrize("kernels", [AVX2, SSE_BLAS], ids=["AVX2", "SSE-BLAS"])
def test_other_kernels_and_thread_counts_give_the_same_lock(repro, tmp_path, kernels):
    other = Project(tmp_path / "mine", tiny=True)
    done = other.run("dvc", "repro", **kernels)
    assert done.returncode == 0, done.stderr
    one, two = (yaml.safe_load((p.folder / "dvc.lock").read_text())["stages"] for p in (repro, other))
    hashes = [{out["path"]: out["md5"] for s in stages.values() for out in s["outs"]} for stages in (one, two)]
    assert {name for name in hashes[0] if hashes[0][name] != hashes[1][name]} == set()
    assert (repro.folder / "dvc.lock").read_text() == (other.folder / "dvc.lock").read_text()


@pytest.mark.slow  # the lock of the test above holds these bands, too; this one finds the module
def test_other_kernels_fit_the_same_bands():
    code = (
        "from pipeline.surface.relief.spectrum import *; from pipeline.metrics.rock.published import REAL_SWEEP\n"
        "wanted = [Roughness(r.window_m, r.rq_m) for r in REAL_SWEEP]\n"
        "print(fit_bands(wanted, band_wavelengths(0.1, 4.0), 1.0).sd_m.tolist())"
    )
    project = Project.at(ROOT)
    found = {project.run(sys.executable, "-c", code, check=True, **env).stdout for env in ({}, AVX2, SSE_BLAS)}
    assert len(found) == 1


def test_neither_the_lock_nor_a_manifest_nor_the_metrics_hold_load_times(repro):
    manifest = (repro.folder / "artifacts/validation/manifest.json").read_text()
    assert "timings" not in manifest
    assert "timings" not in (repro.folder / "dvc.lock").read_text()
    assert "load_s" not in (repro.folder / "artifacts/validation/metrics.json").read_text()
    timings = json.loads((repro.folder / "artifacts/validation/timings.json").read_text())
    assert timings["world"]["load_s"] > 0


def test_load_times_of_another_world_are_not_shown(repro, tmp_path):
    folder = repro.copy(tmp_path / "mine").folder / "artifacts/validation"
    assert read_metrics(folder)["world.load_s"] > 0
    timings = json.loads((folder / "timings.json").read_text())
    (folder / "timings.json").write_text(json.dumps({**timings, "world_sha256": "0" * 64}))
    metrics = read_metrics(folder)
    assert "world.load_s" not in metrics
    with pytest.raises(ArtifactError, match="no load times of this world"):
        results_table(ROWS, metrics, {})


@pytest.mark.slow
def test_a_clone_compares_its_metrics_with_any_commit(repro, tmp_path):
    project = repro.copy(tmp_path / "mine")
    project.run("git", "add", "-A", check=True)
    project.run("git", "-c", "user.name=t", "-c", "user.email=t@e.org", "commit", "-qm", "run", check=True)
    subprocess.run(["git", "clone", "-q", project.folder, tmp_path / "clone"], check=True)
    clone = Project.at(tmp_path / "clone")
    path = clone.folder / "artifacts/validation/metrics.json"
    metrics = json.loads(path.read_text())
    before = metrics["iou"]["free_space_vs_cleaned"]
    metrics["iou"]["free_space_vs_cleaned"] = 0.5
    path.write_text(json.dumps(metrics))
    done = clone.run("dvc", "metrics", "diff", "--json", check=True)
    assert "failed to load" not in done.stderr
    found = json.loads(done.stdout)["artifacts/validation/metrics.json"]["iou.free_space_vs_cleaned"]
    assert (found["old"], found["new"]) == (before, 0.5)


def test_clean_keeps_the_metrics_that_git_tracks_and_nothing_else(repro, tmp_path):
    project = repro.copy(tmp_path / "mine")
    project.run("make", "clean", check=True)
    left = {p.relative_to(project.folder).as_posix() for p in (project.folder / "artifacts").rglob("*") if p.is_file()}
    assert left == {"artifacts/.gitignore", "artifacts/validation/metrics.json"}


def test_an_axis_on_which_flat_walls_score_high_is_called_uninformative():
    metrics = {"texture.published.a": 0.99, "texture.flat_walls.published.a": 0.95, "iou.rock": 0.99}
    assert flat_walls_note(metrics, "texture.published.a") == " (flat walls 0.950: uninformative)"
    metrics["texture.flat_walls.published.a"] = 0.4
    assert flat_walls_note(metrics, "texture.published.a") == " (flat walls 0.400)"
    assert flat_walls_note(metrics, "texture.flat_walls.published.a") == ""
    assert flat_walls_note(metrics, "iou.rock") == ""
