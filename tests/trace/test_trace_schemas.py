"""The schemas in the repository are those of the code, and records match them."""

import json
import subprocess
import sys
from pathlib import Path

import jsonschema
import msgspec
import pytest

from lingjing import Trace
from lingjing.testing.traces import to_json
from lingjing.trace.schemas import RECORDS, schema_text


@pytest.mark.parametrize("name", RECORDS)
def test_the_folder_holds_the_schemas_of_the_code(name: str) -> None:
    stored = Path(__file__).parents[2].joinpath("schemas", "trace", f"{name}.schema.json").read_text(encoding="utf-8")
    assert stored == schema_text(name), "run `python -m lingjing.trace.schemas`"


def test_the_module_writes_the_schemas(tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-m", "lingjing.trace.schemas", str(tmp_path / "out")], check=True)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {f"{name}.schema.json" for name in RECORDS}


def test_records_match_the_schemas_and_invalid_ones_do_not(trace: Trace) -> None:
    rich = next(record for record in trace.boundaries if record.frames and record.events)
    samples = {"header": trace.header, "boundary": rich, "frame": rich.frames[0], "outcome": trace.outcome}
    for name, record in samples.items():
        schema = json.loads(schema_text(name))
        jsonschema.Draft202012Validator.check_schema(schema)
        document = json.loads(to_json(record))  # type: ignore[arg-type]
        jsonschema.validate(document, schema)
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate({**document, "surprise": 1}, schema)
        required = schema["required"][0]
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate({key: value for key, value in document.items() if key != required}, schema)
        assert msgspec.json.decode(to_json(record), type=RECORDS[name]) == record  # type: ignore[arg-type]
