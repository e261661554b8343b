"""Result folders are replaced whole or not at all."""

import pytest

from harness.errors import HarnessError
from harness.folder import replacing

OURS = ("a.csv", "b.csv")


def contents(folder):
    return {path.name: path.read_text() for path in folder.iterdir()}


@pytest.fixture
def older(tmp_path):
    """A folder with an older result, the only thing in its parent."""
    folder = tmp_path / "case"
    folder.mkdir()
    (folder / "a.csv").write_text("old")
    return folder


def test_a_new_result_takes_the_place_of_the_old_one(older):
    with replacing(older, OURS) as fresh:
        (fresh / "b.csv").write_text("new")
        assert contents(older) == {"a.csv": "old"}
    assert contents(older) == {"b.csv": "new"}
    assert list(older.parent.iterdir()) == [older]


@pytest.mark.parametrize("reason", [HarnessError("no"), KeyboardInterrupt()])
def test_what_fails_half_way_leaves_the_old_result_and_nothing_else(older, reason):
    def fail():
        with replacing(older, OURS) as fresh:
            (fresh / "b.csv").write_text("half")
            raise reason

    with pytest.raises(type(reason)):
        fail()
    assert contents(older) == {"a.csv": "old"}
    assert list(older.parent.iterdir()) == [older]


def test_a_folder_with_other_files_is_not_replaced(older):
    (older / "notes.txt").write_text("mine")
    with pytest.raises(HarnessError, match=r"holds notes\.txt"), replacing(older, OURS):
        pass
    assert contents(older) == {"a.csv": "old", "notes.txt": "mine"}


def test_a_file_in_the_way_is_told(tmp_path):
    (tmp_path / "results").write_text("a file")
    with pytest.raises(HarnessError, match="cannot write below"), replacing(tmp_path / "results/case", OURS):
        pass
