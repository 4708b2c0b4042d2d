"""Stage 4, and the part of stage 6 that measures the rock, in memory and from the command line."""

import dataclasses
import json

import numpy as np
import pytest
import shapely

from minexplore.bundle import MODEL, ROOF, WALLS, GeomGroup, smooth_mesh, surface_geom
from pipeline.errors import ArtifactError, GeometryError, InputError, ParamsError
from pipeline.geometry.network.skeleton import trace_network
from pipeline.metrics.rock.profile import line_roughness
from pipeline.metrics.rock.relief import cut_walls
from pipeline.metrics.rock.roughness import SurfaceRoughness
from pipeline.mjcf.bundle import open_bundle
from pipeline.mjcf.loading import load_model
from pipeline.mjcf.visible import visible_triangles
from pipeline.proof.rebuilt.whole_bundle import require_built
from pipeline.proof.surface import drifts_of, level_rock, report_walls
from pipeline.proof.texture import draws_of_places, report_texture, texture_metrics
from pipeline.store.codecs import decode
from pipeline.surface.build import build_rough_surface, lay_rough_lattice, widen_spacing
from pipeline.surface.fit_rock import RockWalls, fit_rock
from pipeline.surface.mesh.lattice import WALL
from pipeline.surface.reference import measure_cloud, measure_sources
from pipeline.surface.relief.spectrum import Roughness, band_edges
from pipeline.surface.relief_source import bounds_of, choose_bands, choose_relief
from pipeline.surface.roughness_report import wall_section
from pipeline.types import DriftNetwork, FreeSpace
from tests.composed import compose
from tests.mines import BuiltMine
from tests.project import ROOT, Project, message_of
from tests.surface.spectra import predicted_rq


@pytest.fixture(scope="module")
def opened(tee: BuiltMine):
    """The T-junction's bundle, read back."""
    return open_bundle(tee.bundle)


def test_no_wave_is_shorter_than_two_spacings_of_the_mesh(config):
    params = config.surface
    wall, roof = choose_bands(params, measure_sources(params))
    for bands, spacing in ((wall, params.rough.spacing_m), (roof, params.rough.roof_spacing_m)):
        shortest = min(band_edges(w)[0] for w in bands.wavelength_m[bands.sd_m > 0])
        assert shortest >= 2 * spacing * 0.999


def test_a_finer_mesh_carries_shorter_waves():
    fine = compose(["surface.rough.spacing_m=0.05", "surface.rough.roof_spacing_m=0.05"]).surface
    wall, _ = choose_bands(fine, measure_sources(fine))
    assert band_edges(float(wall.wavelength_m.min()))[0] == pytest.approx(0.1)


def test_a_drift_that_copies_the_sweeps_has_their_roughness():
    params = compose(["surface.reference=sweeps", "rock=published_score"]).surface
    sources = measure_sources(params)
    noise = choose_bands(params, sources)
    rough = build_rough_surface(params, lay_rough_lattice(params, shapely.box(0, 0, 80, 7), None, 3.5), noise)
    (line,) = wall_section(rough).values()
    measured = dict(zip(sources["sweeps"]["wall"].window_m, sources["sweeps"]["wall"].rq_m, strict=True))
    wall, _ = noise
    for window in (0.5, 1.0):
        rq = float(np.sqrt((line_roughness([line], window) ** 2).mean()))
        assert predicted_rq(wall, Roughness(window, 0.0, line=True)) == pytest.approx(measured[window], rel=0.15)
        assert rq == pytest.approx(measured[window], rel=0.25)


@pytest.mark.slow
def test_jointed_rock_that_copies_the_sweeps_has_their_roughness_within_a_quarter_in_narrow_drifts_too():
    params = compose(["surface.reference=sweeps", "rock=andesite"]).surface
    sources = measure_sources(params)
    ring = shapely.box(0, 0, 70, 50).difference(shapely.box(6, 5, 66, 46))  # drifts of 3 to 6 m in two directions
    lattice = lay_rough_lattice(params, ring, None, 3.5)
    rough = build_rough_surface(params, lattice, choose_relief(params, sources, lattice))
    walls = rough.mesh.vertices[rough.mesh.faces[rough.mesh.piece == WALL]]
    built = cut_walls(walls, ring, 1.0).line_rq_m
    measured = sources["sweeps"]["wall"]
    wanted = {f"at_{100 * window:g}_cm": rq for window, rq in zip(measured.window_m, measured.rq_m, strict=True)}
    assert np.exp(np.mean([abs(np.log(rq / wanted[window])) for window, rq in built.items()])) < 1.25, built


def test_a_fit_finds_the_roughness_of_rock_whose_parts_were_scaled():
    params = compose(["rock=andesite", "surface.rough.spacing_m=0.15"]).surface
    lattice = lay_rough_lattice(params, shapely.box(0, 0, 40, 6), None, 3.5)
    bounds, seed = bounds_of(params.rough), params.rough.seed
    rock = choose_relief(params, {}, lattice)
    windows = np.array([0.5, 1.0, 2.0])
    walls = RockWalls(rock, lattice, bounds, seed)
    for line in (True, False):
        wanted = walls.roughness(np.array([0.7, 0.3, 0.5]), windows, line)
        measured = SurfaceRoughness(line, windows.tolist(), wanted.tolist(), [], None, None, {})
        gains = dataclasses.astuple(fit_rock(rock, measured, lattice, bounds, seed).gains)
        np.testing.assert_allclose(walls.roughness(np.array(gains), windows, line), wanted, rtol=0.05)


def test_a_large_mine_gets_wider_spacings_and_a_huge_one_is_refused(capsys):
    params = compose(["surface.rough.most_faces=100000"]).surface
    drift = shapely.box(0, 0, 120, 6)
    wide = widen_spacing(params, drift, 3.5)
    rough = build_rough_surface(
        wide, lay_rough_lattice(wide, drift, None, 3.5), choose_bands(wide, measure_sources(wide))
    )
    assert len(rough.lattice.faces) == pytest.approx(100_000, rel=0.1)
    assert "720 m2 of workings would need 0.2 million faces" in capsys.readouterr().err
    assert widen_spacing(params, shapely.box(0, 0, 20, 6), 3.5) == params
    with pytest.raises(InputError, match=r"would need .*most_faces is 100000; build a part"):
        widen_spacing(params, shapely.box(0, 0, 5000, 6), 3.5)


def test_walls_and_roof_of_a_scanned_cave_are_measured_and_copied(shared_rock, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "cave.stl").write_bytes(shared_rock.read_bytes())
    (tmp_path / "conf").symlink_to(ROOT / "conf")
    params = compose(
        ["surface.cloud.file=data/cave.stl", "surface.cloud.range_m=[0,100]", "surface.reference=cloud"]
    ).surface
    measured = measure_cloud(params.cloud)
    rq = dict(zip(measured["wall"].window_m, measured["wall"].rq_m, strict=True))
    assert 0.01 < rq[0.5] < 0.05  # 17-18 mm in scanned caves
    assert measured["wall"].spectrum is not None
    wall, roof = choose_bands(params, {"cloud": measured})
    assert predicted_rq(wall, Roughness(0.5, 0.0)) == pytest.approx(rq[0.5], rel=0.25)
    assert 0 < roof.rms_m < 0.2


def test_a_passage_narrower_than_the_spacing_of_the_lattice_is_refused_with_its_place(config):
    thin = shapely.union_all([shapely.box(0, 0, 20, 5), shapely.box(20, 2, 30, 2.03), shapely.box(30, 0, 50, 5)])
    lattice = lay_rough_lattice(config.surface, thin, None, 3.5)
    noise = choose_bands(config.surface, measure_sources(config.surface))
    with pytest.raises(GeometryError, match=r"surface: .* at \((20|30)\.\d, 2\.\d"):
        build_rough_surface(config.surface, lattice, noise)


def test_the_texture_is_whole_where_a_ring_of_a_coarse_mesh_closes(tmp_path):
    coarse = [f"surface.rough.{name}" for name in ("spacing_m=0.5", "roof_spacing_m=0.5", "kept_share=0.06")]
    config = compose([*coarse, "fittings=none", "surface.texture.size_px=64", "realism.preview_width_px=64"])
    mine = BuiltMine(shapely.box(0, 0, 34, 26).difference(shapely.box(6, 6, 28, 20)), config, tmp_path / "w")
    require_built(mine.bundle, open_bundle(mine.bundle).record, config.validation)


def test_the_world_shows_the_rough_surface_hides_the_smooth_one_and_neither_collides(tee):
    model = load_model(tee.bundle / MODEL)
    for geom in range(model.ngeom):
        name = model.geom(geom).name
        if name.startswith(surface_geom("")):
            assert model.geom_contype[geom] == model.geom_conaffinity[geom] == 0
            assert model.geom_group[geom] == (
                GeomGroup.SMOOTH_SURFACE if name.startswith(surface_geom(smooth_mesh(""))) else GeomGroup.ROUGH_SURFACE
            )
            assert model.geom_matid[geom] == model.material("rock").id


def test_a_world_without_walls_to_see_is_refused(tee, config):
    with pytest.raises(ArtifactError, match=r"mine\.xml: no visible walls or no roof"):
        report_texture(level_rock({}, tee.free_space.polygon, tee.network), config.validation.texture)


def test_texture_and_walls_are_measured_on_the_meshes_that_the_model_names(opened, tee, config):
    params = config.validation.texture.model_copy(update={"points_per_m2": 600.0})
    polygon, network = tee.free_space.polygon, tee.network
    report = report_texture(level_rock(opened.visible, polygon, network), params)
    assert report.strict.overall > 0.45  # of the T, whose own width bounds its relief: 0.511; flat walls: 0.00001
    rough = tuple(map(surface_geom, (WALLS, ROOF)))
    half = {
        name: dataclasses.replace(mesh, corners=0.5 * mesh.corners) if name.startswith(rough) else mesh
        for name, mesh in opened.visible.items()
    }
    fewer = params.model_copy(update={"points_per_m2": 300.0})
    shrunk = report_texture(level_rock(half, polygon, network), fewer)
    assert shrunk.strict_axes["bump_rq_m"] != pytest.approx(report.strict_axes["bump_rq_m"], rel=0.05)
    assert report.draws == 1  # the workings are shorter than two sets of eight stretches
    assert report.strict_spread is None
    metrics = texture_metrics(report)
    assert metrics["spread"] == {"published": None, "strict": None}
    assert metrics["strict"]["overall"] == pytest.approx(report.strict.overall, abs=1e-4)
    walls = report_walls(opened.visible, polygon, network, 0.5, 0)
    assert walls.at_foot.gap_median_m > 2 * walls.at_height.gap_median_m  # blocks lean out of the wall's foot
    gaps = walls.at_height
    assert 0.03 < gaps.gap_median_m < 0.15
    assert gaps.gap_max_m < 0.6
    assert gaps.narrowest_kept >= 0.93


def test_the_models_triangles_are_the_files_triangles(opened, tee):
    roof = visible_triangles(opened.visible, ROOF)
    files = sorted((tee.bundle / "meshes").glob(f"{ROOF}_*.msh"))
    written = np.concatenate([(m := decode(f, None)).vertices[m.faces] for f in files])
    assert len(roof) == len(written)
    assert np.abs(np.sort(roof.mean(axis=1), axis=0) - np.sort(written.mean(axis=1), axis=0)).max() < 1e-3


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("surface.reference=cloud", "surface.reference=cloud needs surface.cloud.file"),
        ("surface.cloud.file=/etc/passwd", "not below data/"),
        ("surface.cloud.units=inch", "'m', 'mm' or 'ft'"),
        ("surface.rough.bounds.wide_half_width_m=0.5", "narrow_half_width_m must be below"),
        ("surface.published.wall_sd_m=[0.1,0.1]", "differ in length"),
    ],
)
def test_bad_surface_parameters_are_refused_by_name(monkeypatch, override, message):
    monkeypatch.chdir(ROOT)
    with pytest.raises(ParamsError) as refused:
        compose([override])
    assert message in str(refused.value)


def test_a_sweep_that_is_not_registered_is_refused_by_name(traced_project: Project):
    message = message_of(traced_project.stage("surface", "surface.sweeps.files={a: data/raw/none.csv}"))
    assert "data/raw/none.csv" in message


def test_a_bad_sweep_measurement_is_refused_and_named(traced_project: Project, tmp_path):
    project = traced_project.copy(tmp_path / "copy")
    path = project.folder / "data" / "chilean_mine" / "bad.json"
    path.write_text(json.dumps({"line": True}))
    project.stage("compile3d").check_returncode()
    project.module("pipeline", "register", "data/chilean_mine/bad.json").check_returncode()
    message = message_of(project.stage("surface", "surface.sweeps.measured=data/chilean_mine/bad.json"))
    assert "data/chilean_mine/bad.json: not the roughness of sweeps" in message


def test_the_bundle_holds_the_free_space_and_the_drift_network(tee):
    assert decode(tee.bundle / "free_space.geojson", FreeSpace).polygon.equals(tee.free_space.polygon)
    assert decode(tee.bundle / "topology.json", DriftNetwork).loops == tee.network.loops


def test_the_sets_of_stretches_take_turns_along_the_drifts_and_do_not_share_a_place(config):
    long, short = (
        drifts_of(plan, trace_network(plan, 0.5, 2.0, 1.0))
        for plan in (shapely.box(0, 0, 700, 5), shapely.box(0, 0, 180, 4.6))
    )
    params = config.validation.texture
    draws = draws_of_places(long, params)
    assert [len(draw) for draw in draws] == [params.stretches] * params.draws
    easting = np.array(draws)[:, :, 0]
    assert (np.ptp(easting, axis=1) > 500).all()  # each set reaches over the mine
    gaps = np.diff(np.sort(easting.ravel()))
    assert gaps.min() > 2 * params.stretch_radius_m
    assert len(draws_of_places(short, params)) == 1
