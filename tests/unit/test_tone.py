from __future__ import annotations

import numpy as np
import pytest

from landtool.errors import UsageError
from landtool.tone import Tone, decode, encode, encode_with_slope, linear_lut, parse_tone, srgb_decode, srgb_encode

TONES: list[Tone] = ["srgb", "none", 2.2, 0.5]


def test_srgb_has_the_standards_values() -> None:
    # from the definition in IEC 61966-2-1: mid grey, and both sides of the join
    np.testing.assert_allclose(srgb_decode([0.0, 0.04045, 0.5, 1.0]), [0.0, 0.0031308, 0.21404114, 1.0], atol=2e-8)
    np.testing.assert_allclose(srgb_encode([0.0, 0.001, 0.5, 1.0]), [0.0, 0.01292, 0.73535698, 1.0], atol=1e-8)


@pytest.mark.parametrize("tone", TONES)
def test_decoding_undoes_encoding(tone: Tone) -> None:
    light = np.linspace(0.0, 1.0, 1001)
    np.testing.assert_allclose(decode(encode(light, tone), tone), light, atol=1e-7)
    assert (np.diff(encode(light, tone)) > 0.0).all()


def test_float32_stays_float32_and_light_outside_is_clipped() -> None:
    assert srgb_encode(np.zeros((2, 3), np.float32)).dtype == np.float32
    assert srgb_decode(np.zeros((2, 3), np.uint8)).dtype == np.float64
    np.testing.assert_allclose(srgb_encode([-0.5, 1.5]), [0.0, 1.0], atol=1e-12)


@pytest.mark.parametrize("tone", TONES)
def test_the_table_decodes_every_8_bit_value(tone: Tone) -> None:
    table = linear_lut(tone)
    assert table.shape == (256,)
    assert table.dtype == np.float32
    np.testing.assert_array_equal(np.rint(255.0 * encode(table, tone)), np.arange(256))
    if tone == "none":
        np.testing.assert_allclose(table, np.arange(256) / 255.0, atol=1e-7)


@pytest.mark.parametrize("tone", [0.0, -1.0, float("nan"), 11.0])
def test_a_gamma_that_is_no_exponent_is_refused(tone: float) -> None:
    with pytest.raises(UsageError, match="no tone curve"):
        linear_lut(tone)


def test_a_tone_is_read_from_its_name_or_number() -> None:
    assert [parse_tone(text) for text in ("srgb", "none", "2.2")] == ["srgb", "none", 2.2]
    for text in ("sRGB ", "gamma", "nan", "0", ""):
        with pytest.raises(UsageError, match="no tone curve"):
            parse_tone(text)


@pytest.mark.parametrize("tone", TONES)
def test_the_slope_is_that_of_the_curve(tone: Tone) -> None:
    light = np.linspace(0.01, 0.99, 50)
    encoded, slope = encode_with_slope(light, tone)
    np.testing.assert_allclose(encoded, encode(light, tone), atol=1e-7)
    h = 1e-6
    np.testing.assert_allclose(slope, (encode(light + h, tone) - encode(light - h, tone)) / (2.0 * h), rtol=1e-5)
    beyond = encode_with_slope(np.array([1.2]), tone)
    assert (beyond[0][0], beyond[1][0]) == (1.0, 0.0)
