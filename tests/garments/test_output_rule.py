"""Output of fit and dress: nothing that no run wrote is replaced, an input never."""

import pytest

import clothsim
from clothsim import InputError


@pytest.mark.parametrize("overwrite", [False, True])
def test_an_input_is_never_replaced(tmp_path, overwrite):
    pattern, body = tmp_path / "pattern.json", tmp_path / "body.obj"
    for file in (pattern, body):
        file.write_text("mine")
    for command in (
        lambda: clothsim.dress(pattern, "shirt", tmp_path, overwrite=overwrite),
        lambda: clothsim.fit("shirt", body, output=tmp_path, overwrite=overwrite),
    ):
        with pytest.raises(InputError, match="would be replaced"):
            command()
    assert pattern.read_text() == body.read_text() == "mine"


@pytest.mark.parametrize("name", ["garment.obj", "pattern.json", "body.obj", "pattern.svg"])
def test_dress_replaces_no_file_of_others(tmp_path, name):
    (tmp_path / name).write_text("mine")
    with pytest.raises(InputError, match="overwrite=True"):
        clothsim.dress("tunic", "shirt", tmp_path)
    assert (tmp_path / name).read_text() == "mine"


@pytest.mark.parametrize("name", ["fitted.obj", "body.obj", "garment_rest.obj"])
def test_fit_replaces_no_file_of_others(tmp_path, name):
    (tmp_path / name).write_text("mine")
    with pytest.raises(InputError, match="overwrite=True"):
        clothsim.fit("shirt", "shirt_large", output=tmp_path)
    assert (tmp_path / name).read_text() == "mine"
