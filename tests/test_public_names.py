"""Public names of both packages."""

import subprocess
import sys
from pathlib import Path

import pytest

import clothsim
import transfer
from clothsim import patterns


@pytest.mark.parametrize("package", [clothsim, transfer])
def test_dir_shows_the_public_names_and_each_is_there(package):
    names = [name for name in dir(package) if name != "__version__"]
    assert names == sorted(package.__all__)
    for name in names:
        assert getattr(package, name) is not None
    with pytest.raises(AttributeError, match="nothing_of_this_name"):
        package.nothing_of_this_name  # noqa: B018


@pytest.mark.parametrize(
    ("door", "earlier", "now"), [(patterns, "Seam", "MeshedSeam"), (transfer, "followed_source", "source_frames")]
)
def test_an_earlier_name_is_the_new_one_and_warns(door, earlier, now):
    with pytest.warns(DeprecationWarning, match=now):
        assert getattr(door, earlier) is getattr(door, now)
    assert earlier not in dir(door)


@pytest.mark.parametrize("package", [clothsim, transfer])
def test_no_public_name_is_that_of_a_module_which_would_hide_it(package):
    modules = {file.stem for file in Path(package.__file__).parent.iterdir()}
    assert modules.isdisjoint(package.__all__)


@pytest.mark.parametrize("package", [clothsim, transfer])
def test_the_packages_are_typed(package):
    assert (Path(package.__file__).parent / "py.typed").is_file()


@pytest.mark.parametrize("package", ["clothsim", "transfer"])
def test_to_import_a_package_loads_nothing_else(package):
    code = f"import sys, {package}; print([name for name in sys.modules if name.startswith({package!r})])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    lazy = ["clothsim.base", "clothsim.base.lazy_names"] if package == "clothsim" else []
    assert done.stdout.strip() == str([*lazy, package])
