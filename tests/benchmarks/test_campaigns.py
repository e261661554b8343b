"""The command that runs all campaigns."""

from importlib.util import find_spec

from benchmarks.campaigns import __main__ as campaigns


def test_the_command_prints_which_campaigns_failed_and_keeps_their_outputs(tmp_path, monkeypatch, capfd):
    scripts = {"right": "print('first'); print('all hold')", "wrong": "import sys; print('1 failed'); sys.exit(3)"}
    monkeypatch.setattr(campaigns, "CAMPAIGNS", {name: ("-c", script) for name, script in scripts.items()})
    monkeypatch.chdir(tmp_path)
    assert campaigns.main([]) == 1
    _, *rows = [line.split() for line in capfd.readouterr().out.splitlines()]
    assert [(row[0], row[1], row[4:]) for row in rows] == [
        ("right", "passed", ["all", "hold"]),
        ("wrong", "FAILED", ["1", "failed"]),
    ]
    assert (tmp_path / "results/campaigns/right.txt").read_text() == "first\nall hold\n"
    assert campaigns.main(["right"]) == 0
    assert campaigns.main(["left"]) == 2
    assert capfd.readouterr().err == "Error: there is no campaign 'left'; choose from right, wrong\n"


def test_each_campaign_runs_a_module_that_exists():
    for name, (_, module, *_) in campaigns.CAMPAIGNS.items():
        assert find_spec(module)
        assert module in ("pytest", f"benchmarks.campaigns.{name}")
