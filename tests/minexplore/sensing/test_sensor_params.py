"""Parameters of sensors: presets with sources, and refusals in one line."""

import math

import pytest

from minexplore.sensing.params import IDEAL, SensorParams, preset_names, preset_numbers, sensor_params


def test_every_number_of_a_preset_states_a_source():
    assert preset_names() == ["ideal", "typical", "dusty", "wet"]
    for name in preset_names():
        for field, (value, source) in preset_numbers(name).items():
            assert len(source) > 15, (name, field)
            assert getattr(sensor_params(name), field) == value


def test_ideal_is_the_default_and_alone_is_ideal():
    assert sensor_params(None) == sensor_params("ideal") == SensorParams() == IDEAL
    assert [sensor_params(name).is_ideal for name in preset_names()] == [True, False, False, False]


def test_the_typical_numbers_follow_from_the_figures_of_their_sources():
    typical = sensor_params("typical")
    dust_gpm3, soot_gpm3 = 5e-3, 0.16e-3
    assert typical.dust_per_m == pytest.approx(0.6 * dust_gpm3 + 10 * soot_gpm3, rel=0.1)
    assert typical.gyro_noise_radps_rthz == pytest.approx(math.radians(0.014), rel=0.01)
    assert typical.gyro_bias_radps == pytest.approx(math.radians(6.5) / 3600, rel=0.02)
    assert typical.accel_noise_mps2_rthz == pytest.approx((160 + 160 + 190) / 3 * 1e-6 * 9.81, rel=0.01)
    assert typical.accel_bias_mps2 == pytest.approx(20e-3 * 9.81 / 10, rel=0.03)


def test_a_preset_is_changed_field_by_field():
    found = sensor_params({"preset": "dusty", "dust_per_m": 0.5})
    assert found.dust_per_m == 0.5
    assert found.noise == 1.0


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("foggy", r"conditions = 'foggy': valid choices are ideal, typical, dusty, wet"),
        ({"dust_per_m": -1}, r"sensor: dust_per_m = -1: want a number from 0 to 10"),
        ({"preset": "wet", "film_share": 2}, r"sensor: film_share = 2: want a number from 0 to 1"),
        ({"preset": "wet", "rain": 2}, r"SensorParams: no field 'rain'"),
        ({"noise": float("nan")}, r"sensor: noise = nan: want a number from 0 to 100"),
        (7, r"SensorParams: 7: want SensorParams"),
    ],
)
def test_bad_parameters_are_refused_with_name_value_and_limit(value, words):
    with pytest.raises(ValueError, match=words) as error:
        sensor_params(value)
    assert "\n" not in str(error.value)
