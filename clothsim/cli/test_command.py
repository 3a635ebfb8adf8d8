"""`clothsim test`: a standard test of a fabric, simulated."""

import argparse
from pathlib import Path
from typing import Any

from clothsim import engine
from clothsim.base.file_writing import make_directory, refuse_replacing, write_atomically
from clothsim.cli import on_demand
from clothsim.cli.arguments import add_overwrite, as_count, as_length, assigned_number
from clothsim.cli.report import Report, messages

_DESCRIPTION = """\
Simulate a standard test of a fabric: cusick, the drape of ISO 9073-9 (coefficient, folds, their depth over many lays);
cantilever, the bending length of ASTM D1388; tensile, bias and shear, force against stretch. Each value comes with its
spread over the specimens and with what is known of its error.

  clothsim test cotton --method cusick
  clothsim test denim --method cantilever --set bending_warp=3e-5
"""


TEST_NAME, DRAPE_NAME = "test.json", "drape.png"


def add_to(commands: Any) -> None:
    """Add the command to the parser."""
    test = commands.add_parser("test", description=_DESCRIPTION)
    test.add_argument("fabric", metavar="FABRIC", help="a named fabric (`clothsim fabrics` lists them)")
    methods = ("cusick", "cantilever", "bias", "tensile", "shear")
    test.add_argument("--method", choices=methods, default="cusick", help="the test (default cusick)")
    test.add_argument("--lays", metavar="N", help="specimens (default 16 lays, or 3 strips of each direction)")
    test.add_argument("--size", metavar="L", help="distance between vertices of a drape (default 6mm)")
    test.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="a key of [cloth] to replace")
    test.add_argument("-o", "--output", type=Path, metavar="DIR", help="write test.json (and drape.png) there")
    add_overwrite(test)
    test.add_argument("--quiet", action="store_true", help="print only the result")
    test.add_argument("--json", action="store_true", help="print test.json, the rest on stderr")
    test.add_argument("--debug", action="store_true", help="show tracebacks")
    test.set_defaults(handler=_test)


def _test(arguments: argparse.Namespace) -> Report:
    engine.fabric_named("FABRIC", arguments.fabric)
    lays = None if arguments.lays is None else as_count("--lays", arguments.lays)
    cloth = {"fabric": arguments.fabric, **dict(assigned_number(text) for text in arguments.set)}
    size = {} if arguments.size is None else {"size": as_length("--size", arguments.size, "6mm")}
    if arguments.output is not None:
        refuse_replacing([arguments.output / name for name in (TEST_NAME, DRAPE_NAME)], arguments.overwrite)
    message = messages(arguments, f"{arguments.fabric} by {arguments.method}")
    done = on_demand.fabric_tested(cloth, arguments.method, lays, message=message, **size)
    lines = done.text()
    if arguments.output is not None:
        make_directory(arguments.output)
        write_atomically(arguments.output / TEST_NAME, on_demand.to_json(done.document()).encode())
        files = [TEST_NAME]
        if arguments.method == "cusick":
            on_demand.draw_drape(done, arguments.output / DRAPE_NAME)
            files.append(DRAPE_NAME)
        lines += f"\n  files     {arguments.output}: {', '.join(files)}"
    return Report(done.document(), lines, verdict=True)
