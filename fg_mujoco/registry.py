"""A registry: things of one kind by name, each imported when it is first used.

    SCENES = Registry("scene", TrackError, "fg_mujoco.scenes")
    SCENES["dead_end"] = "fg_mujoco.addons.arena.bundled_scenes:dead_end"
    make = SCENES.find("dead_end")

The core imports no add-on. `addons/__init__.py` has tables of what users name, as texts, and `added` reads them, so
that an add-on is imported when something of it is used. Other packages register theirs as entry points of the group:

    [project.entry-points."fg_mujoco.scenes"]
    my_scene = "my_package.my_module:my_scene"
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from .errors import FgMujocoError, accepted_names

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

T = TypeVar("T")

ADDONS = "fg_mujoco.addons"


def added(kind: str) -> dict[str, str]:
    """Return what add-ons provide of a kind: name -> "module:attribute"; nothing where there are no add-ons."""
    try:
        table = import_module(ADDONS)
    except ModuleNotFoundError as error:
        if error.name != ADDONS:
            raise
        return {}
    return {name: f"{ADDONS}.{place}" for name, place in getattr(table, kind).items()}


def imported(place: str, what: str, error: type[FgMujocoError] = FgMujocoError) -> Any:
    """Return what "module:attribute" names; `what` and `error` are for the message if its add-on cannot be imported."""
    module, _, attribute = place.partition(":")
    try:
        return getattr(import_module(module), attribute)
    except FgMujocoError:
        raise
    except Exception as cause:
        if not module.startswith(f"{ADDONS}."):
            raise
        if find_spec(ADDONS) is None:
            said = "and no add-ons are installed; accepted: an installation with them"
            raise error(f"{what} is of an add-on, {said}") from cause
        said = " ".join(f"{type(cause).__name__}: {cause}".split())
        addon = module.removeprefix(f"{ADDONS}.").partition(".")[0]
        raise error(f"{what} is of the add-on {addon}, which cannot be imported: {said}") from cause


class Registry(Generic[T]):
    """Things of one kind by name: those of this package, and those that other packages register.

    A name of this package stays this package's. A name that two other packages register is refused when it is used.

    Args:
      kind: what the things are called in messages.
      error: class of the errors.
      group: of the entry points of other packages; None: other packages cannot register any.
      own: things of this package by name, as they are or as "module:attribute".
      instance_of: class of the things that other packages register.
    """

    def __init__(
        self,
        kind: str,
        error: type[FgMujocoError],
        group: str | None = None,
        own: Mapping[str, str | T] | None = None,
        instance_of: type = object,
    ) -> None:
        self.kind, self.error, self.group, self._own, self._class = kind, error, group, dict(own or {}), instance_of

    def __setitem__(self, name: str, thing: str | T) -> None:
        """Register a thing of this package, or "module:attribute", from where it is imported when it is first used."""
        self._own[name] = thing

    def __contains__(self, name: object) -> bool:
        return name in self._own

    def __iter__(self) -> Iterator[str]:
        """Yield the names of this package, in the order in which they were registered."""
        return iter(self._own)

    def names(self) -> tuple[str, ...]:
        """Return the names of this package and then, sorted, those of other packages."""
        return (*self._own, *sorted({point.name for point in self.entry_points()} - set(self._own)))

    def entry_points(self, name: str | None = None) -> list[EntryPoint]:
        """Return the entry points by which other packages register a name, or all names, sorted by name."""
        if self.group is None:
            return []
        from importlib.metadata import entry_points  # takes longer to import than all of this

        found = entry_points(group=self.group) if name is None else entry_points(group=self.group, name=name)
        return sorted(found, key=lambda point: point.name)

    def find(self, name: str, others: str = "") -> T:
        """Return the thing of a name.

        Args:
          name: of the thing.
          others: what is accepted besides names, in words, for the message.

        Raises:
          FgMujocoError: an error of this registry's class; the name is not known, or two packages register it, or what
            it stands for cannot be imported.
        """
        if name in self._own:
            thing = self._own[name]
            if isinstance(thing, str):
                found: T = imported(thing, f"{self.kind} {name!r}", self.error)
                self._own[name] = thing = found
            return thing
        point = self.entry_point(name, others)
        origin = f"{self.kind} {name!r} of {package_of(point)}, {point.value}"
        try:
            loaded: T = point.load()
        except Exception as error:
            said = " ".join(f"{type(error).__name__}: {error}".split())
            raise self.error(f"{origin}: {said}") from error
        if not isinstance(loaded, self._class):
            raise self.error(f"{origin} is a {type(loaded).__name__}; accepted: a {self._class.__name__}")
        return loaded

    def entry_point(self, name: str, others: str = "") -> EntryPoint:
        """Return the entry point by which another package registers a name; arguments and errors as those of `find`."""
        points = self.entry_points(name)
        if not points:
            are = "are" if self.kind.endswith("s") else "is"
            raise self.error(f"{self.kind} {name!r} {are} not known; {accepted_names(name, self.names(), others)}")
        if len({point.value for point in points}) > 1:
            packages = " and ".join(sorted(map(package_of, points)))
            raise self.error(
                f"{self.kind} {name!r} is registered by {packages}; accepted: a name that one package registers"
            )
        return points[0]


def package_of(point: EntryPoint) -> str:
    """Return the name and the version of the package that registers an entry point; of an unnamed one its text."""
    return point.value if point.dist is None else f"{point.dist.name} {point.dist.version}"
