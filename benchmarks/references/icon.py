"""A plain icon for a model that has none: the curve of its certified result."""

from pathlib import Path

from harness.references.certified_reference import load_reference

SIZE = 256  # pixels
INK, RED = "#1b1f24", "#d81f2d"


def draw_missing_icon(name: str, folder: Path) -> Path | None:
    """Draw the first state of the certified result over time, unless the model has an icon; return the new file."""
    from matplotlib.figure import Figure

    path = folder / f"{name}.png"
    if path.exists():
        return None
    reference = load_reference(name, folder)
    figure = Figure((SIZE / 100, SIZE / 100), dpi=100)
    axes = figure.add_axes((0.08, 0.08, 0.84, 0.84))
    axes.plot(reference.times, reference.states[:, 0], color=RED, lw=4.5)
    axes.set(xticks=[], yticks=[])
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set(color=INK, linewidth=4.5)
    figure.savefig(path)
    return path
