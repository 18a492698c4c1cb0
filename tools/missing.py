"""Says which packages an install that did not end has left out, of those that some extras of this project need.

python tools/missing.py plot,report
"""

import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from pip._vendor.packaging.requirements import Requirement

try:
    import tomllib
except ImportError:  # Python 3.10
    from pip._vendor import tomli as tomllib


def missing(extras: list[str]) -> list[str]:
    """Return the names of the requirements that are not installed, at a version that they accept, in their order."""
    project = tomllib.loads(Path(__file__).parents[1].joinpath("pyproject.toml").read_text(encoding="utf-8"))["project"]
    texts = [*project["dependencies"], *(text for extra in extras for text in project["optional-dependencies"][extra])]
    return [each.name for each in map(Requirement, texts) if not _is_there(each)]


def _is_there(requirement: Requirement) -> bool:
    if requirement.marker is not None and not requirement.marker.evaluate({"extra": ""}):
        return True  # not needed here
    try:
        return requirement.specifier.contains(version(requirement.name), prereleases=True)
    except PackageNotFoundError:
        return False


if __name__ == "__main__":
    names = ", ".join(missing(sys.argv[1].split(","))) or "only fg-mujoco itself"
    sys.exit(f"the install did not end; missing: {names}. With a network, the same command goes on")
