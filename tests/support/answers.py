"""The schema that the answers of `decay` and `fit` share."""

KEYS = {
    "records": {"record", "from", "until", "samples", "of", "averaged", "time_unit"},
    "columns": {"record", "name", "unit", "residual", "noise", "range"},
    "fit": {"name", "value", "error", "low", "high", "unit", "text"},
}


def check_shared_keys(answer):
    """Check that an answer has the shared keys, with items of the same keys."""
    for name, keys in KEYS.items():
        assert answer[name]
        assert all(set(item) == keys for item in answer[name])
    assert answer["record"] == ", ".join(each["record"] for each in answer["records"])
    assert all(isinstance(remark, str) for remark in answer["remarks"])
