"""`clothsim completion`: scripts that complete commands and options in a shell."""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from clothsim.cli import parser_of_all

_DESCRIPTION = """\
Print a script that completes commands, options and their choices.

  clothsim completion bash > ~/.local/share/bash-completion/completions/clothsim
  clothsim completion zsh > ~/.clothsim.zsh      # then source it in ~/.zshrc
  clothsim completion fish > ~/.config/fish/completions/clothsim.fish
"""

_BASH = """\
_clothsim() {
    local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} words=""
    COMPREPLY=()
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W "@COMMANDS@" -- "$word"))
        return
    fi
    case "${COMP_WORDS[1]} $before" in
@CHOICES@
    esac
    if [ -z "$words" ] && [ "${word:0:1}" = "-" ]; then
        case "${COMP_WORDS[1]}" in
@OPTIONS@
        esac
    fi
    if [ -n "$words" ]; then
        COMPREPLY=($(compgen -W "$words" -- "$word"))
    else
        COMPREPLY=($(compgen -f -- "$word"))
    fi
}
complete -o filenames -F _clothsim clothsim
"""
_ZSH = "autoload -U +X bashcompinit && bashcompinit\n"


@dataclass(frozen=True)
class _Option:
    """An option of a command: its names, its choices or positional's, and its help."""

    names: tuple[str, ...]
    choices: tuple[str, ...]
    help: str


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    completion = commands.add_parser("completion", description=_DESCRIPTION)
    completion.add_argument("shell", choices=("bash", "zsh", "fish"), help="the shell")
    completion.add_argument("--debug", action="store_true", help="show tracebacks")
    completion.set_defaults(handler=_completion)


def _completion(arguments: argparse.Namespace) -> int:
    parser = parser_of_all()
    print({"bash": bash, "zsh": zsh, "fish": fish}[arguments.shell](parser), end="")
    return 0


def bash(parser: argparse.ArgumentParser) -> str:
    """The script for bash."""
    choices, options = [], []
    for command, own in _commands(parser):
        known = list(_options(own))
        names = " ".join(name for option in known for name in option.names)
        options.append(f'            {command}) words="{names}" ;;')
        for option in known:
            if option.choices:
                pattern = "|".join(f'"{command} {name}"' for name in option.names or (command,))
                choices.append(f'        {pattern}) words="{" ".join(option.choices)}" ;;')
    text = _BASH.replace("@COMMANDS@", " ".join(command for command, _ in _commands(parser)))
    return text.replace("@CHOICES@", "\n".join(choices)).replace("@OPTIONS@", "\n".join(options))


def zsh(parser: argparse.ArgumentParser) -> str:
    """The script for zsh, which takes that for bash."""
    return _ZSH + bash(parser)


def fish(parser: argparse.ArgumentParser) -> str:
    """The script for fish."""
    lines = []
    for command, own in _commands(parser):
        about = _quoted(own.description or "").split("\n")[0]
        lines.append(f"complete -c clothsim -n __fish_use_subcommand -f -a {command} -d '{about}'")
        for option in _options(own):
            names = " ".join(f"-l {n[2:]}" if n.startswith("--") else f"-s {n[1:]}" for n in option.names)
            given = f" -x -a '{' '.join(option.choices)}'" if option.choices else ""
            seen = f"complete -c clothsim -n '__fish_seen_subcommand_from {command}'"
            lines.append(f"{seen} {names}{given} -d '{_quoted(option.help)}'".replace("  ", " "))
    return "\n".join(lines) + "\n"


def _commands(parser: argparse.ArgumentParser) -> Iterator[tuple[str, argparse.ArgumentParser]]:
    """Names and parsers of the commands."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            yield from action.choices.items()


def _options(parser: argparse.ArgumentParser) -> Iterator[_Option]:
    """The options of a command, and its positional arguments that have choices."""
    for action in parser._actions:
        choices = tuple(str(choice) for choice in action.choices or ())
        if action.help != argparse.SUPPRESS and (action.option_strings or choices):
            yield _Option(tuple(action.option_strings), choices, action.help or "")


def _quoted(text: str) -> str:
    return text.replace("'", "")
