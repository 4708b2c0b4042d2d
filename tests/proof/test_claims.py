"""What a bundle states to be made by travels with it, and the validator holds it against its own limits."""

import json
import shutil
import zipfile

import pytest

from minexplore.bundle import MADE_BY, RECORD
from minexplore.world import load_world
from pipeline.errors import ArtifactError
from pipeline.mjcf.bundle import read_made_by
from pipeline.params.made_by import MadeBy
from pipeline.proof.claims import allowed_claims, require_own_claims
from tests.composed import compose
from tests.mines import TEE, BuiltMine
from tests.project import Project, message_of


@pytest.fixture(scope="module")
def owned(tmp_path_factory):
    """Return the folder of a light world of the kind that `new` makes of a plan."""
    config = compose(["+mine=own", "preset=light"])
    return BuiltMine(TEE, config, tmp_path_factory.mktemp("owned") / "world").bundle


@pytest.fixture(scope="module")
def allowed():
    return compose(["+mine=own"]).validation


def test_an_own_mine_has_no_dip_that_nobody_surveyed(owned):
    assert json.loads((owned / RECORD).read_text())["tilt_deg"] == 0
    assert compose(["survey=procedural"]).realism.tilt_deg == 5


def claims_of(bundle, **changed):
    return MadeBy.model_validate({**json.loads((bundle / MADE_BY).read_text()), **changed})


def test_a_zipped_bundle_is_certified_in_a_folder_without_a_project(owned, tmp_path):
    archive = shutil.make_archive(str(tmp_path / "sent"), "zip", owned)
    with zipfile.ZipFile(archive) as stored:
        stored.extractall(tmp_path / "elsewhere" / "world")
    done = Project.at(tmp_path / "elsewhere").module("pipeline", "certify", "--bundle", "world", "--contacts", "100")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["holds"] is True
    assert {"intrusion_mm", "missing_mm", "gap_mm"} <= set(json.loads(done.stdout)["clauses"])


def test_a_bundle_that_claims_a_looser_tolerance_than_its_kind_has_is_refused_with_the_option(tee, tmp_path):
    done = Project.at(tmp_path).module("pipeline", "certify", "--bundle", str(tee.bundle), "--contacts", "100")
    said = message_of(done)
    assert "tolerance_m = 0.21: a mine of the kind embedded has at most 0.16; validation.tolerance_m=VALUE" in said
    words = ("certify", "--bundle", str(tee.bundle), "--contacts", "100", "validation.tolerance_m=0.21")
    assert Project.at(tmp_path).module("pipeline", *words).returncode == 0


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"tolerance_m": 0.25}, "tolerance_m = 0.25: a mine of the kind own has at most 0.24"),
        ({"wall_error_m": 0.04}, "tolerance_m = 0.32"),
        ({"collision_method": "coacd"}, "collision_method = coacd: a mine of the kind own has exact"),
        ({"collision_tile_m": 50.0}, "collision_tile_m = 50.0: a mine of the kind own has 400"),
        ({"network_cell_m": 0.0201}, "network_cell_m = 0.0201: a mine of the kind own has at least 0.0625"),
        (
            {"network_station_spacing_m": 1e-9},
            "network_station_spacing_m = 1e-09",
        ),
        ({"network_cell_m": 0.5}, "network_cell_m = 0.5: a mine of the kind own has at most 0.25"),
        ({"network_min_leg_m": 9.0}, "network_min_leg_m = 9: a mine of the kind own has at most 2"),
    ],
)
def test_a_looser_claim_than_the_kind_allows_is_refused(owned, allowed, changed, message):
    with pytest.raises(ArtifactError, match=message.replace("(", r"\(")):
        allowed_claims(owned, claims_of(owned, **changed), allowed)


def test_a_stricter_claim_is_applied_and_the_limits_are_the_validators_own(owned, allowed):
    stricter = {"tolerance_m": 0.05, "wall_error_m": 0.01, "network_cell_m": 0.125}
    found = allowed_claims(owned, claims_of(owned, **stricter), allowed)
    assert (found.tolerance_m, found.network_cell_m) == (0.05, 0.125)
    assert found.limits == allowed.limits
    assert found.certificate == allowed.certificate


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"kind": "anything"}', "kind = 'anything'"),
        ("[]", "made_by.json: want a section of keys"),
        ("{", "not JSON"),
        ('{"kind": NaN}', "kind = NaN"),
        (" " * 20_000, "20000 bytes"),
        (None, "missing; an older version made this world"),
    ],
)
def test_claims_that_are_no_claims_are_refused_in_one_line(owned, tmp_path, text, message):
    shutil.copytree(owned, tmp_path / "world")
    path = tmp_path / "world" / MADE_BY
    path.unlink()
    if text is not None:
        path.write_text(text)
    with pytest.raises(ArtifactError, match=message) as caught:
        read_made_by(tmp_path / "world")
    assert "\n" not in str(caught.value)
    assert MADE_BY in str(caught.value)


def test_an_unknown_claim_is_refused(owned):
    with pytest.raises(ValueError, match="limits"):
        claims_of(owned, limits={})


def test_claims_are_no_part_of_the_world_that_robots_see(owned, tmp_path):
    shutil.copytree(owned, tmp_path / "world")
    (tmp_path / "world" / MADE_BY).unlink()
    assert load_world(tmp_path / "world").record == load_world(owned).record
    assert MADE_BY not in json.loads((owned / RECORD).read_text())["files"]


def test_stage_6_refuses_a_bundle_that_states_other_values_than_the_run(owned):
    with pytest.raises(ArtifactError, match=r"kind = own, validation\.kind is embedded"):
        require_own_claims(owned, claims_of(owned), compose([]).validation)
