import errno
import json
import os
import re
from pathlib import Path

import numpy as np
import pytest

from clothsim.base.errors import InputError
from clothsim.base.process_memory import peak_memory
from clothsim.base.record import (
    SUMMARY_NAME,
    RecordWriter,
    read_record,
    read_summary,
    record_peak_memory,
    to_json,
    write_summary,
)

ENTRIES = [{"step": 0, "residual": 0.1 + 0.2}, {"step": 1, "note": "Überschuss\n"}, {"step": 2, "pairs": [1, 2]}]


@pytest.fixture
def path(tmp_path):
    return tmp_path / "record.jsonl"


def write(path, entries, **keywords):
    with RecordWriter(path, **keywords) as writer:
        for entry in entries:
            writer.append(entry)


def test_entries_come_back_in_order(path):
    write(path, ENTRIES)
    assert read_record(path) == ENTRIES
    assert len(path.read_text().splitlines()) == len(ENTRIES)


def test_each_entry_is_in_the_file_at_once(path):
    with RecordWriter(path) as writer:
        assert read_record(path) == []
        for k, entry in enumerate(ENTRIES):
            writer.append(entry)
            assert read_record(path) == ENTRIES[: k + 1]


def strict(text):
    """json.loads that takes no NaN and no Infinity."""

    def refuse(constant):
        raise AssertionError(f"{constant} is not JSON")

    return json.loads(text, parse_constant=refuse)


@pytest.mark.parametrize(
    ("value", "read"),
    [
        (np.float64(0.1), 0.1),
        (np.float32(0.5), 0.5),
        (np.int64(7), 7),
        (np.bool_(True), True),
        (np.array([[1.0, 2.0], [3.0, np.inf]]), [[1.0, 2.0], [3.0, None]]),
        (np.array(3), 3),
        (float("nan"), None),
        (float("inf"), None),
        (-np.inf, None),
        ((1, [np.nan, {"a": np.float64("nan")}]), [1, [None, {"a": None}]]),
        (Path("a") / "b", str(Path("a") / "b")),
        (None, None),
        (1e-310, 1e-310),
    ],
)
def test_every_value_becomes_valid_json(path, value, read):
    assert strict(to_json({"value": value})) == {"value": read}
    write(path, [{"value": value}])
    assert read_record(path) == [{"value": read}]


def test_a_value_that_json_cannot_hold_leaves_no_half_line(path):
    with RecordWriter(path) as writer:
        writer.append(ENTRIES[0])
        with pytest.raises(TypeError):
            writer.append({"thing": object()})
        writer.append(ENTRIES[1])
    assert read_record(path) == ENTRIES[:2]


def test_a_last_line_cut_anywhere_is_left_out(path):
    write(path, ENTRIES)
    content = path.read_bytes()
    last = content.rindex(b"\n", 0, -1) + 1
    for end in range(last, len(content)):
        path.write_bytes(content[:end])
        assert read_record(path) == ENTRIES[:-1]


@pytest.mark.parametrize("line", ["{broken", "[1, 2]", "", "\x00\x00"])
def test_a_broken_line_inside_is_named(path, line):
    path.write_text(f'{{"step": 0}}\n{line}\n{{"step": 2}}\n')
    with pytest.raises(InputError, match=r"\b2\b"):
        read_record(path)


@pytest.mark.parametrize("kept", [0, 1, 3])
def test_a_resumed_record_goes_on_behind_the_lines_it_keeps(path, kept):
    write(path, ENTRIES)
    with path.open("a") as file:
        file.write('{"step": 3, "resid')
    write(path, [{"step": "new"}], resume_at=kept)
    assert read_record(path) == [*ENTRIES[:kept], {"step": "new"}]


def test_a_new_record_takes_nothing_over(path):
    write(path, ENTRIES)
    write(path, ENTRIES[:1])
    assert read_record(path) == ENTRIES[:1]


def test_a_record_that_is_too_short_or_missing_is_refused(path, tmp_path):
    with pytest.raises(InputError, match=r"record\.jsonl|other\.jsonl"):
        RecordWriter(path, resume_at=0)
    write(path, ENTRIES)
    with pytest.raises(InputError, match=r"\b3\b"):
        RecordWriter(path, resume_at=4)
    assert read_record(path) == ENTRIES
    with pytest.raises(InputError, match="nowhere"):
        RecordWriter(tmp_path / "nowhere" / "record.jsonl")
    with pytest.raises(InputError, match=r"record\.jsonl|other\.jsonl"):
        read_record(tmp_path / "other.jsonl")


SUMMARY = {
    "status": "completed",
    "steps": np.int64(3),
    "certificate": {"minimum_gap": np.inf, "intersection_free": True},
}


def test_a_summary_comes_back_and_its_keys_are_sorted(tmp_path):
    path = tmp_path / "summary.json"
    write_summary(path, SUMMARY)
    read = read_summary(path)
    assert read == {
        "status": "completed",
        "steps": 3,
        "certificate": {"minimum_gap": None, "intersection_free": True},
    }
    assert list(read) == sorted(read)
    assert len(path.read_text().splitlines()) > len(SUMMARY)


def test_a_summary_is_whole_or_not_there(tmp_path, monkeypatch):
    path = tmp_path / "summary.json"
    write_summary(path, {"status": "failed"})

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(InputError, match=re.escape(os.strerror(errno.ENOSPC))):
        write_summary(path, SUMMARY)
    assert read_summary(path) == {"status": "failed"}
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("content", [b"", b"{", b"[1]", b"\xff\xfe", b'{"a": 1} x'])
def test_a_broken_summary_is_refused(tmp_path, content):
    path = tmp_path / "summary.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"summary\.json"):
        read_summary(path)


@pytest.mark.parametrize("before", [{}, {"peak_memory_bytes": 1}, {"peak_memory_bytes": 1 << 60}])
def test_the_peak_memory_of_a_summary_follows_what_comes_after_it_and_never_falls(tmp_path, before):
    path = tmp_path / SUMMARY_NAME
    write_summary(path, {"status": "completed", **before})
    told = record_peak_memory(path)
    assert read_summary(path) == {"status": "completed", "peak_memory_bytes": told}
    known = before.get("peak_memory_bytes", 0)
    assert told == known if known > 1 else 1 < told <= peak_memory()
