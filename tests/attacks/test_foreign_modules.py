"""Modules of standard names beside a recording: no process of any command, nor of `stseg.track`, runs them."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from arrivals import arrive, write_pieces
from checks import compiled_only, tables
from cluster import started_cluster
from recordings import ENVIRONMENT, OPTIONS

LIBRARIES = ("numpy", "scipy", "h5py", "cv2", "numba", "cyclopts", "rich", "PIL", "maxflow", "yaml", "duckdb", "stseg")
SCRIPT = "from stseg.commands.main import command\nif __name__ == '__main__':\n    command()\n"
"""What an installation makes of the entry point `stseg`."""
CALLS = """
import stseg
if __name__ == "__main__":
    stseg.track("rig.toml", "python.h5", workers=2, config=stseg.read_config("short.toml"))
"""


@pytest.fixture
def folder(tmp_path: Path, rig_path: Path) -> Path:
    """A recording between modules of all names that Python knows; each notes that it ran."""
    folder = shutil.copytree(rig_path.parent, tmp_path / "recording")
    (folder / "short.toml").write_text("[segments]\nlength = 1\nwarm_up = 1\n[detection]\nlattice_spacing = 0.25\n")
    plant(folder)
    return folder


def plant(folder: Path) -> None:
    ran = folder.parent / "ran"
    for name in (*sys.stdlib_module_names, *LIBRARIES, "sitecustomize", "usercustomize"):
        (folder / f"{name}.py").write_text(f"open({str(ran)!r}, 'a').write(__name__ + ' ')\n")
    (folder / ".numba_config.yaml").write_text("disable_jit: 1\n")


def call(folder: Path, program: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """A script of another folder, called in `folder`, in which nothing planted may have run."""
    script = folder.parent / "bin" / "stseg"
    script.parent.mkdir(exist_ok=True)
    script.write_text(program)
    command = [sys.executable, str(script), *map(str, arguments)]
    done = subprocess.run(command, env=ENVIRONMENT, cwd=folder, capture_output=True, text=True, check=False)
    ran = folder.parent / "ran"
    assert not ran.exists(), ran.read_text()
    return done


def succeeds(folder: Path, *arguments: object) -> None:
    done = call(folder, SCRIPT, *arguments)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
@compiled_only
def test_no_command_runs_what_lies_beside_the_recording(folder: Path) -> None:
    succeeds(folder, "run", "rig.toml", "-o", "run.h5", "--workers", 2, *OPTIONS)
    with started_cluster(folder.parent, folder) as cluster:
        succeeds(folder, "run", "rig.toml", "-o", "cluster.h5", "--scheduler", cluster.address, *OPTIONS)
    (folder / "answers.csv").write_text("action,id,name\nname,1,Ada\n")
    for words in tables(Path(__file__).with_suffix(".toml"))["commands"]:
        succeeds(folder, *words.split())


@compiled_only
def test_python_starts_no_process_that_does(folder: Path) -> None:
    done = call(folder, CALLS)
    assert done.returncode == 0, done.stderr
    assert (folder / "python.h5").exists()


def test_planted_modules_would_run_but_for_what_is_left_out(folder: Path) -> None:
    late = "import sys\nfrom stseg.commands import main\nsys.path.insert(0, '')\nmain.command()"
    assert call(folder, late, "inspect", "rig.toml").returncode == 0
    found = call(folder, "from stseg.kernels import accelerate\nprint(accelerate.numba.config.DISABLE_JIT)\n")
    assert found.stdout.strip() == ("0" if "NUMBA_DISABLE_JIT" not in ENVIRONMENT else "1"), found.stderr
    subprocess.run([sys.executable, "-c", "import html"], env=ENVIRONMENT, cwd=folder, capture_output=True, check=False)
    assert "html" in (folder.parent / "ran").read_text()


@pytest.mark.slow
@compiled_only
def test_following_runs_nothing_of_the_folder_of_the_recording(tmp_path: Path) -> None:
    folder = tmp_path / "arriving"
    folder.mkdir()
    rig = write_pieces(folder, empty=True)
    arrive(folder, 1, 2, 3, 4)
    plant(folder)
    short = ("segments.length=1", "segments.warm_up=0.5", "live.file_quiet_time=0.3", "live.background_time=1")
    sets = [word for constant in short for word in ("--set", constant)]
    succeeds(folder, "run", rig.name, "-o", "run.h5", "--follow", "--frames", "0:12", *sets)
    for words in tables(Path(__file__).with_suffix(".toml"))["with_videos"]:
        succeeds(folder, *words.split())
