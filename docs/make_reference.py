"""Write the generated parts of the reference pages: commands, variables, options, scene keys, result and record files.

`python docs/make_reference.py FMUS` reads the built FMUs in the folder FMUS (default: fmus) and replaces the text
between the comments <!-- generated: NAME --> and <!-- end --> in docs/reference.
"""

import re
import shlex
import sys
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import MISSING, fields, is_dataclass
from inspect import cleandoc
from pathlib import Path
from typing import Any, get_args

DOCS = Path(__file__).parent
PART = re.compile(r"(<!-- generated: ([\w-]+) -->\n).*?(<!-- end -->)", re.S)
MODELS = ("smd", "coulomb", "stickslip", "pacejka", "pendulum")

SCENE_TEXTS = {
    "title": "One line that describes the scene.",
    "outputs": "The output variables to record, at least one.",
    "model": "A model of this project by name: `smd` means `fmus/smd.fmu`. Give either `model` or `fmu`.",
    "fmu": "The path of an FMU, relative to the scene file.",
    "start": "Start time in s. Default: that of the FMU.",
    "stop": "Stop time in s. Default: the last of the `times`, or that of the FMU.",
    "method": "Name of the integration method, the value of `solver.method`.",
    "law": "Name of the friction law, the value of `friction`.",
    "rtol": "Value of `solver.rtol`.",
    "atol": "Value of `solver.atol`, in SI units.",
    "h_max": "Value of `solver.h_max`, in s.",
    "grid": "Communication step in s.",
    "times": "Times in s, such as those of a measurement; only these are recorded.",
    "follow": "Also visit the end of every internal step of the solver. Without `grid`, visit these only. "
    "Default: `true` without `grid`, `false` with it.",
    "repeat": "Number of runs for the measurement of the run time; the shortest time is reported.",
    "tolerance": "Relative tolerance that an FMU without exposed internal steps must meet. Without it, the run aims at "
    "1e-6 and states the error that it achieves.",
    "exchange": "Run such an FMU by model exchange, if it offers both interfaces.",
    "lenient": "Run such an FMU even if it violates the FMI standard.",
    "timeout": "Seconds allowed for one call of such an FMU.",
    "about": "Description of the model, which the report prints.",
    "analyses": "Analyses to perform: `decay`, `slip`, `steps`.",
    "plots": "Panels of the figure: `position`, `velocity`, `acceleration`, `phase`, `steps`, or the name of an "
    "output, which takes precedence; `[]` for no figure. Default: the first six outputs without modes, and the phase "
    "plane.",
    "values": "Parameters and inputs by name, in SI units; enumerations by name.",
    "inputs": "Input signals: the times `time` in s and a list of values for each input, in SI units; linear between "
    "two times, and a time that occurs twice is a jump.",
    "decay": "Settings of the analysis `decay`, see below.",
    "remark": "Remark on the comparison with known values, which the report prints.",
    "published": "Values of a publication, see below.",
    "reference": "Values of a closed form or a certified result, see below.",
    "parameter": "Parameters that the run sets, see below.",
    "citation": "The publication of the values in `[published]`, see below.",
}
CITATION_TEXTS = {
    "author": "Author or authors.",
    "title": "Title of the publication.",
    "year": "Year of the publication.",
    "location": "Table, figure or page of the publication.",
}
DECAY_TEXTS = {
    "gives": "The quantity to calculate from the peaks: damping ratio, friction force or friction torque.",
    "first": "Number of peaks to skip at the start.",
    "cycles": "Number of cycles to use. Default: all.",
}


def format_table(headings: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Return a Markdown table."""
    headings = list(headings)
    lines = [headings, ["---"] * len(headings), *([str(cell).replace("|", "\\|") for cell in row] for row in rows)]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def format_number(text: object) -> str:
    """Return a number of a model description with at most seven digits."""
    return "" if text is None else f"{float(str(text)):.7g}"


def variables(fmus: Path, model: str) -> str:
    """Return the table of the declared variables of a model."""
    from fmpy import read_model_description

    description = read_model_description(str(fmus / f"{model}.fmu"))
    rows = []
    for variable in description.modelVariables:
        if variable.name.startswith(("solver.", "events.")):
            continue
        start, unit = format_number(variable.start), variable.unit or ""
        if variable.type == "Enumeration":
            items = [f"{item.value} {item.name}" for item in variable.declaredType.items]
            start, unit = start and items[int(float(start)) - 1], ", ".join(items)
        kind = {"parameter": variable.variability, "output": "output", "input": "input"}[variable.causality]
        rows.append(
            (
                f"`{variable.name}`",
                kind if kind in ("output", "input") else f"{kind} parameter",
                start,
                unit,
                variable.description,
            )
        )
    return format_table(("name", "kind", "start", "unit or items", "description"), rows)


def common_variables(fmus: Path) -> str:
    """Return the table of the variables of the solver and of the events, which all FMUs have."""
    from fmpy import read_model_description

    description = read_model_description(str(fmus / "stickslip.fmu"))
    rows = [
        (
            f"`{variable.name}`",
            variable.type,
            f"{variable.variability} {variable.causality}",
            variable.unit or "",
            variable.description,
        )
        for variable in description.modelVariables
        if variable.name.startswith(("solver.", "events."))
    ]
    return format_table(("name", "type", "kind", "unit", "description"), rows)


def enumerations(fmus: Path) -> str:
    """Return the table of the items of all enumerations, with the FMUs that have them."""
    from fmpy import read_model_description

    models_by_item: dict[tuple[str, str, str, str], list[str]] = {}
    for model in MODELS:
        for variable in read_model_description(str(fmus / f"{model}.fmu")).modelVariables:
            for item in variable.declaredType.items if variable.type == "Enumeration" else ():
                default = int(float(variable.start)) == int(item.value)
                name = f"`{model}`" + (" (default)" if default else "")
                models_by_item.setdefault((variable.name, str(item.value), item.name, item.description), []).append(
                    name
                )
    rows = [
        (f"`{name}`", value, item, text, ", ".join(models))
        for (name, value, item, text), models in sorted(models_by_item.items())
    ]
    return format_table(("variable", "value", "name", "meaning", "FMUs"), rows)


def declaration_options() -> str:
    """Return the table of the options of declarations in model files."""
    from fmus.compiler.equations.model_declaration import OPTIONS

    rows = [
        (f"`{name}`", {float: "a number", str: "a string"}[option.type], option.text)
        for name, option in OPTIONS.items()
    ]
    return format_table(("option", "value", "meaning"), rows)


def describe_values(annotation: Any) -> str:
    """Return what a value of a type must be, in a few words."""
    from harness.scenes.schema import LIST, find_rule

    rule = find_rule(annotation)
    return "a list of tables" if rule is LIST else re.sub(r"^a text\b.*", "a text", rule.text)


def schema_within(schema: Any, key: str) -> Any:
    """Return the dataclass of the tables under a key."""
    annotation = next(field.type for field in fields(schema) if field.name == key)
    return next((part for part in get_args(annotation) if is_dataclass(part)), annotation)


def keys(texts: dict[str, str], *schemas: Any) -> str:
    """Return the table of the keys that have a text; they are fields of the dataclasses of the schema."""
    declared_fields = {field.name: field for schema in schemas for field in fields(schema)}
    rows = []
    for name, text in texts.items():
        field = declared_fields[name]
        if field.default is MISSING and field.default_factory is MISSING:
            text += " Required."
        elif field.default not in (None, MISSING, (), "", False) and "Default:" not in text:
            text += f" Default: {field.default}."
        rows.append((f"`{name}`", describe_values(field.type), text))
    return format_table(("key", "value", "meaning"), rows)


def result_files(fmus: Path) -> str:
    """Return the table of the files of sample commands, with their columns."""
    import tempfile

    from run_blocks import Block, run

    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "fmus").symlink_to(fmus.resolve())
        for command in SAMPLES:
            run(Block("sh", "", f"cd {folder} && friction-fmus {command}", 0, "", (0, 0), ""), folder, {})
        for file in sorted(folder.glob("results/**/*.csv")):
            headings = next(line for line in file.read_text().splitlines() if not line.startswith("#"))
            columns = ", ".join(f"`{heading.strip()}`" for heading in headings.split(",") if heading.strip())
            rows.append((f"`{file.relative_to(folder)}`", columns))
    return format_table(("file", "columns"), rows)


def all_commands() -> dict[str, Any]:
    """Return every command by its full name, such as `friction-fmus run`; the build is the first subcommand."""
    from build_fmus import main
    from harness.commands import commands

    others = {
        f"friction-fmus {name}": command for name, command in sorted(commands.commands.items()) if name != "build"
    }
    return {"friction-fmus": commands, "friction-fmus build": main} | others


def shared_options() -> list[tuple[str, str]]:
    """Return option and meaning of each option that at least three commands have."""
    import click

    contexts = (click.Context(command, info_name=name) for name, command in all_commands().items())
    counts = Counter(record for context in contexts for record in option_records(context))
    return [record for record, count in counts.items() if count >= 3]


def option_records(context: Any) -> list[tuple[str, str]]:
    """Return option and meaning of each option of a command, in the order of its help."""
    parameters = [parameter for parameter in context.command.get_params(context) if "--help" not in parameter.opts]
    records = filter(None, (parameter.get_help_record(context) for parameter in parameters))
    return [(option, text) for option, text in records if text]


def command_options() -> str:
    """Return the table of the options that several commands have."""
    return format_table(("option", "meaning"), ((f"`{option}`", text) for option, text in shared_options()))


def command_texts() -> str:
    """Return description, usage and options of every command."""
    common_options = shared_options()
    return "\n".join(command_text(name, command, common_options) for name, command in all_commands().items())


def command_text(name: str, command: Any, common_options: list[tuple[str, str]]) -> str:
    """Return the section of one command, which only names the shared options."""
    import click

    context = click.Context(command, info_name=name)
    lines = [f"## {name}\n"]
    for paragraph in cleandoc(command.help or "").split("\n\n"):
        verbatim = paragraph.startswith("\b\n")
        lines.append(f"```text\n{paragraph[2:]}\n```\n" if verbatim else f"{' '.join(paragraph.split())}\n")
    lines.append(f"```text\n{name} {' '.join(command.collect_usage_pieces(context))}\n```\n")
    records = option_records(context)
    rows = [(f"`{option}`", text) for option, text in records if (option, text) not in common_options]
    names = ", ".join(f"`{record[0].split()[0]}`" for record in records if record in common_options)
    if names:
        lines.append(f"[Shared options](#shared-options): {names}.\n")
    return "\n".join(lines) + (f"\n{format_table(('option', 'meaning'), rows)}" if rows else "")


def record_formats() -> str:
    """Return the record formats that the tests write: those that need no option, and a table of the others."""
    sys.path.append(str(DOCS.parent / "tests" / "support"))
    from record_formats import FORMATS

    plain, rows = [], []
    for record_format in FORMATS:
        arguments = [f"`--{key} {shlex.quote(f'{value}')}`" for key, value in record_format.options.items()]
        if record_format.base == "units":
            arguments.append("`--unit`")
        if record_format.refusal or arguments:
            result = f"refused: {record_format.refusal}" if record_format.refusal else " ".join(arguments)
            rows.append((record_format.text, result))
        else:
            plain.append(record_format.text)
    table = format_table(("format", "options, or the refusal"), rows)
    return f"These need no option: {'; '.join(plain)}.\n\n{table}"


SAMPLES = (
    "run stickslip",
    "run fmus/pendulum.fmu",
    "decay coulomb",
    "sweep stickslip --vary mu_d=0.5,0.6 --measures slips,period --workers 1 --name mine",
)


def parts(fmus: Path) -> dict[str, Callable[[], str]]:
    """Return the function that generates each part, by the name of the part."""
    from harness.scenes import scene
    from harness.scenes.run_spec import RunSpec

    return {
        **{f"variables-{model}": lambda model=model: variables(fmus, model) for model in MODELS},
        "command-options": command_options,
        "command-texts": command_texts,
        "variables-common": lambda: common_variables(fmus),
        "enumerations": lambda: enumerations(fmus),
        "declaration-options": declaration_options,
        "scene-keys": lambda: keys(SCENE_TEXTS, RunSpec, scene.SceneKeys),
        "scene-citation": lambda: keys(CITATION_TEXTS, schema_within(scene.SceneKeys, "citation")),
        "scene-decay": lambda: keys(DECAY_TEXTS, schema_within(scene.SceneKeys, "decay")),
        "result-files": lambda: result_files(fmus),
        "record-formats": record_formats,
    }


def update_page(page: str, fmus: Path) -> str:
    """Return a page with new generated parts."""
    generators = parts(fmus)
    return PART.sub(lambda part: f"{part[1]}\n{generators[part[2]]()}\n{part[3]}", page)


def main() -> None:
    """Rewrite the pages."""
    fmus = Path(sys.argv[1]) if len(sys.argv) > 1 else DOCS.parent / "fmus"
    for page in sorted((DOCS / "reference").glob("*.md")):
        text = page.read_text(encoding="utf-8")
        page.write_text(update_page(text, fmus), encoding="utf-8")


if __name__ == "__main__":
    sys.path[:0] = [str(DOCS.parent), str(DOCS)]
    main()
