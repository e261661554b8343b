"""Result folders are replaced completely or not at all."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest
from build_cache import ROOT

from harness import HarnessError
from harness.results import folder as folders
from harness.results.folder import replace_folder

FILE_NAMES = ("a.csv", "b.csv")


def contents(folder):
    return {path.name: path.read_text() for path in folder.iterdir()}


@pytest.fixture
def older(tmp_path):
    """A folder with an older result, the only entry of its parent."""
    folder = tmp_path / "case"
    folder.mkdir()
    (folder / "a.csv").write_text("old")
    return folder


def test_a_new_result_replaces_the_previous_one(older):
    with replace_folder(older, FILE_NAMES) as fresh:
        (fresh / "b.csv").write_text("new")
        assert contents(older) == {"a.csv": "old"}
    assert contents(older) == {"b.csv": "new"}
    assert list(older.parent.iterdir()) == [older]


@pytest.mark.parametrize("reason", [HarnessError("no"), KeyboardInterrupt()])
def test_a_failure_half_way_keeps_the_previous_result_and_leaves_nothing_else(older, reason):
    def fail():
        with replace_folder(older, FILE_NAMES) as fresh:
            (fresh / "b.csv").write_text("half")
            raise reason

    with pytest.raises(type(reason)):
        fail()
    assert contents(older) == {"a.csv": "old"}
    assert list(older.parent.iterdir()) == [older]


def test_a_failure_leaves_no_folder_created_for_it(older):
    def fail():
        with replace_folder(older.parent / "new/place/case", FILE_NAMES):
            raise HarnessError("no")

    with pytest.raises(HarnessError):
        fail()
    assert list(older.parent.iterdir()) == [older]


def test_a_folder_with_other_files_is_not_replaced(older):
    (older / "notes.txt").write_text("mine")
    with pytest.raises(HarnessError, match=r"holds notes\.txt"), replace_folder(older, FILE_NAMES):
        pass
    assert contents(older) == {"a.csv": "old", "notes.txt": "mine"}


def test_a_file_in_the_way_is_reported(tmp_path):
    (tmp_path / "results").write_text("a file")
    with pytest.raises(HarnessError, match="cannot write below"), replace_folder(tmp_path / "results/case", FILE_NAMES):
        pass


@pytest.fixture(params=["one step", "two steps"])
def steps(request, monkeypatch):
    """A system that exchanges two folders atomically, and one that does not."""
    if request.param == "two steps":
        monkeypatch.setattr(folders, "exchange_folders", lambda first, second: False)
    return request.param


def test_no_exchange_method_leaves_a_folder_behind(older, steps):
    with replace_folder(older, FILE_NAMES) as fresh:
        (fresh / "b.csv").write_text("new")
    assert contents(older) == {"b.csv": "new"}
    assert list(older.parent.iterdir()) == [older]


def test_an_exchange_that_fails_half_way_keeps_the_previous_result(older, monkeypatch):
    monkeypatch.setattr(folders, "exchange_folders", lambda first, second: False)
    rename = Path.rename

    def fail(self, target):
        if self.suffix == folders.FRESH:
            raise OSError(28, "No space left on device")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", fail)
    with (
        pytest.raises(HarnessError, match=r"cannot write .*case: No space left on device"),
        replace_folder(older, FILE_NAMES),
    ):
        pass
    assert contents(older) == {"a.csv": "old"}
    assert list(older.parent.iterdir()) == [older]


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o027])
def test_the_umask_determines_the_permissions_of_a_result(tmp_path, mask):
    before = os.umask(mask)
    try:
        with replace_folder(tmp_path / "results/case", FILE_NAMES) as fresh:
            (fresh / "a.csv").write_text("new")
    finally:
        os.umask(before)
    for path in (tmp_path / "results", tmp_path / "results/case"):
        assert path.stat().st_mode & 0o777 == 0o777 & ~mask
    assert (tmp_path / "results/case/a.csv").stat().st_mode & 0o777 == 0o666 & ~mask


KILL_SCRIPT = """
import os, sys
from pathlib import Path
from harness.results import folder as folders

place, steps, last = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])
calls = 0

def kill(event, arguments):
    global calls
    if event.startswith(("os.", "shutil.", "fcntl.")) or event == "open":
        calls += 1
        if calls == last:
            os.kill(os.getpid(), 9)

if steps == "two":
    folders.exchange_folders = lambda first, second: False
with folders.replace_folder(place, ("a.csv", "b.csv")) as fresh:
    (fresh / "b.csv").write_text("new")
    sys.addaudithook(kill)
"""


@pytest.mark.slow
@pytest.mark.parametrize("steps", ["one", "two"])
def test_a_kill_at_any_moment_keeps_the_previous_or_the_new_result(older, steps):
    """Before every call of the operating system from the end of the writing on; the next run removes leftovers."""
    outcomes, status, last = [], -9, 0
    while status:
        last += 1
        status = subprocess.run([sys.executable, "-c", KILL_SCRIPT, older, steps, str(last)], cwd=ROOT).returncode
        assert status in (0, -9)
        outcomes.append([*contents(older)] if older.exists() else [])
        with pytest.raises(HarnessError, match="the next run"), replace_folder(older, FILE_NAMES):
            raise HarnessError("the next run, which fails")
        assert [*contents(older)] in (["a.csv"], ["b.csv"])
        assert list(older.parent.iterdir()) == [older]
        (older / "b.csv").unlink(missing_ok=True)
        (older / "a.csv").write_text("old")
    assert len(outcomes) > 5
    assert outcomes[0] == ["a.csv"]
    assert outcomes[-1] == ["b.csv"]
    assert {(*files,) for files in outcomes} == {("a.csv",), ("b.csv",)} | ({()} if steps == "two" else set())


def test_leftovers_of_a_killed_run_are_removed_but_no_other_files(older):
    leftovers = [
        older.with_name(name) for name in (".case-abcdefgh.new", ".case-abcdefgi.old", ".case-sign-abcdefgh.new")
    ]
    users_folder = older.with_name(".case-abcdefgk.new")
    for folder in (*leftovers, users_folder):
        folder.mkdir()
    (users_folder / "notes.txt").write_text("mine")
    with replace_folder(older, FILE_NAMES) as other:
        (other / "b.csv").write_text("of a run that goes on")
        with replace_folder(older, FILE_NAMES) as fresh:
            (fresh / "a.csv").write_text("of one that is quicker")
        assert contents(other) == {"b.csv": "of a run that goes on"}
        assert not leftovers[0].exists()
        assert not leftovers[1].exists()
    assert contents(older) == {"b.csv": "of a run that goes on"}
    assert sorted(older.parent.iterdir()) == sorted([older, users_folder, leftovers[2]])


def test_a_new_folder_that_another_command_takes_for_a_leftover_is_created_again(older, monkeypatch):
    """The other command may remove it between its creation and its lock."""
    create, new_folders = folders.create_new_folder, []

    def create_new_folder(folder):
        new_folders.append(create(folder))
        if len(new_folders) == 1:
            new_folders[0].rmdir()
        return new_folders[-1]

    monkeypatch.setattr(folders, "create_new_folder", create_new_folder)
    with replace_folder(older, FILE_NAMES) as fresh:
        (fresh / "b.csv").write_text("new")
    assert len(new_folders) == 2
    assert contents(older) == {"b.csv": "new"}


@pytest.mark.skipif(sys.platform == "win32", reason="locks are those of POSIX")
def test_a_file_system_without_locks_holds_results(older, monkeypatch):
    def refuse(file, operation):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr("fcntl.flock", refuse)
    with replace_folder(older, FILE_NAMES) as fresh:
        (fresh / "b.csv").write_text("new")
    assert contents(older) == {"b.csv": "new"}


def test_an_interrupt_in_another_working_directory_leaves_nothing(older, monkeypatch):
    """fmpy changes the directory while it loads a library."""
    monkeypatch.chdir(older.parent)

    def interrupt():
        with replace_folder(Path("case"), FILE_NAMES):
            os.chdir("/")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupt()
    assert list(older.parent.iterdir()) == [older]


@pytest.mark.parametrize("target", ["elsewhere", "nowhere"])
def test_a_result_folder_that_is_a_link_is_refused_and_kept(tmp_path, target):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "case").symlink_to(tmp_path / target)
    with pytest.raises(HarnessError, match="case is a link"), replace_folder(tmp_path / "case", FILE_NAMES):
        pass
    assert (tmp_path / "case").is_symlink()
    assert list((tmp_path / "elsewhere").iterdir()) == []


def test_a_result_folder_that_is_a_file_is_refused_and_kept(tmp_path):
    (tmp_path / "case").write_text("mine")
    with (
        pytest.raises(HarnessError, match="case holds a file of that name"),
        replace_folder(tmp_path / "case", FILE_NAMES),
    ):
        pass
    assert (tmp_path / "case").read_text() == "mine"


def test_a_full_disk_is_reported_and_the_previous_result_kept(older):
    def fill():
        with replace_folder(older, FILE_NAMES) as fresh:
            (fresh / "b.csv").write_text("half")
            with open("/dev/full", "w") as full:
                full.write("the rest")

    with pytest.raises(HarnessError, match=r"cannot write .*case: No space left on device"):
        fill()
    assert contents(older) == {"a.csv": "old"}
    assert list(older.parent.iterdir()) == [older]
