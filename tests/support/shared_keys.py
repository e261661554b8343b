"""The schema that the results of `decay` and `fit` share."""

KEYS = {
    "records": {"record", "from", "until", "samples", "of", "averaged", "time_unit"},
    "columns": {"record", "name", "unit", "residual", "noise", "range"},
    "fit": {"name", "value", "error", "low", "high", "unit", "text"},
}


def check_shared_keys(result):
    """Check that a result has the shared keys, with items of the same keys."""
    for name, keys in KEYS.items():
        assert result[name]
        assert all(set(item) == keys for item in result[name])
    assert result["record"] == ", ".join(record["record"] for record in result["records"])
    assert all(isinstance(remark, str) for remark in result["remarks"])
