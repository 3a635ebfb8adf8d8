import re
from dataclasses import fields, replace

import numpy as np
import pytest

from clothsim.base.errors import InputError
from clothsim.files.runs.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from clothsim.solve.stepping.state import Previous, Rest, State


def odd_floats(seed, n):
    """Random bits as floats: every exponent, denormals, both zeros, infinities, NaN with payloads."""
    bits = np.random.default_rng(seed).integers(0, 2**64, size=(n, 3), dtype=np.uint64)
    values = bits.view(np.float64)
    values[0] = [0.0, -0.0, 5e-324]
    return values


CHECKPOINT = Checkpoint(
    State(
        time=0.1 + 0.2,
        dt=1 / 300,
        frame=7,
        step=2**40 + 1,
        positions=odd_floats(0, 50),
        velocities=odd_floats(1, 50),
        memory={"body_contact": 0.3},
        slow_steps=3,
        rest=Rest.CHANGING,
    ),
    scene_text='[cloth]\nname = "Röckchen 👗"\n\0',
    counters={"newton_iterations": 41, "seconds": 0.1 + 0.2, "effects": {"membrane": {"hessians": 12, "worst": None}}},
)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "checkpoint.npz"


def bits(value):
    return np.asarray(value, np.float64).tobytes()


def assert_same(one, other):
    assert (one.scene_text, one.counters, one.files) == (other.scene_text, other.counters, other.files)
    same_fields(one.state, other.state)


def same_fields(one, other):
    for field in fields(other):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(b, Previous):
            same_fields(a, b)
        elif isinstance(b, float | np.ndarray):
            assert bits(a) == bits(b), field.name
            assert np.shape(a) == np.shape(b)
        else:
            assert (type(a), a) == (type(b), b)


def test_a_checkpoint_comes_back_to_the_last_bit(path):
    write_checkpoint(path, CHECKPOINT)
    read = read_checkpoint(path)
    assert_same(read, CHECKPOINT)
    assert read.state.positions.dtype == np.float64
    assert read.state.positions.flags.c_contiguous
    assert read.state.positions.flags.writeable
    assert isinstance(read.state.time, float)
    assert isinstance(read.state.step, int)


def with_state(checkpoint, **changes):
    return replace(checkpoint, state=replace(checkpoint.state, **changes))


EARLIER = with_state(CHECKPOINT, previous=Previous(odd_floats(2, 50), odd_floats(3, 50), 1 / 7))


def test_the_step_before_comes_back_to_the_last_bit(path):
    write_checkpoint(path, EARLIER)
    assert_same(read_checkpoint(path), EARLIER)


@pytest.mark.parametrize("change", [{"dt": np.nan}, {"dt": 0.0}, {"positions": np.zeros((49, 3))}])
def test_a_broken_step_before_is_refused(path, change):
    write_checkpoint(path, with_state(EARLIER, previous=replace(EARLIER.state.previous, **change)))
    with pytest.raises(InputError, match=re.escape(path.name)):
        read_checkpoint(path)


def test_numpy_numbers_and_views_are_taken_too(path):
    counters = {"pairs": np.int64(3), "seconds": np.float64(0.1), "each": np.arange(3)}
    fortran = np.asfortranarray(CHECKPOINT.state.positions)
    write_checkpoint(path, with_state(replace(CHECKPOINT, counters=counters), positions=fortran, time=np.float64(0.25)))
    read = read_checkpoint(path)
    assert read.counters == {"pairs": 3, "seconds": 0.1, "each": [0, 1, 2]}
    assert bits(read.state.positions) == bits(CHECKPOINT.state.positions)
    assert read.state.time == 0.25


def test_the_new_checkpoint_takes_the_place_of_the_old_one(path, tmp_path):
    write_checkpoint(path, CHECKPOINT)
    write_checkpoint(path, with_state(CHECKPOINT, step=8))
    assert read_checkpoint(path).state.step == 8
    assert list(tmp_path.iterdir()) == [path]


def test_the_old_checkpoint_outlives_a_write_that_fails(path, tmp_path, monkeypatch):
    write_checkpoint(path, CHECKPOINT)

    def full(descriptor):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(InputError, match=re.escape(path.name)):
        write_checkpoint(path, with_state(CHECKPOINT, step=8))
    assert_same(read_checkpoint(path), CHECKPOINT)
    assert list(tmp_path.iterdir()) == [path]


def test_a_truncated_checkpoint_is_refused_wherever_it_ends(path):
    write_checkpoint(path, CHECKPOINT)
    content = path.read_bytes()
    for end in np.linspace(0, len(content) - 1, 40).astype(int):
        path.write_bytes(content[:end])
        with pytest.raises(InputError, match=re.escape(path.name)):
            read_checkpoint(path)


def test_no_changed_byte_goes_unnoticed_in_the_state(path):
    write_checkpoint(path, CHECKPOINT)
    content = path.read_bytes()
    state = content.index(CHECKPOINT.state.positions.tobytes())
    for place in (state, state + 600, state + CHECKPOINT.state.positions.nbytes - 1):
        path.write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])
        with pytest.raises(InputError, match=re.escape(path.name)):
            read_checkpoint(path)


def test_missing_and_foreign_files_are_reported(path, tmp_path):
    with pytest.raises(InputError, match=re.escape(str(path))):
        read_checkpoint(path)
    for write in (
        lambda: path.write_text("text"),
        lambda: np.savez(path, a=np.arange(3)),
        lambda: np.savez(path, format=np.frombuffer(b"something else", np.uint8)),
        lambda: np.savez(path, format=np.array([{"a": 1}], dtype=object)),
        lambda: path.write_bytes(npy(tmp_path)),
    ):
        write()
        with pytest.raises(InputError, match=re.escape(path.name)):
            read_checkpoint(path)


def npy(directory):
    np.save(directory / "a.npy", np.arange(3))
    return (directory / "a.npy").read_bytes()


@pytest.mark.parametrize(
    "change",
    [{"positions": np.zeros((4, 2))}, {"velocities": np.zeros((49, 3))}, {"positions": np.zeros(3)}],
)
def test_arrays_of_the_wrong_shape_are_refused(path, change):
    write_checkpoint(path, with_state(CHECKPOINT, **change))
    with pytest.raises(InputError, match=re.escape(path.name)):
        read_checkpoint(path)


def test_a_directory_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match="nowhere"):
        write_checkpoint(tmp_path / "nowhere" / "checkpoint.npz", CHECKPOINT)


def test_an_earlier_checkpoint_is_read_too(path):
    """Format 2 held the stiffness of contact, which nothing used."""
    write_checkpoint(path, CHECKPOINT)
    with np.load(path) as archive:
        arrays = dict(archive)
    assert arrays["format"].tobytes() == b"clothsim checkpoint 3"
    earlier = np.frombuffer(b"clothsim checkpoint 2", np.uint8)
    np.savez(path, **{**arrays, "format": earlier, "stiffness": np.zeros(1)})
    assert_same(read_checkpoint(path), CHECKPOINT)
    np.savez(path, **{**arrays, "format": np.frombuffer(b"clothsim checkpoint 1", np.uint8)})
    with pytest.raises(InputError):
        read_checkpoint(path)
