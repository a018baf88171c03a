"""Print the code with which a shell completes commands and options at the tab key.

For bash add ``source <(adhesis completion bash)`` to ~/.bashrc, for zsh
``source <(adhesis completion zsh)`` to ~/.zshrc, after compinit.
"""

from __future__ import annotations

import argparse
from itertools import chain

EXAMPLES = ("adhesis completion bash", "adhesis completion zsh")
_SHELLS = ("bash", "zsh")
# zsh runs the same function by its emulation of bash's completion.
_ZSH = "autoload -U +X bashcompinit && bashcompinit\n"
_SCRIPT = """\
_adhesis() {{
    local word=${{COMP_WORDS[COMP_CWORD]}} words=""
    if [ "$COMP_CWORD" -eq 1 ]; then
        words="{commands}"
    else
        case ${{COMP_WORDS[1]}} in
{cases}
        esac
    fi
    COMPREPLY=($(compgen -W "$words" -- "$word"))
}}
complete -o bashdefault -o default -F _adhesis adhesis
"""


OPTIONS = (("shell SHELL", None, " or ".join(_SHELLS), {"choices": _SHELLS}),)


def execute(args: argparse.Namespace) -> None:
    """Print the script."""
    from adhesis.ensemble.command.main import COMMANDS, parser_of

    cases = "\n".join(_case(name, parser_of(name)) for name in COMMANDS)
    commands = " ".join([*COMMANDS, "--help", "--version"])
    start = _ZSH if args.shell == "zsh" else ""
    print(start + _SCRIPT.format(commands=commands, cases=cases), end="")


def _case(name: str, parser: argparse.ArgumentParser) -> str:
    """Return the words that follow a command: options, if one is begun, or choices."""
    options = " ".join(sorted(o for a in parser._actions for o in a.option_strings))
    positional = (a.choices or () for a in parser._actions if not a.option_strings)
    choices = " ".join(map(str, chain.from_iterable(positional)))
    by_word = f'case $word in -*) words="{options}" ;; *) words="{choices}" ;; esac'
    return f"            {name}) {by_word} ;;"
