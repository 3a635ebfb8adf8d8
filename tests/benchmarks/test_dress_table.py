"""Table of sewn garments: cells, summary and sheet of stored rows; the garments themselves are not run."""

import json

import pytest
from PIL import Image

from tests.benchmarks.dress_table import (
    COLUMNS,
    DESIGNS,
    FILES,
    HEADER,
    cells,
    contact_sheet,
    drawn,
    main,
    read_row,
    store,
    summary,
)

SEWN = {
    "pattern": "r004",
    "body": "mean_all",
    "size": 0.02,
    "cpu_seconds": 27.4,
    "status": "completed",
    "reason": "All 8 seams are closed.",
    "seams": 8,
    "welded": 8,
    "worst_gap": 0.0,
    "vertices": 1133,
    "stretch": [0.99, 1.0, 1.02],
    "ease": {"waist": 0.07, "hem": 0.162},
}
REFUSED = {"pattern": "tee", "body": "f", "size": 0.02, "cpu_seconds": 0.1, "status": "refused", "reason": "No panel."}


def test_cells_of_rows():
    row = cells(SEWN)
    assert len(row) == len(HEADER) == len(cells(REFUSED))
    assert row[2:7] == ("completed", "8 of 8", "0", "1,133", "0.99 / 1.00 / 1.02")
    assert row[7:] == ("-, 7, -, 16", "27")
    assert cells(REFUSED)[2] == "refused: No panel."
    assert [cells({**SEWN, "worst_gap": gap})[4] for gap in (0.00053, 0.0997, 0.2081)] == ["0.53", "100", "208"]


def test_summary_counts_what_is_completed_and_closed():
    rows = [SEWN, {**SEWN, "welded": 7}, {**SEWN, "status": "sewn"}, REFUSED]
    assert summary(rows).startswith("1 of 4 ")


def test_stored_rows_are_not_run_again(tmp_path, capsys):
    store(tmp_path, SEWN)
    assert read_row(tmp_path, "r004") == SEWN
    assert read_row(tmp_path, "r005") == {}
    main(["--only", "r004", "-o", str(tmp_path)])
    assert "1 of 1 completed" in capsys.readouterr().out
    assert (tmp_path / "table.md").read_text().count("\n|") == 2


def test_rows_of_earlier_sweeps_are_not_run_again_and_the_page_lists_what_is_open(tmp_path, capsys):
    rows, page = tmp_path / "rows.json", tmp_path / "page.md"
    page.write_text("<!-- dress_designs_stored -->\n<!-- /dress_designs_stored -->\n")
    rows.write_text(json.dumps([{**SEWN, "pattern": "d001"}, {**SEWN, "pattern": "d002", "welded": 7}]))
    (tmp_path / "new").mkdir()
    store(tmp_path / "new", {**SEWN, "pattern": "d000", "notes": ["lifted"]})
    main(["--only", "d000", "d001", "-o", str(tmp_path / "new"), "--stored", str(rows), "--page", str(page)])
    assert "2 of 3 completed" in capsys.readouterr().out
    assert [row["pattern"] for row in json.loads(rows.read_text())] == ["d000", "d001", "d002"]
    assert "notes" not in rows.read_text()
    assert [name in page.read_text() for name in ("d000", "d001", "d002")] == [False, False, True]


def test_sheet_has_a_tile_for_each_row(tmp_path):
    (tmp_path / "r004").mkdir()
    Image.new("RGB", (100, 100), "red").save(tmp_path / "r004" / "worn.png")
    file = contact_sheet([SEWN] * (COLUMNS + 1), tmp_path)
    with Image.open(file) as sheet:
        red = sum(count for count, colour in sheet.getcolors(2**20) if colour == (255, 0, 0))
    assert red == (COLUMNS + 1) * 100 * 100


def test_every_pattern_has_one_name():
    assert len(FILES) == 25
    assert not set(FILES) & set(DESIGNS)


def test_designs_are_drawn_by_a_seed():
    drawn_once, again, other = drawn(43, 16), drawn(43, 16), drawn(44, 16)
    assert drawn_once == again != other
    assert len(set(drawn_once)) == 16
    assert set(drawn_once) <= set(DESIGNS)


def test_an_unknown_pattern_is_refused(tmp_path):
    with pytest.raises(SystemExit):
        main(["--only", "r99", "-o", str(tmp_path)])
