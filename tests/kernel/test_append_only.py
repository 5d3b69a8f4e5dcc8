"""An append-only mapping behaves as a value, also when several versions are extended."""

from hypothesis import given
from hypothesis import strategies as st

from lingjing.kernel.append_only import AppendOnlyMap

STEPS = st.lists(st.tuples(st.integers(0, 8), st.dictionaries(st.integers(0, 12), st.integers(), max_size=3)))


@given(STEPS)
def test_extending_a_version_leaves_all_other_versions_unchanged(steps):
    versions: list[tuple[AppendOnlyMap, dict]] = [(AppendOnlyMap(), {})]
    for which, fresh in steps:
        ledger, model = versions[which % len(versions)]
        versions.append((ledger.extended(fresh), {**fresh, **model} | model))
    for ledger, model in versions:
        assert dict(ledger) == model
        assert len(ledger) == len(model)
        assert list(ledger.newest()) == list(reversed(list(ledger.values())))
        assert all((key in ledger) == (key in model) for key in range(13))
        assert all(ledger.get(key) == model.get(key) for key in range(13))


def test_entries_come_in_the_order_they_were_made():
    ledger = AppendOnlyMap().extended({"b": 1}).extended({"a": 2, "b": 9})
    assert list(ledger.items()) == [("b", 1), ("a", 2)]
    assert list(ledger.newest()) == [2, 1]
