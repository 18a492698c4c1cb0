"""Compiled functions: loops over beams, tires and worlds, written in Python and compiled by numba.

    @kernel
    def nearest(ranges): ...

A kernel runs without the GIL and never reorders arithmetic (no fastmath), so that it gives the same bits for one world
and for a thousand, in any thread. Compiled kernels are kept on disk, a file for each kernel and signature
(`kernel_files`). A kernel that is there is loaded without numba (`machine_code`); numba is imported once one has to be
compiled (`compiling`).
"""

from __future__ import annotations

import contextlib
import inspect
import os
import pickle
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from types import MethodType
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar, cast

from . import interpreted
from .kernel_files import cache_folder, package_files, read_kept
from .kernel_keys import kernel_file
from .machine_code import INLINED, LOADING, Kind, each_kind, kind_of, kinds, machine, omitted, text_of

if TYPE_CHECKING:
    from .compiling import Dispatcher

__all__ = ["CompileTime", "cache_folder", "call_at", "inlined", "kernel", "package_files"]

_F = TypeVar("_F", bound=Callable[..., Any])

_EVENTS = (LOADING, "numba:compile")
_lock = threading.RLock()


def kernel(function: _F) -> _F:
    """Compile a function of numbers and arrays, at its first call; division by zero gives inf or NaN, as in numpy."""
    return cast(_F, interpreted.interpreted(function) if _interpreted() else _Kernel(function))


def inlined(function: _F) -> _F:
    """Write a function out wherever kernels call it, for what is called in their inner loops."""
    return cast(_F, interpreted.interpreted(function) if _interpreted() else _Inlined(function))


def c_function(function: Any, *arguments: str) -> Any:
    """Return what gives kernels the address of a function in C that calls a kernel, for libraries that call back.

    Args:
      function: the kernel, which returns nothing.
      arguments: names of numba's types of its arguments: integers, of the size that the library passes.
    """

    def made() -> Any:
        from .compiling import address_in_c

        return address_in_c(function, arguments)

    return interpreted.in_c(function, arguments) if _interpreted() else _Numbas(made)


def library_function(library: str, name: str, result: str, *arguments: str) -> Any:
    """Return a function of a library of C as kernels call it.

    Args:
      library: its file; compiled kernels find the function in any library that the process has loaded.
      name: of the function.
      result: name of numba's type of what it returns, or void.
      arguments: names of numba's types of its arguments.
    """

    def made() -> Any:
        from numba import types

        return types.ExternalFunction(name, getattr(types, result)(*(getattr(types, kind) for kind in arguments)))

    return interpreted.of_library(library, name, result, arguments) if _interpreted() else _Numbas(made)


def numbas(in_python: Any) -> Callable[[Callable[[], Any]], Any]:
    """Decorate a function that returns something of numba's, which is called once a kernel that uses it is compiled.

    Args:
      in_python: what stands for it where Python runs kernels.
    """
    return lambda make: in_python if _interpreted() else _Numbas(make)


def _interpreted() -> bool:
    """Return whether the user wants Python to run kernels, to step through them: see `interpreted`."""
    if "numba" in sys.modules:
        return bool(sys.modules["numba"].config.DISABLE_JIT)
    return os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")


class _Kernel:
    """A kernel as Python calls it. Kernels that call it, and whoever asks for more, get numba's dispatcher of it."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.py_func = self.__wrapped__ = function
        self.__module__, self.__doc__ = function.__module__, function.__doc__
        self.__name__, self.__qualname__ = function.__name__, function.__qualname__
        self._last: tuple[list[Kind] | None, Callable[..., Any]] = [], self._call
        self._loaded: dict[str, Callable[..., Any]] = {}
        self._addresses: dict[str, int] = {}
        self._dispatcher: Dispatcher | None = None

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        last, compiled = self._last  # most calls have arguments of the same kinds as the one before
        if not named and each_kind(arguments) == last:
            return compiled(*arguments)
        return self._call(*arguments, **named)

    def _call(self, *arguments: Any, **named: Any) -> Any:
        """Call what has been compiled for such arguments: loaded from disk, or by numba."""
        if self._dispatcher is None or self._loaded:
            given, found = self._whole(arguments, named)
            text = text_of(found)
            compiled = None if text is None else self._loaded.get(text) or self._load(text)
            if compiled is not None:
                if given is arguments:
                    self._last = found, compiled
                return compiled(*given)
        with _timed() if self._dispatcher is None else contextlib.nullcontext():  # numba is imported, too
            dispatcher = self.dispatcher
        answer = dispatcher(*arguments, **named)
        if not named:
            self._last = kinds(arguments), dispatcher
        return answer

    def _whole(self, arguments: tuple[Any, ...], named: dict[str, Any]) -> tuple[Sequence[Any], list[Kind] | None]:
        """Return all arguments of a call in their order, with those that are not given, and their kinds."""
        code = self.py_func.__code__
        if not named and len(arguments) == code.co_argcount:
            return arguments, kinds(arguments)
        try:
            bound = inspect.signature(self.py_func).bind(*arguments, **named)
        except TypeError:  # numba refuses it
            return arguments, None
        if code.co_flags & inspect.CO_VARARGS:
            return arguments, None
        given = set(bound.arguments)
        bound.apply_defaults()
        found = [kind_of(value) if name in given else omitted(value) for name, value in bound.arguments.items()]
        if bound.kwargs or len(bound.args) != len(found) or None in found:
            return arguments, None
        return bound.args, cast(list[Kind], found)

    def _load(self, text: str) -> Callable[..., Any] | None:
        """Return what is kept on disk for arguments of these kinds; None where there is nothing, or it is damaged."""
        with _lock, _timed():
            if text not in self._loaded:
                with contextlib.suppress(Exception):  # whatever is wrong with it, numba helps
                    code, _ = read_kept(kernel_file(self.py_func, text, machine()))
                    self._loaded[text], self._addresses[text] = code.load(self.py_func)
            return self._loaded.get(text)

    def address(self, *arguments: Any) -> int:
        """Return the address of the machine code for such arguments, which `call_at` calls; it is compiled if need be.

        The code is there as long as the kernel is.

        Args:
          arguments: all that the kernel takes.
        """
        text = text_of(kinds(arguments))
        if text is not None and (self._dispatcher is None or text in self._loaded):
            self._load(text)
        if text not in self._addresses:
            with _timed() if self._dispatcher is None else contextlib.nullcontext():
                return self.dispatcher.address(*arguments)
        return self._addresses[text]

    @property
    def dispatcher(self) -> Dispatcher:
        """Numba's dispatcher of this kernel, which compiles it."""
        if self._dispatcher is None:
            from numba.core.compiler_lock import global_compiler_lock

            from .compiling import Dispatcher

            with global_compiler_lock:
                if self._dispatcher is None:
                    self._dispatcher = Dispatcher(self.py_func, tuple(self._loaded))
        return self._dispatcher

    @property
    def _numba_type_(self) -> Any:
        return self.dispatcher._numba_type_

    @property
    def signatures(self) -> list[Any]:
        """Signatures for which it has been compiled or loaded."""
        return [*self._loaded, *(() if self._dispatcher is None else self._dispatcher.signatures)]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name in ("_dispatcher", "_loaded", "_last", "py_func"):
            raise AttributeError(name)
        return getattr(self.dispatcher, name)

    def __get__(self, instance: Any, owner: Any = None) -> Any:
        return self if instance is None else MethodType(self, instance)

    def __reduce__(self) -> str | tuple[Any, ...]:
        if self.__module__.startswith("fg_mujoco.") and "<locals>" not in self.__qualname__:
            return self.__qualname__  # found there again
        from numba.core.serialize import dumps  # pickles what a function does

        return _unpickled, (dumps(self.py_func),)

    def __repr__(self) -> str:
        return f"<kernel {self.__module__}.{self.__qualname__}>"


def _unpickled(function: bytes) -> Any:
    return kernel(pickle.loads(function))


class _Inlined:
    """A function that numba writes out where it is called.

    Attributes:
      targetoptions: what numba looks at there.
    """

    targetoptions: ClassVar[dict[str, Any]] = INLINED

    def __init__(self, function: Callable[..., Any]) -> None:
        self.py_func = self.__wrapped__ = function
        self.__module__, self.__doc__ = function.__module__, function.__doc__
        self.__name__, self.__qualname__ = function.__name__, function.__qualname__

    def __call__(self, *arguments: Any) -> Any:
        return self._dispatcher(*arguments)

    @cached_property
    def _dispatcher(self) -> Any:
        from .compiling import inlined_dispatcher

        return inlined_dispatcher(self.py_func)

    @property
    def signatures(self) -> list[Any]:
        """Signatures for which it has been compiled, called from Python."""
        return list(self._dispatcher.signatures)

    @property
    def _numba_type_(self) -> Any:
        return self._dispatcher._numba_type_


class _Numbas:
    """Something of numba's that kernels use, made once one is compiled.

    Attributes:
      made_by: the function that returns it.
    """

    def __init__(self, make: Callable[[], Any]) -> None:
        self.made_by = make

    @cached_property
    def _numba_type_(self) -> Any:
        from .compiling import type_in_kernels

        return type_in_kernels(self.made_by())


@numbas(interpreted.call_at)
def call_at() -> Any:
    """Return what calls the code of a kernel of one whole number: `call_at(kernel.address(0), number)`, in kernels."""
    from .compiling import call_at_address

    return call_at_address()


class CompileTime:
    """Measures for how long this thread compiles kernels, or anything else by numba, or loads kernels from disk.

        with CompileTime() as compile_time:
            ...
        compile_time.seconds

    Attributes:
      running: whether it does so now.
    """

    def __init__(self) -> None:
        self.running = False
        self._depth, self._done, self._began = 0, 0.0, 0.0
        self._thread = threading.get_ident()
        self._heard: Any = None  # numba's module of events, once this hears them

    def __enter__(self) -> CompileTime:
        _measuring.append(self)
        self._listen()
        return self

    def __exit__(self, *exception: object) -> None:
        _measuring.remove(self)
        for kind in _EVENTS if self._heard is not None else ():
            self._heard.unregister(kind, self)
        self._heard = None

    def _listen(self) -> None:
        """Hear what numba compiles, once it has been imported."""
        if self._heard is None and self in _measuring and "numba.core.event" in sys.modules:
            from numba.core import event

            event.Listener.register(CompileTime)
            for kind in _EVENTS:
                event.register(kind, self)
            self._heard = event

    def notify(self, event: Any) -> None:
        """Hear that numba begins to compile something, or has ended."""
        (self.begin if event.is_start else self.end)()

    @property
    def seconds(self) -> float:
        """Time taken up to now [s]."""
        self._listen()
        return self._done + (time.perf_counter() - self._began if self.running else 0.0)

    def begin(self) -> None:
        """Note that something begins to be compiled; kernels compile each other."""
        if threading.get_ident() == self._thread:
            if self._depth == 0:
                self._began, self.running = time.perf_counter(), True
            self._depth += 1

    def end(self) -> None:
        """Note that it is compiled, or that compiling it failed."""
        if threading.get_ident() == self._thread:
            self._depth -= 1
            if self._depth == 0:
                self._done += time.perf_counter() - self._began
                self.running = False


_measuring: list[CompileTime] = []


@contextlib.contextmanager
def _timed() -> Iterator[None]:
    """Let whoever measures know that kernels are loaded, or compiled."""
    measuring = tuple(_measuring)
    for each in measuring:
        each.begin()
    try:
        yield
    finally:
        for each in measuring:
            each.end()
