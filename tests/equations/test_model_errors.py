"""Mistakes in a model file are reported at build time in one sentence with the line number."""

import inspect
import re

import pytest
from commands import build
from models import scalar_class

import fmus
from fmus.compiler import BuildError
from fmus.compiler.model_lookup import find_model

HEAD = '''"""A model."""
from fmus import *

class Mine(Model):
    """A mass on a spring.

        m a = F - k x - c v
    """
    m = Parameter(1.0, "kg", "mass", above=0.0)
    k = Parameter(100.0, "N/m", "stiffness", low=0.0)
    f = Parameter(1.0, "N", "friction", low=0.0)
    u = Parameter(1.0, "m/s", "speed of a belt")
    F = Input(0.0, "N", "force")
    x = State("m", "position")
    v = State("m/s", "speed", rate_of=x)
'''
RATE = '    a = Output("m/s2", "acceleration", (F - k * x) / m, rate_of=v)\n'
USE = '    power = Output("W", "power of the belt", f * u)\n'  # uses what the equation of motion does not
DRY = '    mode = Mode()\n    R = Contact("N", "friction", mode=mode, slip=v, slide=f)\n'
PLANAR = '    mode = Mode()\n    R = PlanarContact("N", "friction", mode=mode, slip=(v, u), slide=f)\n'
RATE_WITH_FRICTION = '    a = Output("m/s2", "acceleration", (F - k * x - R) / m, rate_of=v)\n'

RESERVED_NAMES = ("solver", "rates", "double", "t", "NULL", "INT64_MAX", "M_E", "fmi2True", "sqrt", "stop_time", "time")

# The text after the head (15 lines), the reported line, and the message.
WRONG = {
    "no rate": ("", 15, "v has no derivative: declare an Output or a State with rate_of=v"),
    "two rates": (RATE + RATE.replace("a =", "b ="), 17, "b and a both declare rate_of=v"),
    "two equations": (RATE + RATE, 17, "a is assigned twice: give the second equation another name"),
    "an equation with the name of a component": (
        PLANAR + '    R_x = Output("N", "pull", k * x)\n' + RATE,
        18,
        "the name R_x is reserved for R.x: choose another name",
    ),
    "a component with the name of an equation": (
        '    R_x = Output("N", "pull", k * x)\n' + PLANAR + RATE,
        18,
        "the name R_x is reserved for R.x: choose another name",
    ),
    "an unknown name": (RATE.replace("F -", "G -"), 16, "G is not defined: declare it before this line"),
    "no Python": (RATE.replace("F -", "F - -) "), 16, "invalid Python: "),
    "units": (
        RATE.replace("k * x", "k * v"),
        16,
        "F - k * v mixes units: kg m/s^2 and kg m/s^3",
    ),
    "another unit": (
        RATE + '    E = Output("J", "energy", k * x)\n',
        17,
        "E is declared in J, but k * x is in kg m/s^2",
    ),
    "no rate by its unit": (
        RATE.replace("m/s2", "m").replace("(F - k * x) / m", "x"),
        16,
        "a in m cannot be the rate of v in m/s",
    ),
    "an unknown unit": (RATE.replace("m/s2", "furlong/s2"), 16, "a has the unit 'furlong/s2'; allowed units are"),
    "a function of metres": (
        RATE + '    s = Output("1", "sine", sin(x))\n',
        17,
        "the argument of sin(x) must be dimensionless, got m",
    ),
    "an if": (
        RATE + "    if x > 0.0:\n        pass\n",
        17,
        "an expression has no value at build time, as if, and, or,",
    ),
    "a loop": (RATE + "    for y in x:\n        pass\n", 17, "x is a scalar: it cannot be iterated over"),
    "a table": (
        RATE + "    table = [1.0, 2.0]\n    y = table[x]\n",
        18,
        "x has no value at build time and cannot index a list: declare name = Table(x, y, unit_x, unit_y)",
    ),
    "a power": (RATE + "    y = x ** 2\n", 17, "** is not supported"),
    "math.sin": (
        RATE + "    import math\n    y = math.sin(x)\n",
        18,
        "x has no value at build time, so functions of math and numpy do not take it: import functions from fmus",
    ),
    "a text": (RATE + '    y = x + "1"\n', 17, "'1' is neither a number nor an expression"),
    "infinity": (RATE + '    y = x + float("inf")\n', 17, "inf is not a finite number"),
    "a start that moves": (
        RATE + '    z = State("m", "more", start=x, rate=u)\n',
        17,
        "start of z varies with time: it must depend on parameters only",
    ),
    "a law without friction": (DRY + RATE, 17, "R does not act on its own slip, so it can never stick"),
    "a squared force": (
        DRY + RATE_WITH_FRICTION.replace("- R)", "- R * R / f)"),
        17,
        "R must enter the rate of the slip of R linearly",
    ),
    "a force in a function": (
        DRY + RATE_WITH_FRICTION.replace("- R)", "- f * sin(R / f))"),
        17,
        "R must enter the rate of the slip of R linearly",
    ),
    "a mode of nobody": (
        RATE + "    mode = Mode()\n",
        17,
        "mode is the mode of 0 contacts: each Mode needs exactly one Contact",
    ),
    "a law instead of the hybrid one": (
        DRY.replace("slide=f", "slide=f, laws=(SIGN,)") + RATE_WITH_FRICTION,
        17,
        "laws must be (HYBRID,), (HYBRID, SIGN) or (HYBRID, THRESHOLD), got ('sign',)",
    ),
    "the hybrid law after another one": (
        DRY.replace("slide=f", "slide=f, laws=(SIGN, HYBRID)") + RATE_WITH_FRICTION,
        17,
        "laws must be (HYBRID,), (HYBRID, SIGN) or (HYBRID, THRESHOLD), got ('sign', 'hybrid')",
    ),
    "three laws": (
        DRY.replace("slide=f", "slide=f, laws=(HYBRID, SIGN, THRESHOLD), eps=f") + RATE_WITH_FRICTION,
        17,
        "laws must be (HYBRID,), (HYBRID, SIGN) or (HYBRID, THRESHOLD), got ('hybrid', 'sign', 'threshold')",
    ),
    "a threshold without eps": (
        DRY.replace("slide=f", "slide=f, laws=(HYBRID, THRESHOLD)") + RATE_WITH_FRICTION,
        17,
        "eps is required with the law THRESHOLD and not allowed without it",
    ),
    "a slide of another unit": (
        DRY.replace("slide=f", "slide=k") + RATE_WITH_FRICTION,
        17,
        "R is declared in N, but slide k is in kg/s^2",
    ),
    "a threshold of another unit": (
        DRY.replace("slide=f", "slide=f, laws=(HYBRID, THRESHOLD), eps=f") + RATE_WITH_FRICTION,
        17,
        "the slip of R is in m/s, but eps f is in kg m/s^2",
    ),
    "a rule that moves": (RATE + '    rules = Rule(x > 1.0, "far")\n', 17, "a Rule must depend on parameters only"),
    "a rule with another name": (
        RATE + '    rules = Rule(k > 1.0, "{stiff!r} is much")\n',
        17,
        "the sentence of a Rule refers to 'stiff', which is not a parameter",
    ),
    "an unknown method": (
        RATE + '    method = "euler"\n',
        4,
        "method = 'euler' is unknown; available methods: exact, ode23",
    ),
    "a method that does not fit": (
        RATE.replace("k * x", "k * x * x / (x + x)") + '    method = "exact"\n',
        4,
        "method = 'exact' needs a linear equation of motion, which Mine does not have",
    ),
    "a start out of range": (
        RATE + '    q = Parameter(0.0, "kg", "charge", above=0.0)\n',
        17,
        "q has the start value 0.0; it must be above 0.0 kg",
    ),
    "a unit for a number": (
        RATE + '    q = Parameter("kg", 1.0, "charge")\n',
        17,
        "unit of a declaration must be a string, got 1.0: write Parameter(start, unit, text, low=",
    ),
    "a text for a number": (
        RATE + '    q = Parameter("1.0", "kg", "q")\n',
        17,
        "start of q must be a number, got '1.0'",
    ),
    "a variable without a name": (
        RATE.replace("F - k * x", 'Output("N", "force", Parameter(1.0, "N", "pull") - k * x)'),
        16,
        "a uses a variable without a name: assign the variable to a name in the class first",
    ),
    "an option that does not exist": (
        RATE.replace("rate_of=v", "rate_of=v, hi=1.0"),
        16,
        "Output has no argument hi, the nearest is high: write Output(unit, text, expression, rate_of=",
    ),
    "no time": (RATE + "    stop_time = 0.0\n", 4, "stop_time = 0.0 is invalid: it must be a number above 0"),
    "a broken rule": (
        RATE + '    rules = Rule(k + k > k, "k = {k!r} is too much")\n',
        17,
        "the start values are invalid: k = 100.0 is too much",
    ),
    "a division by zero": (
        RATE + '    q = Output("m", "shift", x * f / (f - f))\n',
        17,
        "x * f / (f - f) cannot be calculated at the start values, where f - f is 0.0",
    ),
    "a parameter of zero that divides": (
        '    J = Parameter(0.0, "kg", "another mass")\n' + RATE.replace("/ m", "/ J"),
        17,
        "(F - k * x) / J cannot be calculated at the start values, where J is 0.0",
    ),
    "a root of a negative number": (
        RATE + '    d = Output("m", "distance", sqrt(x * x - 1.0 * u * u * (m / k)))\n',
        17,
        "sqrt(x * x - 1 * u * u * m / k) cannot be calculated at the start values, where x * x - 1 * u * u * m / k "
        "is -0.01",
    ),
    "a start value without a value": (
        RATE + '    d = Fixed(0.0, "m", "length")\n    z = State("1", "strain", start=d / d, rate=u / (d + d))\n',
        18,
        "d / d cannot be calculated at the start values, where d is 0.0",
    ),
    "a squared force in another rate": (
        DRY + RATE_WITH_FRICTION + '    w = State("m/s", "another speed")\n'
        '    b = Output("m/s2", "acceleration", R * R / (f * m), rate_of=w)\n',
        20,
        "R must enter b linearly",
    ),
    "a force that drives": (
        DRY + RATE_WITH_FRICTION.replace("- R)", "+ R)"),
        17,
        "R accelerates its own slip instead of opposing it: change its sign in the rates",
    ),
    "two contacts that hold the same": (
        DRY + '    other = Mode()\n    S = Contact("N", "friction", mode=other, slip=v - u, slide=f)\n'
        "    a = Output('m/s2', 'acceleration', (F - k * x - R - S) / m, rate_of=v)\n",
        19,
        "S and R hold the same motion at rest, so their forces are not determined: put a spring between them",
    ),
    "two contacts with one slip": (
        DRY + '    other = Mode()\n    S = Contact("N", "friction", mode=other, slip=v, slide=f)\n'
        "    a = Output('m/s2', 'acceleration', (F - k * x - R - S) / m, rate_of=v)\n",
        19,
        "S and R hold the same motion at rest, so their forces are not determined: write one contact with the sum of",
    ),
    "contacts in a loop": (
        DRY + '    w = State("m/s", "second speed")\n    z = State("m/s", "third speed")\n'
        "    two, three, four = Mode(), Mode(), Mode()\n"
        '    S = Contact("N", "friction", mode=two, slip=w - v, slide=f)\n'
        '    U = Contact("N", "friction", mode=three, slip=z - w, slide=f)\n'
        '    T = Contact("N", "friction", mode=four, slip=v - z, slide=f)\n'
        "    a = Output('m/s2', 'acceleration', (S - T - R) / m, rate_of=v)\n"
        "    b = Output('m/s2', 'acceleration', (U - S) / m, rate_of=w)\n"
        "    c = Output('m/s2', 'acceleration', (T - U) / m, rate_of=z)\n",
        23,
        "T and R and S and U hold the same motion at rest, so their forces are not determined: put a spring",
    ),
    "a slip that is not linear": (
        DRY.replace("slip=v", "slip=v * fabs(v)") + RATE_WITH_FRICTION,
        17,
        "slip of R must be linear in the speeds on which it acts",
    ),
    "contacts of several laws": (
        DRY + '    other = Mode()\n    w = State("m/s", "another speed")\n'
        '    S = Contact("N", "friction", mode=other, slip=w, slide=f, laws=(HYBRID, SIGN))\n'
        + RATE_WITH_FRICTION
        + "    b = Output('m/s2', 'acceleration', -S / m, rate_of=w)\n",
        20,
        "S and R have different laws: give all contacts the same laws",
    ),
    "a driver whose speed moves": (
        RATE + '    p = State("m", "one", rate=u)\n    q = State("m", "another", rate=v)\n',
        18,
        "rate of q varies with time: it must depend on parameters only",
    ),
    "a driver in another unit": (
        RATE + '    p = State("m", "one", rate=u)\n    q = State("m", "another", rate=u * u)\n',
        18,
        "q is declared in m, but its rate u * u is in m^2/s^2",
    ),
    "a rate of a text": (
        RATE.replace("rate_of=v", 'rate_of="v"'),
        16,
        "rate_of of a is 'v', which is not a state of the model",
    ),
    "a number out of range": (
        RATE + '    q = Parameter(10**400, "kg", "q")\n',
        17,
        "start of q must be a number, got ",
    ),
    "no rules": (RATE + "    rules = None\n", 4, "rules must be a Rule or a tuple of Rules"),
    "a rule without words": (
        RATE + "    rules = Rule(k > k + k, 3)\n",
        17,
        "the sentence of a Rule: 3 must be printable text on one line",
    ),
    "words that no page can show": (
        RATE + '    q = Parameter(1.0, "kg", "mass\\x00")\n',
        17,
        "q: 'mass\\x00' must be printable text on one line",
    ),
    "a choice of nothing": (RATE + '    q = Choice("kind")\n', 17, "a Choice needs at least one item"),
    "an exit": (RATE + "    raise SystemExit(3)\n", 17, "SystemExit: 3"),
    "an error of two lines": (RATE + '    raise ValueError("no\\nway")\n', 17, "ValueError: no way"),
    "an equality": (RATE + "    q = 1.0 if k == 0.0 else 2.0\n", 17, "== and != cannot compare expressions"),
    "an equality of two": (
        RATE + "    q = 1.0 if x != v else 2.0\n",
        17,
        "== and != cannot compare expressions",
    ),
    "friction that drives": (
        DRY.replace("slide=f", "slide=-f") + RATE_WITH_FRICTION,
        17,
        "slide or hold of R is negative at the start values",
    ),
    "friction that grows with the slip, not its size": (
        DRY.replace("slide=f", "slide=f + f * v / u") + RATE_WITH_FRICTION,
        17,
        "slide of R is 2 N at a slip of 1, but 0 N at -1: write the size of the slip by fabs()",
    ),
    "friction that grows with the slip on a belt": (
        DRY.replace("slip=v, slide=f", "slip=v - u, slide=f * (3.0 + (v - u) / u), lifts_off=True")
        + RATE_WITH_FRICTION,
        17,
        "slide of R is 4 N at a slip of 1, but 2 N at -1: write the size of the slip by fabs()",
    ),
    "friction that decays with the slip, not its size": (
        DRY.replace("slide=f", "slide=f * (1.0 + exp(-v / u))") + RATE_WITH_FRICTION,
        17,
        "slide of R is 1.36788 N at a slip of 1, but 3.71828 N at -1: write the size of the slip by fabs()",
    ),
    "other friction backward without a holding force": (
        DRY.replace("slide=f", "slide=choose(v > 0.0, f, 2.0 * f)") + RATE_WITH_FRICTION,
        17,
        "slide of R is 1 N for small positive slips, but 2 N for negative ones: pass as slide the mean of",
    ),
    "a huge unit": (RATE + '    q = Parameter(1.0, "m999", "q")\n', 17, "q has the unit 'm999'; allowed units are"),
    "a method": (RATE + "    def rates(self):\n        pass\n", 17, "nothing calls the function rates"),
    "a constructor": (RATE + "    def __init__(self):\n        pass\n", 17, "nothing calls the function __init__"),
    "a property": (
        RATE + "    @property\n    def energy(self):\n        return 1.0\n",
        18,
        "nothing calls the function energy",
    ),
    "a misspelt stop time": (RATE + "    stoptime = 8.0\n", 17, "nothing uses stoptime: write stop_time, or remove it"),
    "a misspelt method": (RATE + '    metod = "rodas"\n', 17, "nothing uses metod: write method, or remove it"),
    "a number that nothing reads": (
        RATE + "    g = 9.81\n",
        17,
        "nothing uses g = 9.81: declare it as Parameter and use it in an equation, or remove it",
    ),
    "a list that nothing reads": (RATE + "    masses = [1.0, 2.0]\n", 17, "nothing uses masses: declare it"),
    "a field of a dataclass": (RATE + "    g: float = 9.81\n", 17, "nothing uses g = 9.81: declare it"),
    "a type alone": (RATE + "    g: float\n", 17, "g has a type but no value: declare it"),
    "a rule under another name": (
        RATE + '    limit = Rule(k > k + k, "too much")\n',
        17,
        "nothing uses the rule limit: write rules = Rule(...), or a tuple of rules",
    ),
    "a rule without a name": (
        RATE + '    for n in range(2):\n        Rule(k > n * k, "too much")\n',
        18,
        "this Rule belongs to no name, so the model does not have it: write rules = Rule(...)",
    ),
    "rules twice": (
        RATE + '    rules = Rule(k > k + k, "one")\n    rules = Rule(k > k + k, "two")\n',
        18,
        "rules is assigned twice",
    ),
    "a base that is a model": (
        RATE + "class More(Mine):\n    pass\n",
        17,
        "More derives from Mine, but a model can only derive from Model",
    ),
    "a later declaration": (
        RATE.replace("k * x", "k * y") + '    y = State("m", "late", rate=u)\n',
        16,
        "y is used before its declaration in line 17",
    ),
    "its own rate": (RATE.replace("rate_of=v", "rate_of=a"), 16, "a is used in its own declaration"),
    "a misspelt name": (RATE.replace("k * x", "stif * x").replace("    a", "    stiff = k\n    a"), 17, "stif is not"),
    "a missing import": (RATE.replace("F - ", "F - gamma(x) -"), 16, "gamma is not defined: declare it before this"),
    "the time in an equation": (RATE.replace("F -", "F * sin(t) -"), 16, "t is not defined: for the time, declare a"),
    "self": (RATE.replace("k * x", "self.k * x"), 16, "self is not defined: write the names of the variables without"),
    "the sign of a speed": (RATE.replace("F -", "F * sign(v) -"), 16, "sign is not defined: declare dry friction as"),
    "a function of numpy": (
        RATE + "    import numpy as np\n    y = np.sin(x)\n",
        18,
        "an expression has no value at build time, so functions of math and numpy do not take it",
    ),
    "a square": (
        RATE + "    y = v**2\n",
        17,
        "** is not supported, because its rounding differs between platforms: write v * v",
    ),
    "a root": (
        RATE + "    y = x**0.5\n",
        17,
        "** is not supported, because its rounding differs between platforms: write sqrt(x)",
    ),
    "a fourth power": (
        RATE + "    y = x**4\n",
        17,
        "** is not supported, because its rounding differs between platforms: write x * x * x * x",
    ),
    "a negative power": (
        RATE + "    y = x**-2\n",
        17,
        "** is not supported, because its rounding differs between platforms: write 1.0 / (x * x)",
    ),
    "a comma at the end": (
        RATE + '    E = Output("N", "pull", k * x),\n',
        17,
        "E is a tuple, because its line ends with a comma: remove the comma",
    ),
    "an integer part": (RATE + "    y = int(x)\n", 17, "x has no value at build time, so functions of math and numpy"),
    "a count of bodies": (
        '    n = Parameter(3, "1", "number of bodies")\n' + RATE + "    for i in range(n):\n        pass\n",
        18,
        "n has no value at build time and cannot index a list: declare name = Table(x, y, unit_x, unit_y) and write "
        "name(n); a count, as in range(n), must be a number such as n = 3",
    ),
    "a maximum": (
        RATE + "    y = max(x, 0.0)\n",
        17,
        "an expression has no value at build time, as if, and, or, not, max",
    ),
    "a chained comparison": (RATE + "    y = choose(0.0 < x < k, x, 0.0)\n", 17, "an expression has no value at build"),
    "two conditions": (
        RATE + "    y = choose((x > 0.0) & (v > 0.0), x, 0.0)\n",
        17,
        "&, |, ^ and ~ are not supported: nest choose(condition, this, that)",
    ),
    "a remainder": (RATE + "    y = x % 2.0\n", 17, "%, // and @ are not supported"),
    "a comparison as a number": (
        RATE + '    y = Output("N", "pull", (x > 0.0) * F)\n',
        17,
        "a comparison is no number: it can only be the first argument of choose() or of a Rule",
    ),
    "the number of a choice": (
        RATE + '    q = Choice("kind", a="x", b="y")\n    y = Output("N", "pull", q * F)\n',
        18,
        "y calculates with the Choice q: write q.choose(a=..., b=...)",
    ),
    "an argument of another program": (
        RATE + '    q = Parameter(1.0, "kg", "q", min=0.0)\n',
        17,
        "Parameter has no argument min, the nearest is low: write Parameter(start, unit, text, low=, high=",
    ),
    "an argument of an earlier version": (
        RATE + '    q = State("m", "q", rate=u, finest=1e-3)\n',
        17,
        "State has no argument finest, the nearest is nominal_velocity: write State(unit, text, start=",
    ),
    "a contact without slide": (
        DRY.replace(", slide=f", "") + RATE_WITH_FRICTION,
        17,
        "Contact lacks the argument slide: write Contact(unit, text, mode, slip, slide, hold=",
    ),
    "items in a list": (
        RATE + '    q = Choice("kind", ["a", "b"])\n',
        17,
        "Choice takes at most 1 arguments without a name, got 2: write Choice(text, **items)",
    ),
    "an argument that another function lacks": (RATE + "    q = abs()\n", 17, "TypeError: abs() takes exactly one"),
    "two modes": (
        DRY.replace("mode=mode", "mode=(mode, mode)") + RATE_WITH_FRICTION,
        17,
        "mode of a Contact must be a Mode that is declared before it, got an object of type tuple",
    ),
    "a position as slip": (
        DRY.replace("slip=v", "slip=x") + RATE_WITH_FRICTION,
        17,
        "slip of R is x, but a slip is a speed: write slip=v",
    ),
    "a slip in quotes": (
        DRY.replace("slip=v", 'slip="v"') + RATE_WITH_FRICTION,
        17,
        "slip of a Contact must be an expression of st",
    ),
    "the rate of a sum": (
        RATE.replace("rate_of=v", "rate_of=v + u"),
        16,
        "rate_of of a is an expression, which is not a state of the model",
    ),
    "no range": (
        RATE + '    E = Output("N", "pull", k * x, low=3.0, high=1.0)\n',
        17,
        "E has an empty range: no number is at least 3.0 N and at most 1.0 N",
    ),
    "an expression as start": (
        RATE + '    q = Parameter(2.0 * m, "kg", "q")\n',
        17,
        "start of q must be a number, got an expression",
    ),
    "a unit without a point": (RATE + '    q = Parameter(1.0, "Nm", "q")\n', 17, "q has the unit 'Nm': write \"N.m\""),
    "a unit with a power": (
        RATE + '    q = Parameter(1.0, "m/s^2", "q")\n',
        17,
        "q has the unit 'm/s^2': write \"m/s2\"",
    ),
    "degrees": (RATE + '    q = Parameter(1.0, "deg", "q")\n', 17, "q has the unit 'deg': use rad instead of deg"),
    "degrees in a speed": (
        RATE + '    q = Parameter(1.0, "deg/s", "q")\n',
        17,
        """q has the unit 'deg/s': use rad/s instead of deg/s, and display="deg/s" to show degrees""",
    ),
    "degrees of a temperature": (
        RATE + '    q = Parameter(1.0, "deg C", "q")\n',
        17,
        "q has the unit 'deg C': use K for temperatures",
    ),
    "no unit": (RATE + '    q = Parameter(1.0, "", "q")\n', 17, "q has the unit '': a pure number has the unit \"1\""),
    "a description for a unit": (
        RATE + '    q = Parameter(1.0, "mass", "kg")\n',
        17,
        "q has the unit 'mass': the unit comes before the description, so exchange them",
    ),
    "a parameter without an effect": (RATE, 11, "no equation uses f: use it, or remove its declaration"),
    "an input without an effect": (RATE.replace("F - ", "-") + USE, 13, "no equation uses F: use it, or remove its"),
    "a choice without an effect": (RATE + USE + '    q = Choice("kind", a="x", b="y")\n', 18, "no equation uses q: "),
    "a bare equation": (RATE + "    m * a == F - k * x\n", 17, "this line has no effect: an equation is written as"),
    "a bare term": (RATE + "    k * x + F\n", 17, "this line has no effect: an equation is written as name = Output"),
    "a bare sign": (RATE + "    -F\n", 17, "this line has no effect: an equation is written as name = Output"),
    "a bare name": (RATE + "    F\n", 17, "this line has no effect: an equation is written as name = Output"),
    "a name with a space": (
        RATE + '    vars()["k 1"] = Parameter(1.0, "1", "q")\n',
        17,
        "the name 'k 1' is no identifier: use letters, digits and _, and no digit at the start",
    ),
    "a name with a point": (
        RATE + '    vars()["k.1"] = Parameter(1.0, "1", "q")\n',
        17,
        "the name 'k.1' is no identifier",
    ),
    "a number for a name": (RATE + '    vars()[3] = Parameter(1.0, "1", "q")\n', 17, "the name 3 is no identifier"),
    "a condition on a contact force": (
        DRY + RATE_WITH_FRICTION.replace("F -", "choose(R > 0.0, F, 0.0) -"),
        18,
        "a condition in a compares R, which follows from a: use a condition on states",
    ),
    "a nominal velocity of zero": (
        RATE + '    q = State("m/s", "q", rate=f / m, nominal_velocity=0.0)\n',
        17,
        "the start values are invalid: nominal_velocity of q must be above 0, got 0.0",
    ),
    "a nominal velocity of zero for a driver": (
        RATE + '    q = State("m", "q", rate=u, nominal_velocity=0.0)\n',
        17,
        "the start values are invalid: nominal_velocity of q must be above 0, got 0.0",
    ),
    "a nominal velocity below zero": (
        RATE + '    q = State("m/s", "q", rate=f / m, nominal_velocity=-u)\n',
        17,
        "the start values are invalid: nominal_velocity of q must be above 0, got u = 1.0",
    ),
    "liftoff in words": (
        DRY.replace("slide=f", 'slide=f, lifts_off="no"') + RATE_WITH_FRICTION,
        17,
        "lifts_off must be True, False or None, got 'no'",
    ),
    "a function without a value": (RATE.replace("F -", "sqrt(-1.0) * F -"), 16, "sqrt(-1.0) has no value"),
    "degrees Celsius": (
        RATE + '    q = Parameter(1.0, "degC", "q")\n',
        17,
        "q has the unit 'degC': use K for temperatures and for their differences",
    ),
    "friction with a direction": (
        DRY.replace("slide=f", "slide=f * tanh(v / u)") + RATE_WITH_FRICTION,
        17,
        "slide of R changes its sign with the slip: write the size of the force",
    ),
    "friction without a value at rest": (
        DRY.replace("slide=f", "slide=f * v / fabs(v), hold=f") + RATE_WITH_FRICTION,
        17,
        "R: f * v / fabs(v) cannot be calculated at the start values, where fabs(v) is 0.0",
    ),
    "a start value after the declaration": (
        RATE + "    x.start = 0.1\n",
        17,
        "x.start is set after the declaration of x: write start=... in that line",
    ),
    "a declaration after the class": (
        RATE + "Mine.y = Output('m', 'position', 2.0 * Mine.x)\n",
        17,
        "Mine.y is set after the class: declare y in the body of the class",
    ),
    "a number in place of a declaration": (RATE + "Mine.k = 5.0\n", 17, "Mine.k is set after the class: declare k in"),
    "a bound that grows": (RATE + "    k.low += 1.0\n", 17, "k.low is set after the declaration of k: write low=..."),
    "a name of the class in a comprehension": (
        RATE + "    y = sum([k * x for _i in range(2)])\n",
        17,
        "k is a name of the class body, which comprehensions, lambdas and functions do not see: write a for loop",
    ),
    "a floor": (RATE.replace("F -", "floor(x) -"), 16, "floor is no function of fmus, which has sin, cos"),
    "a function of a text": (RATE.replace("F -", 'sin("x") -'), 16, "sin() needs an expression or a number, got 'x'"),
    "a function of a library": (
        RATE + "    import statistics\n    y = statistics.median([x, k])\n",
        18,
        "an expression has no value at build time, as if, and, or, not, max",
    ),
    "a value in a text": (
        RATE.replace('"acceleration"', 'f"acceleration of {m:.1f} kg"'),
        16,
        "m has no value at build time, so a text can show its name only: write {m}",
    ),
    "a mistake in a try statement": (
        RATE + "    try:\n        y = max(x, 0.0)\n    except ValueError:\n        y = x\n",
        18,
        "an expression has no value at build time, as if, and, or, not, max",
    ),
    "hertz as the rate of an angle": (
        RATE + '    fr = Parameter(2.0, "Hz", "frequency")\n    q = State("rad", "angle", rate=fr)\n',
        18,
        "q is in rad, but fr counts revolutions, as it has the unit Hz: write 2.0 * pi * fr",
    ),
    "hertz as an angular velocity": (
        RATE
        + '    fr = Parameter(2.0, "Hz", "frequency")\n    w = Output("rad/s", "speed", choose(k > 2 * k, fr, -fr))\n',
        18,
        "w is in rad/s, but choose(k > 2 * k, fr, -fr) counts revolutions, as it has the unit Hz: write 2.0 * pi *",
    ),
    "hertz in a sine": (
        RATE + '    fr = Parameter(2.0, "Hz", "frequency")\n    clock = State("s", "time", rate=1.0)\n'
        '    p = Output("1", "signal", sin(fr * clock))\n',
        19,
        "the argument of sin is an angle in rad, but fr * clock counts revolutions, as it has the unit Hz: write 2.0",
    ),
    "a holding force without a value at the start": (
        DRY.replace("slide=f", "slide=f, hold=f * x / fabs(x)") + RATE_WITH_FRICTION,
        17,
        "R: f * x / fabs(x) cannot be calculated at the start values, where fabs(x) is 0.0",
    ),
    "a number for a docstring": (RATE + "    __doc__ = 3\n", 4, "Mine has no docstring"),
    "a start out of the range of a state": (
        RATE + USE + '    q = State("m", "gap", start=-2.0, rate=u, low=0.0)\n',
        18,
        "q starts at -2.0 m, but its declaration says that it is at least 0.0 m",
    ),
    "a step longer than the run": (
        RATE + "    stop_time = 0.002\n",
        4,
        "step_size = 0.004 s is longer than the default run: set it to at most stop_time = 0.002 s",
    ),
    "a name for the rate of a driver": (
        RATE + '    q = State("m", "one", start=1.0, rate=u)\n    q_rate = Parameter(1.0, "m/s", "another")\n',
        17,
        "the name q_rate is reserved for the rate of q: choose another name",
    ),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_mistake_is_reported_in_one_sentence_with_its_line(wrong, tmp_path):
    body, line, sentence = WRONG[wrong]
    path = tmp_path / "mine.py"
    path.write_text(HEAD + body)
    with pytest.raises(BuildError, match=re.escape(f"{path}, line {line}: {sentence}")) as error:
        find_model(path).generated_source  # noqa: B018
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", RESERVED_NAMES)
def test_a_reserved_name_is_refused(name, tmp_path):
    """It belongs to the solver, to FMI, to C or to its compilers."""
    path = tmp_path / "mine.py"
    path.write_text(f'{HEAD}{RATE}    {name} = Parameter(1.0, "1", "ours")\n')
    with pytest.raises(BuildError, match=f"line 17: the name {name} is reserved by the solver or by C"):
        find_model(path).generated_source  # noqa: B018


WORKS = """
    scale, names = 2.0, ("x", "y")
    __slots__ = ()
    _note = "names with _ may be unused"
    import math
    def pull(stretch, k=k):
        return k * stretch
    for _ in range(2):
        pass
    body = vars()
    for n, name in enumerate(names):
        body[f"{name}_force"] = Output("N", f"force {n}", scale * math.pi * pull(x))
    import random
    body["random_force"] = Output("N", "force drawn from a seed", random.Random(1).random() * pull(x))
    fr = Parameter(2.0, "Hz", "frequency")
    angle = State("rad", "phase angle", rate=2.0 * math.pi * fr)
    decay = Output("rad/s", "rate of decay", fr * angle)
    forces = []
    for n in range(2):
        forces.append(pull(x))
    total = Output("N", f"sum of {x} and {forces[0]}", sum(forces))
    alias = k
    unused = k * x
    stop_time: float = 8.0
"""


def test_helper_values_of_the_class_body_are_allowed(tmp_path):
    """Values that the body reads, private names, modules, aliases and terms; real numbers of numpy."""
    path = tmp_path / "mine.py"
    numbers = '    q = Parameter(np.int64(2), "kg", "q", low=np.float32(0.5))\n    twice = Output("kg", "2 q", q + q)\n'
    path.write_text(HEAD.replace("from", "import numpy as np\nfrom", 1) + RATE + WORKS + USE + numbers)
    model = scalar_class(path)
    assert {"x_force", "y_force"} <= vars(model).keys()
    assert model.total.text == "sum of x and an expression"
    assert (model.stop_time, model.q.start, model.q.low) == (8.0, 2.0, 0.5)
    assert find_model(path).analysis.model.stop_time == 8.0


def test_friction_may_be_zero_at_the_start(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(HEAD.replace("f = Parameter(1.0", "f = Parameter(0.0") + DRY + RATE_WITH_FRICTION + USE)
    assert scalar_class(path).f.start == 0.0


def test_friction_may_have_no_value_at_high_speeds(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(HEAD + DRY.replace("slide=f", "slide=f * sqrt(1.0 - 4.0 * v * v / (u * u))") + RATE_WITH_FRICTION)
    assert scalar_class(path).f.start == 1.0


def test_friction_may_be_divided_by_an_input_that_starts_above_zero(tmp_path):
    path = tmp_path / "mine.py"
    tank = '    tank = Input(2.0, "kg", "mass of a tank")\n'
    path.write_text(HEAD + tank + DRY.replace("slide=f", "slide=f * m / tank") + RATE_WITH_FRICTION + USE)
    assert scalar_class(path).tank.start == 2.0


def test_a_model_file_may_print(tmp_path, capsys):
    """Once, though it is run twice to find values that differ."""
    path = tmp_path / "mine.py"
    path.write_text(HEAD + RATE + USE + '    print("stiffness", k.start)\n')
    assert find_model(path).analysis.name == "Mine"
    assert capsys.readouterr().out == "stiffness 100.0\n"


@pytest.mark.parametrize("kind", [fmus.Parameter, fmus.Fixed, fmus.Input, fmus.State, fmus.Output, fmus.Contact])
def test_the_signature_of_a_declaration_names_all_arguments(kind):
    """And its documentation describes each of them."""
    arguments = inspect.signature(kind).parameters
    assert {"unit", "text", "low", "high", "above", "below", "display"} <= arguments.keys()
    assert not {"args", "kwargs", "more", "_"} & arguments.keys()
    described_arguments = {word for line in kind.__doc__.splitlines() for word in line.strip().split(", ")}
    assert arguments.keys() <= described_arguments


def test_any_docstring_text_survives_unchanged(tmp_path):
    """LaTeX, quotes and format placeholders in a docstring; a byte order mark before the file."""
    words = r"""A \nu \x \N{k} {imports} spring of "three" \"\"\" quotes"""
    path = tmp_path / "mine.py"
    text = (HEAD + RATE + USE).replace('    """A mass on a spring.', f"    r'''{words}")
    path.write_text("\ufeff" + text.replace('- c v\n    """', "- c v\n    '''"), encoding="utf-8")
    assert scalar_class(path).__doc__.startswith(words)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "a model file must define exactly one class derived from Model; this one has none"),
        (HEAD + RATE + HEAD.replace("Mine", "Other") + RATE, "this one has 2: Mine, Other"),
    ],
)
def test_a_file_holds_one_model(text, sentence, tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(text)
    with pytest.raises(BuildError, match=sentence):
        find_model(path).generated_source  # noqa: B018


@pytest.mark.parametrize("name", ["Solver", "Integrator", "Größe", "NULL", "fmi2True", "FMI3_Export"])
def test_a_class_name_must_be_unique(name, tmp_path):
    path = tmp_path / "mine.py"
    path.write_text((HEAD + RATE).replace("Mine", name))
    with pytest.raises(BuildError, match=f"mine.py, line 4: the class name {name} is reserved or not ASCII"):
        find_model(path).generated_source  # noqa: B018


@pytest.mark.parametrize("name", ["my-model.py", "runtime.py", "1st.py", "class.py"])
def test_a_file_must_have_a_valid_model_name(name, tmp_path):
    path = tmp_path / name
    path.write_text(HEAD + RATE)
    with pytest.raises(BuildError, match="the file name is the model name: use only ASCII letters, digits and _"):
        find_model(path).generated_source  # noqa: B018


def test_the_command_reports_it_without_a_traceback(tmp_path):
    (tmp_path / "mine.py").write_text(HEAD)
    run = build("mine.py", folder=tmp_path)
    assert run.returncode == 1
    assert run.stderr == "Error: mine.py, line 15: v has no derivative: declare an Output or a State with rate_of=v.\n"
    missing = build("nowhere.py", folder=tmp_path)
    assert (missing.returncode, missing.stderr) == (2, "Error: There is no file nowhere.py.\n")
