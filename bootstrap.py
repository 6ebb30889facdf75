"""Set up ``.venv`` in this checkout once, then run a command in it. Needs Python 3.11 or newer with pip, nothing else.

    python3 bootstrap.py certify ARGUMENT...   the command line
    python3 bootstrap.py test ARGUMENT...      the tests; arguments go to pytest
    python3 bootstrap.py docs                  the documentation as a site, in out/docs
    python3 bootstrap.py setup                 only the set-up, with the tools for the tests

What is installed is pinned and hashed in ``requirements/*.lock``. A changed lock or Python makes ``.venv`` anew.
"""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent
VENV = ROOT / ".venv"
STAMP = VENV / "installed.json"
PYTHON = VENV / "bin" / "python"
PACKAGES = ("symbolic", "certify", "sims", "reports")
PARTS = {
    "certify": ["runtime", "project"],
    "test": ["runtime", "test", "project"],
    "docs": ["runtime", "docs", "project"],
    "setup": ["runtime", "test", "project"],
}


def fail(reason):
    print("bootstrap: " + reason, file=sys.stderr)
    sys.exit(2)


def lock(group):
    return ROOT / "requirements" / (group + ".lock")


def wanted(part):
    """What the stamp says of ``part`` (runtime, test, docs or project) when it is installed."""
    source = ROOT / "pyproject.toml" if part == "project" else lock(part)
    return hashlib.sha256(source.read_bytes()).hexdigest()


def installed():
    """What is in ``.venv``: nothing if it is missing, half made, moved or made by another Python."""
    if not PYTHON.exists() or not STAMP.exists():
        return {}
    stamp = json.loads(STAMP.read_text())
    here = {"python": sys.version, "root": str(ROOT), "runtime": wanted("runtime")}
    return stamp if {key: stamp.get(key) for key in here} == here else {}


def pip(*arguments):
    options = ["--quiet", "--disable-pip-version-check", "--no-deps", "--no-compile"]
    command = [str(PYTHON), "-m", "pip", "install", *options, *arguments]
    if subprocess.run(command, stdout=sys.stderr, cwd=ROOT).returncode != 0:
        fail("pip could not install the locked packages; its reason is above")


def make_environment():
    if VENV.exists():
        shutil.rmtree(VENV)
    try:
        venv.create(VENV, symlinks=True, with_pip=True)
    except subprocess.CalledProcessError:
        fail("this Python cannot make a virtual environment with pip; on Debian and Ubuntu: apt install python3-venv")


def compile_sources():
    """Byte code for all that is imported, on all processors: without it every start would pay seconds for some."""
    folders = [str(next(VENV.glob("lib/python3*/site-packages"))), *(str(ROOT / name) for name in PACKAGES)]
    tests = r"[/\\]tests[/\\]"  # of the libraries: a third of the files, some of them wrong on purpose
    command = [str(PYTHON), "-m", "compileall", "-q", "-q", "-j", "0", "-x", tests, *folders]
    subprocess.run(command, stdout=sys.stderr, cwd=ROOT)


def set_up(parts):
    state = installed()
    missing = [part for part in parts if state.get(part) != wanted(part)]
    if not missing:
        return
    if not state:
        print("bootstrap: installing into .venv, once (about half a minute and 720 MB)", file=sys.stderr)
        make_environment()
        state = {"python": sys.version, "root": str(ROOT)}
    STAMP.unlink(missing_ok=True)
    locks = [item for part in missing if part != "project" for item in ("-r", str(lock(part)))]
    if locks:
        pip("--require-hashes", "--only-binary", ":all:", *locks)
    if "project" in missing:
        pip("--no-index", "--no-build-isolation", "--editable", str(ROOT))
    compile_sources()
    state.update({part: wanted(part) for part in missing})
    STAMP.write_text(json.dumps(state, indent=1))


def main():
    if sys.version_info < (3, 11):
        fail("Python 3.11 or newer is needed, this is " + sys.version.split()[0])
    command, arguments = (sys.argv[1] if len(sys.argv) > 1 else ""), sys.argv[2:]
    if command not in PARTS:
        fail("say what to run: certify, test, docs or setup")
    set_up(PARTS[command])
    if command == "certify":
        os.execv(VENV / "bin" / "certify", ["certify", *arguments])
    if command == "test":
        os.chdir(ROOT)
        os.execv(PYTHON, [str(PYTHON), "-m", "pytest", "-n", "2", *arguments])
    if command == "docs":
        os.chdir(ROOT)
        os.execv(PYTHON, [str(PYTHON), "-m", "sphinx", "-W", "-q", "-b", "html", "docs", "out/docs", *arguments])


if __name__ == "__main__":
    main()
