"""Model Context Protocol server of commands: check, run, certificate and keys as tools of a language model.

`python -m clothsim.cli.tool_server` serves on stdin and stdout (extra `mcp`). Each tool is a command with `--json` in a
process of its own, so that what a command prints is not part of the protocol; a call that is cancelled ends it.
"""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import clothsim
from clothsim.base.errors import ClothsimError

INSTRUCTIONS = """Finite-element cloth. Lengths in metres, times in seconds. Check a scene (.toml) before it is run; \
a run is only as good as its certificate."""


async def check(target: str) -> dict[str, Any]:
    """Examine a mesh file, a scene (.toml) or the directory of a run: {target, code, errors, warnings, notes}."""
    return await _answer("check", _name(target))


async def run(scene: str, output: str, settings: list[str], overwrite: bool = False) -> dict[str, Any]:
    """Simulate a scene (.toml, or the name of one that comes with clothsim) into a directory: its summary.

    `settings` replace keys of the scene: ["cloth.cells=[20,20]", "run.duration=0.5"]; [] for none. It can take minutes.
    """
    replaced = [word for setting in settings for word in ("--set", _name(setting))]
    more = ["--overwrite"] if overwrite else []
    return await _answer("run", _name(scene), "-o", _name(output), "--quiet", *more, *replaced)


async def certificate(run_directory: str) -> dict[str, Any]:
    """Status, reason, warnings and certificate of a run: intersections, least gap, stretch, residual, energy drift."""
    try:
        found = clothsim.open_run(Path(run_directory))
    except ClothsimError as error:
        raise _refusal(str(error)) from error
    kept = {key: found.summary.get(key) for key in ("warnings", "certificate")}
    return {"status": found.status, "reason": found.reason, **kept}


async def keys(section: str) -> dict[str, Any]:
    """List the keys of a section of a scene file (solver, cloth, effects.gravity): type, unit, default, range."""
    return await _answer("keys", _name(section))


TOOLS = (check, run, certificate, keys)


def main() -> int:
    """Serve the tools until stdin ends; 2 without the package `mcp`."""
    try:
        from mcp.server import MCPServer
    except ImportError:
        print("The tool server needs the package mcp. pip install 'clothsim[mcp]'", file=sys.stderr)
        return 2
    server = MCPServer("clothsim", instructions=INSTRUCTIONS)
    for tool in TOOLS:
        server.add_tool(tool)
    server.run()
    return 0


def _name(word: str) -> str:
    """The word of a caller; refused where a command would take it for an option, or no command can be given it."""
    if not word or word.startswith("-") or "\0" in word:
        raise _refusal(f"{word!r} is not a name: give one that has letters and begins with no hyphen, such as ./-a.")
    return word


async def _answer(*words: str) -> dict[str, Any]:
    """The JSON document of a command; bad input is refused with its sentence and remedy."""
    import anyio

    command = [sys.executable, "-m", "clothsim", *words, "--json"]
    done = await anyio.run_process(command, check=False, stdin=subprocess.DEVNULL)
    if done.stdout.strip():
        return dict(json.loads(done.stdout))
    events = [json.loads(line) for line in done.stderr.decode("utf-8").splitlines() if line.startswith("{")]
    faults = [f"{event['sentence']} {event['remedy']}" for event in events if event["event"] == "error"]
    raise _refusal(" ".join(faults) or f"clothsim {words[0]} ended with code {done.returncode}.")


def _refusal(sentence: str) -> Exception:
    """The error whose sentence a client is shown."""
    from mcp.server.mcpserver.exceptions import ToolError

    return ToolError(sentence)


if __name__ == "__main__":
    sys.exit(main())
