"""The sources of the native FMUs under the address and undefined-behaviour sanitizers, with calls that FMI forbids.

See fmi2_stress.c and, for FMI 3.0, fmi3_stress.c.
"""

import os
import subprocess
import sys

import fmi3_fixtures
import pytest
from build_cache import build_user_model
from models import MODELS, STICKSLIP_IN_CI
from native_fmus import build_native_fmus
from native_host import SANITIZER_ENVIRONMENT, SANITIZERS, compile_sanitized

pytestmark = pytest.mark.slow

STATES = 75_000  # damaged ones, over all models
SENTENCE = (
    "a saved state is refused: another FMU wrote it or it has been changed; "
    "save the state again and pass it on unchanged"
)


def program(source, fmu, sanitizers=SANITIZERS):
    """Return a function that runs a program with the sources of an FMU, requires a clean exit, and returns its
    output."""
    out = compile_sanitized(source, fmu, sanitizers=sanitizers)

    def run(*words, **options):
        streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "env": SANITIZER_ENVIRONMENT} | options
        result = subprocess.run([str(out), *map(str, words)], timeout=900, **streams)
        assert result.returncode == 0, f"{result.returncode}: {result.stdout[-300:]} {(result.stderr or b'')[-3000:]}"
        return result.stdout, result.stderr

    return run


@pytest.fixture(scope="module", params=STICKSLIP_IN_CI)
def abuse(request):
    return program("fmi2_stress.c", build_native_fmus() / f"{request.param}.fmu")


@pytest.fixture(scope="module", params=STICKSLIP_IN_CI)
def walk(request):
    return program("fmi3_stress.c", fmi3_fixtures.build_fmi3_fmus() / f"{request.param}.fmu")


@pytest.mark.campaign
def test_a_corrupted_state_is_refused_and_no_instance_changes(abuse):
    output, stderr = abuse("flip_bits")
    assert int(output) > STATES / len(MODELS)
    assert stderr.count(SENTENCE.encode()) >= int(output)


def test_an_impossible_state_is_refused_despite_a_valid_checksum(abuse):
    abuse("forge_states")


def test_random_calls_end_in_a_status_and_leave_other_instances_alone(abuse):
    abuse("random_calls", 1, 20_000)


@pytest.mark.campaign
def test_every_fmi3_function_in_every_state_follows_the_standard_without_leaks(walk):
    """With null pointers and wrong lengths, in every kind of instance; the address sanitizer detects leaks."""
    output, _ = walk("states", 1)
    assert int(output) > 2_500


def test_a_forged_discrete_value_is_refused_in_fmi3(walk):
    walk("forge_states")


def test_random_fmi3_calls_end_in_a_status_and_leave_other_instances_alone(walk):
    walk("random_calls", 1, 20_000)


SLIDER = """
from fmus import Contact, Input, Mode, Model, Output, Parameter, State, Table


class Slider(Model):
    '''Block on a spring, with measured friction.'''

    m = Parameter(1.0, "kg", "mass", above=0)
    k = Parameter(100.0, "N/m", "stiffness of the spring", low=0)
    x0 = Parameter(0.1, "m", "initial position")
    F_ext = Input(0.0, "N", "external force")
    x = State("m", "position", start=x0)
    v = State("m/s", "speed", rate_of=x)
    mode = Mode()
    mu = Table([0.0, 0.1, 1.0], [5.0, 4.0, 4.5], "m/s", "N", values="tunable", low=0.0)
    F_friction = Contact("N", "friction force, opposing the motion", mode=mode, slip=v, slide=mu(abs(v)))
    a = Output("m/s2", "acceleration", (F_ext - k * x - F_friction) / m, rate_of=v)
    energy = Output("J", "energy", 0.5 * m * v * v + 0.5 * k * x * x)
"""


@pytest.fixture(scope="module", params=["slider", "smd", "stickslip"])
def cosimulation(request, tmp_path_factory):
    """The program for a model with values of a table as parameters, and for two shipped ones."""
    if request.param != "slider":
        return program("fmi3_stress.c", fmi3_fixtures.build_fmi3_fmus() / f"{request.param}.fmu")
    path = tmp_path_factory.mktemp("slider") / "slider.py"
    path.write_text(SLIDER)
    fmu = build_user_model(path, "--fmi", "3", "--platform", "linux64") / "native/fmi3/slider.fmu"
    return program("fmi3_stress.c", fmu)


@pytest.mark.parametrize(("seed", "runs"), [(1, 300), pytest.param(2, 10_000, marks=pytest.mark.campaign)])
def test_valid_fmi3_calls_with_any_values_keep_parameters_times_and_finite_values(cosimulation, seed, runs):
    """With early returns and intermediate updates: a value that was set reads back, also in a run that failed; a
    completed step ends with finite values, at or after its start; an intermediate update sets nothing but inputs."""
    steps, _ = cosimulation("valid_calls", seed, runs)
    assert int(steps) > 5 * runs


@pytest.mark.campaign
def test_fmi3_instances_share_nothing_between_threads():
    program("fmi3_stress.c", fmi3_fixtures.build_fmi3_fmus() / "stickslip.fmu", "thread")("states", 4)


NAMES = [
    *(b"", b"100 %s %n", "na\u00efve".encode(), rb"\xff\xfe", rb"cut \xe2\x82", rb"\xed\xa0\x80", rb"\xc0\xaf"),
    *("\U0001f30d".encode(), rb"\xf5\x80\x80\x80", b"%" * 10_000, b""),
]


def test_any_name_is_logged_as_utf8_and_never_as_a_format(abuse):
    """Each name is used twice: for an instance, and for a failed instantiation."""
    output, stderr = abuse("check_names", env=SANITIZER_ENVIRONMENT | {"ALOUD": "1"})
    assert [line.split(b"|")[0] for line in output.splitlines()] == [name for name in NAMES for _ in range(2)]
    assert all(b"(" + name + b"): fmi2" in stderr for name in NAMES)
    output.decode()
    stderr.decode()


@pytest.mark.skipif(sys.platform != "linux", reason="/dev/full is Linux's")
@pytest.mark.parametrize("loss", ["closed", "full", "unread", "by the host", "not writable"])
def test_an_error_survives_the_loss_of_standard_error(abuse, loss):
    """The signal of a pipe without reader would end a host that does not ignore it, such as this one."""
    if loss == "closed":
        abuse("check_failures", preexec_fn=lambda: os.close(2), stderr=None)
    elif loss == "full":
        with open("/dev/full", "w") as full:
            abuse("check_failures", stderr=full)
    elif loss == "not writable":
        with open(os.devnull) as null:
            abuse("check_failures", stderr=null)
    elif loss == "unread":
        reader, writer = os.pipe()
        os.close(reader)
        abuse("check_failures", stderr=writer)
        os.close(writer)
    else:
        abuse("check_failures", "closes")
