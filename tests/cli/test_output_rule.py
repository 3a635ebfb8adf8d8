"""Output of every command: what is there is replaced with --overwrite only, an input never."""

import pytest
from command_line import FREE

from clothsim.cli import main

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
WRITES = {
    "out/movie.gif": "run free.toml -o out",
    "out/iterates_2.npz": "run free.toml -o out --dump-iterates 2",
    "out/recovery.json": "recover free.toml --target tri.obj --free density -o out",
    "out/design.json": "design free.toml --girth .5=1 --free pattern.front.width -o out",
    "out/study.md": "study free.toml -o out",
    "out/test.json": "test cotton -o out",
    "out/jobs.jsonl": "farm plan recipe.toml -o out",
    "out/data.md": "farm pack none -o out",
    "out/fit.png": "fit tri.obj --to shirt -o out",
    "out/worn.png": "dress tunic --on shirt -o out",
    "data.jsonl": "farm pack none -o data.h5",
    "model.npz": "learn none -o model.npz",
    "side.png": "render run -o side.png",
    "run/side.png": "render run -o run/side.png",
    "run.glb": "export run -o run.glb",
    "run.zip": "bundle run",
    "rest.npz": "unpose run -o rest.npz",
    "out/author.json": "author run --keys 1=tri.obj --quick -o out",
    "worn.obj": "repose rest.npz free.toml -o worn.obj",
    "marked.png": "check tri.obj --on tri.obj -o marked.png",
    "all.png": "fabrics --swatches all.png",
    "height.npz": "gradient free.toml --loss height --wrt start -o height.npz",
}
READS = {
    "tri.obj": "check tri.obj --on tri.obj -o tri.obj",
    "out/record.jsonl": "run meshed.toml -o out",
    "out/summary.json": "recover free.toml --target out/summary.json --free density -o out",
    "run/checkpoint.npz": "recover run --target tri.obj --free density -o run",
    "drape.npz": "gradient free.toml --loss target=drape.npz --wrt start -o drape.npz",
    "run/trajectory.vtkhdf": "export run -o run/trajectory.vtkhdf",
    "seed.npz": "gradient seeded.toml --loss height --wrt start -o seed.npz",
    "worn.obj": "repose rest.npz worn.toml -o worn.obj",
    "fitted.obj": "fit tri.obj --to shirt --markers fitted.obj -o .",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A run, and what the commands read."""
    made = tmp_path_factory.mktemp("rule")
    (made / "out").mkdir()
    (made / "free.toml").write_text(FREE)
    (made / "meshed.toml").write_text(FREE.replace('"rectangle"\ncells = [4, 4]', '"out/record.jsonl"'))
    (made / "worn.toml").write_text(FREE.replace('"rectangle"\ncells = [4, 4]', '"worn.obj"'))
    (made / "seeded.toml").write_text(FREE + '[seed]\nfrom = "model"\nfile = "seed.npz"\n')
    recipe = '[farm]\nscene = "free.toml"\ncount = 1\nuntil = "time"\n[vary]\n"solver.dt" = [0.01]\n'
    (made / "recipe.toml").write_text(recipe)
    (made / "tri.obj").write_text(TRIANGLE)
    assert main(["run", str(made / "free.toml"), "-o", str(made / "run"), "--no-picture", "--quiet"]) == 0
    return made


@pytest.mark.parametrize("name", WRITES)
def test_what_is_there_is_kept(folder, monkeypatch, capsys, name):
    monkeypatch.chdir(folder)
    file = folder / name
    file.write_text("mine")
    assert main(WRITES[name].split()) == 2
    assert capsys.readouterr().err.startswith(f"{name} exists")
    assert file.read_text() == "mine"
    file.unlink()


@pytest.mark.parametrize("name", READS)
def test_an_input_is_never_replaced(folder, monkeypatch, capsys, name):
    monkeypatch.chdir(folder)
    file = folder / name
    before = file.read_bytes() if file.exists() else None
    if before is None:
        file.write_text("mine")
    assert main([*READS[name].split(), "--overwrite"]) == 2
    assert "would be replaced" in capsys.readouterr().err
    assert file.read_bytes() == (b"mine" if before is None else before)
    if before is None:
        file.unlink()


def test_a_picture_of_the_run_itself_is_drawn_again(folder, monkeypatch):
    monkeypatch.chdir(folder)
    monkeypatch.setenv("CLOTHSIM_RENDERER", "ray")
    for _ in range(2):
        assert main(["render", "run", "--size", "64x64"]) == 0
