"""Native FMUs of oscillators, and a closed form, for the tests of orbits and maps."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import commands
import mpmath
from build_cache import build_user_model
from native_fmus import require_compiler

C, STATIC, DELTA = 0.1, 1.0, 3.0  # of the belt of Leine and others, with a damper


@cache
def native(name):
    """Return the native FMU of a model."""
    require_compiler()
    (file,) = (commands.ROOT / "fmus").glob(f"**/{name}.py")
    return build_user_model(file, "--native", "--platform", "linux64") / "native" / f"{name}.fmu"


def build_text(name, text):
    """Return the native FMU of a model file with a text."""
    require_compiler()
    with TemporaryDirectory() as folder:
        file = Path(folder, f"{name}.py")
        file.write_text(text, encoding="utf-8")
        return build_user_model(file, "--native", "--platform", "linux64") / "native" / f"{name}.fmu"


def edge_of_stick_slip(c, k=1.0, static=1.0, sliding=0.7):
    """Return the belt speed at which a block with constant sliding friction just touches the belt again.

    After it leaves the belt at v = v_belt and k x + c v = static, its next largest speed is v_belt.
    """
    with mpmath.workdps(30):
        c, k, static, sliding = map(mpmath.mpf, (c, k, static, sliding))
        w = mpmath.sqrt(k - c * c / 4)

        def excess(speed):
            x = (static - c * speed - sliding) / k
            a, b = speed, -(k * x + c * speed / 2) / w  # v = exp(-c t/2) (a cos w t + b sin w t)
            angle = mpmath.atan2(b * w - a * c / 2, a * w + b * c / 2)  # where the speed is extreme
            angles = [angle + n * mpmath.pi for n in range(4) if angle + n * mpmath.pi > 0]
            speeds = [mpmath.exp(-c * q / w / 2) * (a * mpmath.cos(q) + b * mpmath.sin(q)) for q in angles]
            return next(v for v in speeds if v > 0) - speed

        return float(mpmath.findroot(excess, (mpmath.mpf("0.05"), mpmath.mpf(3)), solver="anderson", tol=1e-25))
