"""Cost of gradients: its table on a small sheet."""

import json

from tests.benchmarks import gradient_cost


def test_the_table_is_kept(tmp_path, capsys):
    assert gradient_cost.main(["--cells", "6", "--duration", "0.04", "--json", str(tmp_path / "cost.json")]) == 0
    (row,) = json.loads((tmp_path / "cost.json").read_text())
    assert row["cells"] == 6
    assert row["steps"] == 4
    assert row["iterations"] >= 4
    assert set(row["by_number"]) == set(gradient_cost.PATHS)
    assert min(row["forward"], row["backward"]) > 0
    assert "6 x 6" in capsys.readouterr().out
