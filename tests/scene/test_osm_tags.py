"""Lengths, storeys and inhabitants in the notations of real maps."""

import pytest

from lingjing.scene.osm.tags import metres, people, storeys


@pytest.mark.parametrize(
    ("text", "length_m"),
    [
        ("12", 12.0), ("12.5 m", 12.5), ("12,5m", 12.5), ("+30", 30.0), ("30 m", 30.0), ("30m.", 30.0),
        ("30 Meter", 30.0), ("30米", 30.0), ("３０米", 30.0), ("约30米", 30.0), ("12 м", 12.0), ("250 cm", 2.5),
        ("~9", 9.0), ("ca. 9 m", 9.0), (">9", 9.0), ("9+", 9.0), (".5", 0.5),
        ("5;6", 5.0), ("3-5", 4.0), ("3–5 m", 4.0), ("3 m - 5 m", 4.0), ("3~5", 4.0), ("0", 0.0), ("-3", -3.0),
        ("40 ft", 12.192), ("40'", 12.192), ("40’", 12.192), ("1,250 ft", 381.0), ("6'2\"", 1.8796),
        ("6′2″", 1.8796), ("6 ft 2 in", 1.8796), ("6'-2\"", 1.8796), ("6'2", 1.8796), ("74\"", 1.8796),
        ("5-7 ft", 1.8288), ("12 m (39 ft)", 12.0), ("40 ft (12 m)", 12.192), ("12 m / 40 ft", 12.0), ("12 ± 1", 12.0),
        ("12?", 12.0), ("12 (roof)", 12.0),
    ],
)  # fmt: skip
def test_lengths_are_read_in_every_spelling(text: str, length_m: float) -> None:
    assert metres({"height": text}, "height") == pytest.approx(length_m)


@pytest.mark.parametrize(
    "text", ["high", "", "1e3", "12 12", "12/15", "(12)", "inf", "nan", "m", "'", "9" * 400, "1" * 2_000_000]
)
def test_other_texts_are_no_length(text: str) -> None:
    assert metres({"height": text}, "height") is None


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("5", 5.0), ("5.5", 5.5), ("5,5", 5.5), ("1½", 1.5), ("+4", 4.0), ("~6", 6.0), ("6+", 6.0), ("0", 0.0),
        ("3-5", 4.0), ("3 to 5", 4.0), ("5;6", 5.0), ("5F", 5.0), ("5层", 5.0), ("５層", 5.0), ("5 floors", 5.0),
        ("2-storey", 2.0), ("G+4", 5.0), ("B1+G+4", 5.0), ("R+3", 4.0), ("4+1", 4.0), ("3+D", 3.0),
        ("0;1;2", 3.0), ("0-4", 5.0), ("-1-3", 4.0), ("1;2;3", 3.0), ("5?", 5.0), ("5 (3)", 5.0),
        ("地上3层", 3.0), ("地上3階地下1階", 3.0),
    ],
)  # fmt: skip
def test_storeys_are_read_in_every_spelling(text: str, count: float) -> None:
    assert storeys({"building:levels": text}, "building:levels") == pytest.approx(count)


@pytest.mark.parametrize("text", ["", "yes", "ground", "-1", "201", "9" * 400, "1;x" * 700_000])
def test_other_texts_are_no_number_of_storeys(text: str) -> None:
    assert storeys({"building:levels": text}, "building:levels") is None


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("12500", 12_500.0), ("12 500", 12_500.0), ("12,500", 12_500.0), ("12.500", 12_500.0), ("~12500", 12_500.0),
        ("12500 (2019)", 12_500.0), ("12.5万", 125_000.0), ("25k", 25_000.0), ("12.5K", 12_500.0),
        ("1.2 million", 1_200_000.0), ("1,234,567", 1_234_567.0),
        ("", None), ("many", None), ("0", None), ("-5", None), ("999999999999", None), ("12.5", None),
    ],
)  # fmt: skip
def test_populations_are_read_in_every_spelling_or_unknown(text: str, count: float | None) -> None:
    assert people({"population": text}) == (None if count is None else pytest.approx(count))
