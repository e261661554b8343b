"""Figures: valid SVG files of limited size."""

from xml.etree.ElementTree import fromstring

import numpy as np

from harness.results.style import open_figure


def figure_text(path, **style):
    """Return the text of a figure of 200 000 points, in a path whose name contains characters that XML forbids."""
    t = np.linspace(0.0, 1.0, 200_000)
    with open_figure(path, 5.0, 3.0) as figure:
        axes = figure.subplots()
        axes.plot(t, np.sin(900 * t) * np.exp(-t), **style)
        axes.set_title("a<b & \x00\x1b\udcff\ufffe $x_")
    return path.read_text(encoding="utf-8")


def test_any_name_gives_valid_xml_with_readable_text(tmp_path):
    root = fromstring(figure_text(tmp_path / "a.svg"))
    assert "a<b & \ufffd\ufffd\ufffd\ufffd $x_" in [item.text for item in root.iter("{http://www.w3.org/2000/svg}text")]


def test_very_many_points_make_a_file_of_hundreds_of_kilobytes_at_most(tmp_path):
    """As a line and as markers; the same drawing gives the same file."""
    line, marks = figure_text(tmp_path / "a.svg"), figure_text(tmp_path / "b.svg", marker=".", linestyle="")
    assert max(len(line), len(marks)) < 400_000
    assert figure_text(tmp_path / "c.svg") == line


def test_a_name_longer_than_its_panel_is_wrapped(tmp_path):
    """As in Modelica: a name without blanks that differs from others only at its end."""
    name = "mechanics.axis1.bearing.friction.plate[12].frame_a.angular_acceleration_of_the_inner_ring.relative.x[{}]"
    with open_figure(tmp_path / "a.svg", 5.0, 6.0) as figure:
        heading = figure.suptitle(f"{name}\nshort")
        panels = figure.subplots(3)
        for i, axes in enumerate(panels):
            axes.set_ylabel(name.format(i))
            axes.set_title(f"panel {i}" if i else name.format(i))
    assert heading.get_text().endswith("\nshort")
    assert heading.get_window_extent().width <= figure.bbox.width
    for i, axes in enumerate(panels):
        label, extent = axes.yaxis.label, axes.get_window_extent()
        assert label.get_text().replace("\n", "") == name.format(i)
        assert label.get_window_extent().height <= 1.05 * extent.height
    assert panels[0].get_title(loc="left").count("\n") == 1
    assert panels[1].get_title(loc="left") == "panel 1"
