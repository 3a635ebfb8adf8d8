"""The small form of the benchmark of authored clips: the fabric is found, and its clip nearer than all others."""

import json

from tests.benchmarks.author import main


def test_the_small_form_finds_the_fabric(tmp_path):
    assert main(["--small", "--json", str(tmp_path / "rows.json")]) == 0
    rows = {row["what"]: row for row in json.loads((tmp_path / "rows.json").read_text())}
    unedited, authored = rows["unedited run"], rows["numbers"]
    assert authored["error"] < 0.1 * unedited["error"]
    assert authored["error"] < rows["offsets in world space"]["error"]
    assert all(rows[what]["intersection_free"] for what in ("quick", "numbers", "the same, then quick"))
