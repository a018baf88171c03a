"""Write the options of every command, as their parsers declare them, into docs/commands.md.

    python -m tools.commands

The text above the first command stays as it is.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

from adhesis.ensemble.command.main import COMMANDS, parser_of
from adhesis.ensemble.escape import markdown

_FEW = 3  # fewer options than these are described again, which is as short as a link
PAGE = Path(__file__).parents[1] / "docs" / "commands.md"


def page(text: str) -> str:
    """Return the page with the commands of today."""
    intro = text.partition("\n## adhesis ")[0].rstrip()
    shown: dict[str, str] = {}
    parts = [part for name in COMMANDS for part in _command(name, shown)]
    return "\n\n".join([intro, *parts]) + "\n"


def _command(name: str, described: dict[str, str]) -> Iterator[str]:
    """Return description, usage, options and an example of a command.

    ``described`` maps the lines of options of earlier commands to these commands: an option that
    means the same is named, and not described again.
    """
    parser = parser_of(name)
    first, *_ = (parser.description or "").split("\n\n")
    text = markdown(" ".join(first.split())).replace(r"\`\`", "`")  # names of commands, as code
    yield f"## adhesis {name}\n{text}"
    yield f"```text\n{' '.join(_usage(name, parser._actions))}\n```"
    for group in parser._action_groups:
        shown = [a for a in group._group_actions if "--help" not in a.option_strings]
        if shown:
            title = (group.title or "").removeprefix("positional ").capitalize()
            yield "\n".join([f"**{title}**", "", *_options(name, shown, described)])
    example, *_ = (parser.epilog or "").partition("\n")[2].splitlines()
    yield f"**Example**: `{example.strip()}`"


def _options(name: str, actions: list[argparse.Action], described: dict[str, str]) -> Iterator[str]:
    """Return a line for each option, and one for those that an earlier command has described."""
    same: dict[str, list[str]] = {}
    for action in actions:
        line = _option(action)
        if action.option_strings and described.setdefault(line, name) != name:
            same.setdefault(described[line], []).append(line)
        else:
            yield line
    for earlier, lines in same.items():
        if len(lines) < _FEW:
            yield from lines
        else:
            names = ", ".join(line.partition(": ")[0].removeprefix("- ") for line in lines)
            yield f"- as of [adhesis {earlier}](#adhesis-{earlier}): {names}"


def _usage(name: str, actions: list[argparse.Action]) -> Iterator[str]:
    """Return the words of a command: what it must have, and that there are options."""
    yield f"adhesis {name}"
    for action in actions:
        if action.required:
            yield _name(action) + (" …" if action.nargs == "+" else "")
    if any(not action.required for action in actions if "--help" not in action.option_strings):
        yield "[OPTION…]"


def _option(action: argparse.Action) -> str:
    text = (action.help or "–").replace("%%", "%")
    return f"- `{_name(action)}`: {markdown(text)}"


def _name(action: argparse.Action) -> str:
    if not action.option_strings:
        return str(action.metavar or action.dest)
    names = ", ".join(action.option_strings)
    if action.nargs == 0:
        return names
    return f"{names} {action.metavar or '|'.join(action.choices or ()) or action.dest.upper()}"


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
