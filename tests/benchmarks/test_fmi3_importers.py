"""The FMI 3.0 FMUs in Ecos; the other tools of test_importers.py do not support FMI 3.0."""

from dataclasses import replace

import fmi3_fixtures
import pytest
from models import MODELS

from benchmarks.importers.checks import IMPORTERS, describe_fmu, prepare, run_request, unavailable_reason

pytestmark = pytest.mark.slow

ECOS = next(importer for importer in IMPORTERS if importer.name == "Ecos")


@pytest.mark.skipif(bool(unavailable_reason(ECOS)), reason=unavailable_reason(ECOS))
@pytest.mark.parametrize("name", MODELS)
def test_ecos_runs_fmi3_co_simulation_like_fmi2(name, fmus):
    """Value references and grid are the same; only the stop time, which Ecos does not pass on, may shift an internal
    step."""
    older = describe_fmu(fmus / f"{name}.fmu").base_request
    newer = replace(older, run=replace(older.run, fmu=fmi3_fixtures.build_fmi3_fmus() / f"{name}.fmu"))
    prepare(ECOS, [older, newer])
    actual, expected = run_request(ECOS, newer).reply, run_request(ECOS, older).reply
    assert len(actual.rows) == len(expected.rows) > 100
    for row, expected_row in zip(actual.rows, expected.rows, strict=True):
        assert row == pytest.approx(expected_row, rel=1e-6, abs=1e-7)
