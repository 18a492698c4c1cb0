"""Compiles kernels by numba, or loads what numba needs of them from disk: for calls that no machine code is kept for.

Importing this imports numba, which takes a while; `kernels` does so once a kernel is called that has to be compiled.
"""

from __future__ import annotations

import contextlib
import gc
import itertools
import os
import pickle
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any
from weakref import WeakSet

import numba
from llvmlite.binding import parse_bitcode
from llvmlite.ir import Function, FunctionType, IRBuilder, VoidType
from numba.core import cgutils, errors, event, types
from numba.core.bytecode import FunctionIdentity
from numba.core.caching import NullCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompilerBase, CompileResult, DefaultPassBuilder, compile_result
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import OmittedArg
from numba.core.errors import ForceLiteralArg
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.serialize import dumps
from numba.core.sigutils import normalize_signature
from numba.core.types.containers import BaseTuple
from numba.core.types.functions import BaseFunction
from numba.core.types.misc import unliteral
from numba.core.typing.templates import _OverloadFunctionTemplate
from numba.extending import intrinsic, overload
from numba.np import arrayobj

from .beside import begin
from .kernel_files import compile_line, made_once, read_kept, write_kept
from .kernel_keys import kernel_file
from .machine_code import INLINED, LOADING, OPTIONS, MachineCode, kinds, machine, omitted, text_of

_LARGEST_PART = 200_000  # [bytes] of bitcode: a larger part holds most of the one kernel that calls it
_functions: WeakSet[Callable[..., Any]] = WeakSet()  # of which kernels are made


def _number_apart() -> None:
    """Number the functions that are compiled from a random number on.

    Code is linked by names, which have the function's number where all else is the same, as of functions that one
    function makes. Numba counts from 1 in each process: two processes gave two such functions one name, and a kernel
    that was linked with both, from disk, called one of them in the place of the other.
    """
    FunctionIdentity._unique_ids = itertools.count(int.from_bytes(os.urandom(7), "little"))


_number_apart()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_number_apart)


def inlined_dispatcher(function: Callable[..., Any]) -> Any:
    """Return numba's own dispatcher of a function that is written out wherever kernels call it."""
    return numba.njit(**INLINED)(function)


def type_in_kernels(value: Any) -> Any:
    """Return numba's type of something of its own that kernels use."""
    typing, target = cpu_target.typing_context, cpu_target.target_context
    typing.refresh()  # it may have been made just now
    target.refresh()
    return typing.resolve_value_type(value)


def address_in_c(function: Any, arguments: tuple[str, ...]) -> Any:
    """Return what gives kernels the address of a function in C that calls a kernel, see `kernels.c_function`."""
    kinds_of = tuple(getattr(types, name) for name in arguments)

    def address(typing: Any) -> Any:
        kind = typing.resolve_value_type(function)
        kind.get_call_type(typing, kinds_of, {})

        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            compiled = kind.dispatcher.overloads[kinds_of]
            context.active_code_library.add_linking_library(compiled.library)
            values = [context.get_value_type(argument) for argument in kinds_of]
            name = f"{compiled.fndesc.mangled_name}.in_c"
            made = Function(builder.module, FunctionType(VoidType(), values), name)
            made.linkage = "internal"
            inside = IRBuilder(made.append_basic_block())
            called = context.declare_function(builder.module, compiled.fndesc)
            context.call_conv.call_function(inside, called, types.none, kinds_of, list(made.args))
            inside.ret_void()
            return builder.ptrtoint(made, context.get_value_type(types.int64))

        return types.int64(), generate

    return intrinsic(address)


def call_at_address() -> Any:
    """Return what calls the code of a kernel of one whole number at an address, and raises what it raises."""

    def call_at(typing: Any, address: Any, argument: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            convention, number = context.call_conv, types.int64
            kind = convention.get_function_type(types.none, (number,))
            function = builder.inttoptr(given[0], kind.as_pointer())
            status, _ = convention.call_function(builder, function, types.none, (number,), [given[1]])
            with cgutils.if_unlikely(builder, status.is_error):
                convention.return_status_propagate(builder, status)
            return context.get_dummy_value()

        return types.none(types.int64, types.int64), generate

    return intrinsic(call_at)


class Dispatcher(CPUDispatcher):  # type: ignore[misc]
    """Numba's dispatcher of a kernel, for Python and functions of others that numba compiles. Kernels call its `_Part`.

    Args:
      function: what the kernel does.
      loaded: for what it has been loaded without numba.
    """

    def __init__(
        self, function: Any, loaded: Iterable[str] = (), options: Any = None, pipeline: Any = Compiler
    ) -> None:
        given = {"nopython": True, "boundscheck": None, **OPTIONS} if options is None else options
        super().__init__(function, None, given, pipeline)
        self._cache = _KernelCache(function)
        self._part: _Part | None = None
        _functions.add(function)
        for text in loaded:  # numba calls the same code for other numbers that it can convert
            self._load(text)

    def _load(self, text: str) -> None:
        """Let numba know what has been loaded without it."""
        with contextlib.suppress(Exception), global_compiler_lock:
            kept = read_kept(kernel_file(self.py_func, text, machine()))
            compiled = self._cache.unpacked(pickle.loads(kept[1]), self.targetctx)
            self.targetctx.insert_user_function(compiled.entry_point, compiled.fndesc, [compiled.library])
            self.add_overload(compiled)

    def address(self, *args: Any) -> int:
        """Return the address of the machine code for arguments, see `kernels`."""
        signature = tuple(map(self.typeof_pyval, args))
        text = text_of(kinds(args))
        if text is not None:
            self._cache.texts[signature] = text
        self.compile(signature)
        compiled = self.overloads[signature]
        found: int = compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name)
        return found

    def _compile_for_args(self, *args: Any, **kws: Any) -> Any:
        """Compile for arguments, and keep it under their kinds."""
        found = kinds([None if isinstance(argument, OmittedArg) else argument for argument in args])
        if found is not None and not kws:
            given = [
                omitted(argument.value) if isinstance(argument, OmittedArg) else kind
                for argument, kind in zip(args, found, strict=True)
            ]
            text = None if None in given else text_of(given)  # type: ignore[arg-type]
            if text is not None:
                with contextlib.suppress(Exception):  # numba says why
                    self._cache.texts[tuple(map(self.typeof_pyval, args))] = text
        return super()._compile_for_args(*args, **kws)

    @property
    def _numba_type_(self) -> Any:
        with global_compiler_lock:
            compiling = [frame.func_id.func for frame in self.typingctx.callstack._stack]
            by_another = not compiling or compiling[-1] not in _functions
            if by_another or (self._compiling_counter and self.py_func in compiling):  # the second: it calls itself
                return self._type
            if self._part is None:
                self._part = _Part(self.py_func, None, dict(self.targetoptions))
                self._part.kernel = self
            return self._part._type

    def compile(self, signature: Any) -> Any:
        """Compile for a signature, or load from disk, and return what Python is to call."""
        made_once = self._cache.made_once(signature, self.targetctx)
        with event.trigger_event(LOADING), made_once, compile_line.cleared():
            return self._made(signature)  # timed until all that was made for it is collected, which may take a second

    def _made(self, signature: Any) -> Any:
        collecting = gc.isenabled()
        gc.disable()  # most of what is made here stays: to look through it again and again would take a second
        try:
            with _in_less_time():
                return _with_room(partial(super().compile, signature))
        finally:
            if collecting:
                gc.enable()
                gc.collect(0)  # now, and not while the kernel runs

    def add_overload(self, compiled: Any) -> None:
        """Let Python call what was compiled or loaded for a signature."""
        environments = compiled.referenced_envs or tuple(compiled._find_referenced_environments())
        for environment in environments:  # its parts' own: `raise` and `print` take their values from there
            compiled.codegen.set_env(environment.env_name, environment)
        super().add_overload(compiled._replace(referenced_envs=environments))


def _with_room(function: Callable[[], Any]) -> Any:
    """Call a function, with room for the frames of all that it calls: see below."""
    return function()


# CPython keeps frames in chunks of 16 KiB, which it takes from the system and gives back again at each call that is the
# first in one. Compiling calls so much so deep that this alone costs two seconds. A frame that is made out to be large
# gets a chunk of 1 MiB, and shares it with the frames above it.
_with_room.__code__ = _with_room.__code__.replace(co_stacksize=70_000)


@contextlib.contextmanager
def _in_less_time() -> Iterator[None]:
    """Let numba do what it does for nothing once, or not at all, while it compiles a kernel.

    It looks up again what a function of its own returns for arguments of the same types, in each function that calls
    it; marks up, in bold, messages that are thrown away; and compiles a formatter of shapes wherever an array is
    assigned to a part of another one, for the message of an error. And it makes machine code of each function of its
    own, which is not called: it is linked into each kernel, as kernels' parts are.
    """
    with global_compiler_lock:
        changes: tuple[tuple[Any, str, Any], ...] = (
            (BaseFunction, "get_call_type", _call_type),
            (getattr(errors, "HighlightColorScheme", _Coloured), "_markup", _unmarked),
            (arrayobj, "raise_with_shape_context", _refuse_shapes),
            (_OverloadFunctionTemplate, "_get_jit_decorator", lambda template: _numbas_part),
        )
        before = [getattr(place, name, None) for place, name, _ in changes]
        for place, name, value in changes:
            setattr(place, name, value)
        try:
            yield
        finally:
            for (place, name, _), value in zip(changes, before, strict=True):
                setattr(place, name, value)


class _Coloured:
    """In the place of numba's colours, which it has where colorama is installed."""


def _unmarked(scheme: Any, message: str, *style: Any) -> str:
    """Return a message as it is: without colours, and not in bold."""
    return message


def _refuse_shapes(source: Any, target: Any) -> None:
    """Refuse to assign an array to a part of another one that has another shape."""


@overload(_refuse_shapes)  # type: ignore[untyped-decorator]
def _of_refusal(source: Any, target: Any) -> Any:
    def refuse(source: Any, target: Any) -> None:
        raise ValueError("cannot assign slice from input of different size")

    return refuse


_look_up = BaseFunction.get_call_type
_looked_up: dict[tuple[Any, ...], Any] = {}


def _call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
    """Return the signature of a call of one of numba's own functions, looked up once."""
    key = self, context, tuple(args), tuple(kws.items())
    found = _looked_up.get(key)
    if found is None:
        found = _looked_up[key] = _look_up(self, context, args, kws)
    return found


@contextlib.contextmanager
def _blas_unseen() -> Iterator[None]:
    """Let numba load its parts without SciPy, which it imports only to see that it is there.

    That takes as long as all the rest. Functions of linear algebra still look for it when they are compiled.
    """
    import numba.np.linalg as linalg

    seen, linalg.ensure_blas = linalg.ensure_blas, lambda: None
    try:
        yield
    finally:
        linalg.ensure_blas = seen


def _calls_in_turn(library: Any) -> bool:
    """Return whether functions in there call each other in turn: that is done by addresses."""
    prefix = library.codegen._rtlinker.PREFIX
    return any(variable.name.startswith(prefix) for variable in library._final_module.global_variables)


def _any_of(found: Iterable[Any]) -> tuple[Any, ...]:
    """Return types, with any number or truth value in the place of a constant."""
    constants = types.IntegerLiteral, types.BooleanLiteral
    return tuple(unliteral(each) if isinstance(each, constants) else each for each in found)


class _Part(CPUDispatcher):  # type: ignore[misc]
    """A kernel as other kernels call it: linked into each of them.

    Nothing is optimised here, no machine code is made, nor what Python would need to call it, which together take as
    long as all else.
    """

    def __init__(self, function: Any, variables: Any = None, options: Any = None, pipeline: Any = None) -> None:
        super().__init__(function, variables, options, pipeline or _PartCompiler)
        self._cache = _PartCache(function)
        self.kernel: Any = None  # a Dispatcher

    def add_overload(self, compiled: Any) -> None:
        """Let other kernels find what was compiled for a signature."""
        args = tuple(compiled.signature.args)
        if self.kernel is not None and _calls_in_turn(compiled.library):  # which takes machine code of its own
            self.kernel.compile(args)
            compiled = self.kernel.overloads[args]
        else:
            compiled = compiled._replace(entry_point=object())  # a name for it: there is no entry point
            self.targetctx.insert_user_function(compiled.entry_point, compiled.fndesc, [compiled.library])
        self.overloads[args] = compiled

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Return what a call gives, compiled once for all whole numbers and truth values, unless it needs to know them.

        Numba compiles a function once more for each constant that it is called with, to the same machine code.
        """
        try:
            return super().get_call_template(_any_of(args), dict(zip(kws, _any_of(kws.values()), strict=True)))
        except (ForceLiteralArg, errors.TypingError):
            return super().get_call_template(args, kws)

    def compile(self, signature: Any) -> None:
        """Compile for a signature, as numba's dispatchers do, but without timers of every call of LLVM."""
        args, return_type = normalize_signature(signature)
        with global_compiler_lock, self._compiling_counter:
            if tuple(args) in self.overloads:
                return
            compiled = self._cache.load_overload(signature, self.targetctx)
            if compiled is not None:
                self.add_overload(compiled)
                return
            details = {"dispatcher": self, "args": args, "return_type": return_type}
            with event.trigger_event("numba:compile", details):
                try:
                    compiled = self._compiler.compile(args, return_type)
                except ForceLiteralArg as error:  # it says which arguments have to be constants
                    fold = self._compiler.fold_argument_types
                    raise error.bind_fold_arguments(lambda *given: fold(*given)[1]) from None
                self.add_overload(compiled)
            self._cache.save_overload(signature, compiled)


class _NumbasPart(_Part):
    """A function of numba's own as kernels call it."""

    get_call_template = CPUDispatcher.get_call_template  # what it does may depend on constants

    def __init__(self, function: Any, options: Any) -> None:
        super().__init__(function, None, {"boundscheck": None, **options})
        self._cache = NullCache()

    def add_overload(self, compiled: Any) -> None:
        """Let kernels find what was compiled for a signature."""
        if self.kernel is None and _calls_in_turn(compiled.library):
            self.kernel = CPUDispatcher(self.py_func, None, self.targetoptions)
        super().add_overload(compiled)


def _numbas_part(**options: Any) -> Callable[[Any], Any]:
    """Return what makes of a function of numba's own what kernels call: a decorator, as numba's `jit`."""
    if options.keys() - {"nopython", "no_cpython_wrapper"}:
        return numba.jit(**options)  # type: ignore[no-any-return]
    return lambda function: _NumbasPart(function, options)


class _PartCompiler(CompilerBase):  # type: ignore[misc]
    """Numba's passes for one kernel, up to LLVM's code that can be linked into another."""

    def define_pipelines(self) -> list[Any]:
        """Return the passes."""
        state = self.state
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = state.flags.no_cpython_wrapper = True
        return [DefaultPassBuilder.define_nopython_pipeline(state)]


class _PartLibrary(JITCodeLibrary):  # type: ignore[misc]
    """LLVM's code of one kernel, for linking alone."""

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout
        for function in module.functions:
            if not function.is_declaration:  # most are, and numba takes its time for each
                passes, builder = self._codegen._function_pass_manager()
                passes.run(function, builder)

    def _optimize_final_module(self) -> None:
        """Leave it to the kernel that Python calls, in which all its parts are optimised together."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


def _text_of(signature: Any) -> str:
    """Return a text for types, equal only where they are: numba's own leaves out the fields of named tuples."""
    texts, waiting = [str(signature)], list(getattr(signature, "args", signature))
    while waiting:
        kind = waiting.pop(0)
        named = getattr(kind, "instance_class", None)
        if named is not None:
            texts.append(f"{named.__module__}.{named.__qualname__}{getattr(named, '_fields', '')}")
        waiting += kind.types if isinstance(kind, BaseTuple) else ()
    return " ".join(texts)


class _KernelCache(NullCache):  # type: ignore[misc]
    """The files of one kernel, in the place of numba's own cache (numba.core.caching._Cache).

    A file that is missing, damaged or unreadable is compiled anew, and where none can be written, none is.

    Attributes:
      texts: of the kinds of arguments, by signature: what a file is found by without numba.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self.texts: dict[tuple[Any, ...], str] = {}

    @contextlib.contextmanager
    def made_once(self, signature: Any, target: Any) -> Iterator[None]:
        """Let other processes wait that compile the same at the same time."""
        with contextlib.ExitStack() as stack:
            with contextlib.suppress(Exception):  # a function without source, a signature that numba refuses
                stack.enter_context(made_once(self._file(signature, target.codegen())))
            yield

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Return what was compiled for a signature; None where it is not there, or damaged."""
        with contextlib.suppress(Exception):  # whatever is wrong with it, compiling helps
            kept = read_kept(self._file(signature, target.codegen()))
            if kept is not None:
                return self.unpacked(self._numbas(kept), target)
        if compile_line.name(self._function.__name__):
            begin()
        return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep what was compiled, unless it holds addresses of this process, or cannot be written."""
        of_this_process = compiled.lifted or compiled.library.has_dynamic_globals or _calls_in_turn(compiled.library)
        if of_this_process or any(isinstance(argument, types.Dispatcher) for argument in compiled.signature.args):
            return
        with contextlib.suppress(OSError, pickle.PicklingError, TypeError):
            file = self._file(signature, compiled.library.codegen)
            write_kept(file, self._kept(compiled))

    def unpacked(self, packed: Any, target: Any) -> Any:
        """Return what was compiled, as numba calls it."""
        with _blas_unseen():
            target.refresh()
        return self._unpack(target, packed)

    def _kept(self, compiled: Any) -> bytes:
        """Return what is kept in a file, pickled: what Python calls, and what numba needs, pickled once more."""
        code, packed = MachineCode.of(compiled), dumps(compiled._reduce())
        try:
            return pickle.dumps((code, packed))
        except Exception:  # a constant of the code that only numba can pickle
            return pickle.dumps((None, packed))

    def _numbas(self, kept: Any) -> Any:
        """Return what numba needs of what is kept."""
        return pickle.loads(kept[1])

    def _unpack(self, target: Any, packed: Any) -> Any:
        return CompileResult._rebuild(target, *packed)

    def _file(self, signature: Any, codegen: Any) -> Path:
        """Return the file of a signature.

        Raises:
          OSError: the function has no source.
        """
        text = self.texts.get(tuple(signature)) if isinstance(signature, (tuple, list)) else None
        if text is not None:
            return kernel_file(self._function, text, machine())
        return kernel_file(self._function, type(self).__name__, machine(), codegen.magic_tuple(), _text_of(signature))


class _PartCache(_KernelCache):
    """The files of one kernel as other kernels call it."""

    def _kept(self, compiled: Any) -> bytes:
        bitcode = compiled.library._get_module_for_linking().as_bitcode()
        if len(bitcode) > _LARGEST_PART:
            raise OSError(f"{compiled.fndesc.qualname} is not worth keeping")
        compiled.fndesc.typemap = compiled.fndesc.calltypes = None
        environments = tuple(compiled._find_referenced_environments())
        kept = compiled.library.name, bitcode, compiled.fndesc, compiled.environment, compiled.signature, environments
        return bytes(dumps(kept))

    def _numbas(self, kept: Any) -> Any:
        return kept

    def _unpack(self, target: Any, packed: Any) -> Any:
        name, bitcode, fndesc, environment, signature, environments = packed
        library = _PartLibrary(target.codegen(), name)
        library._final_module = parse_bitcode(bitcode)
        library._finalized = True
        return compile_result(
            target_context=target, typing_context=target.typing_context, library=library, fndesc=fndesc,
            environment=environment, signature=signature, referenced_envs=environments, objectmode=False, lifted=(),
            reload_init=(),
        )  # fmt: skip
