"""`clothsim completion`: scripts that complete commands and options in a shell."""

import argparse
from pathlib import Path
from typing import Any

import shtab

from clothsim.cli import COMMANDS, parser_of_all

_DESCRIPTION = """\
Print a script that completes commands, options, their choices and files.

  clothsim completion bash > ~/.local/share/bash-completion/completions/clothsim
  clothsim completion zsh > ~/.zsh/_clothsim      # a folder of $fpath
  clothsim completion fish > ~/.config/fish/completions/clothsim.fish
"""


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    completion = commands.add_parser("completion", description=_DESCRIPTION)
    completion.add_argument("shell", choices=("bash", "zsh", "fish", "tcsh"), help="the shell")
    completion.add_argument("--debug", action="store_true", help="show tracebacks")
    completion.set_defaults(handler=_completion)


def _completion(arguments: argparse.Namespace) -> int:
    print(script(arguments.shell))
    return 0


def script(shell: str) -> str:
    """The script for a shell; where a parser takes a path, the files there complete it."""
    parser = parser_of_all()
    _complete_files(parser)
    return str(shtab.complete(parser, shell))


def _complete_files(parser: argparse.ArgumentParser) -> None:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, each in action.choices.items():
                _complete_files(each)
                if name in COMMANDS:  # shtab leaves out commands without a help
                    action._choices_actions.append(action._ChoicesPseudoAction(name, (), COMMANDS[name].summary))
        elif action.type is Path:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
