"""What ``pyproject.toml`` cannot say: a wheel carries the plants of ``examples/`` as the gallery of ``symbolic``."""

from pathlib import Path
from shutil import copyfile

from setuptools import setup
from setuptools.command.build_py import build_py

EXAMPLES = Path(__file__).resolve().parent / "examples"


class BuildWithGallery(build_py):
    """An editable install reads them from the checkout instead."""

    def run(self) -> None:
        super().run()
        if self.editable_mode:
            return
        gallery = Path(self.build_lib) / "symbolic" / "gallery"
        gallery.mkdir(parents=True, exist_ok=True)
        for path in (*EXAMPLES.glob("*.toml"), *(EXAMPLES / "gallery").glob("*.toml")):
            copyfile(path, gallery / path.name)


setup(cmdclass={"build_py": BuildWithGallery})
