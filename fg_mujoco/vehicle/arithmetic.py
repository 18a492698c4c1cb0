"""Arithmetic of kernels that numba does not make fast code of by itself.

    add_scaled_4(numbers, to, of, factor)  # numbers[to : to + 4] += factor * numbers[of : of + 4]
    if unlikely(size > 1.0):

The bits of a sum are those of a loop: each product is rounded, then each sum. Indices are not checked. What follows
`unlikely` is not worked out beforehand, which the compiler else does even with divisions and square roots.
"""

from __future__ import annotations

from typing import Any

from ..compiled.kernels import numbas


def _add_scaled(lanes: int) -> Any:
    """Return a function that adds to `lanes` numbers of an array others of it, times a factor."""

    def made() -> Any:
        from llvmlite.ir import Constant, DoubleType, IntType, VectorType
        from numba.core import types
        from numba.extending import intrinsic
        from numba.np.arrayobj import make_array

        vector, number = VectorType(DoubleType(), lanes), IntType(32)

        def add(context: Any, numbers: Any, to: Any, of: Any, factor: Any) -> Any:
            def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
                data = make_array(signature.args[0])(context, builder, given[0]).data
                places = [builder.bitcast(builder.gep(data, [index]), vector.as_pointer()) for index in given[1:3]]
                before, other = (builder.load(place, align=8) for place in places)
                one = builder.insert_element(Constant(vector, None), given[3], Constant(number, 0))
                factors = builder.shuffle_vector(one, one, Constant(VectorType(number, lanes), None))
                builder.store(builder.fadd(before, builder.fmul(factors, other)), places[0], align=8)
                return context.get_dummy_value()

            return types.none(numbers, types.int64, types.int64, types.float64), generate

        return intrinsic(add)

    def in_python(numbers: Any, to: int, of: int, factor: float) -> None:
        numbers[to : to + lanes] += factor * numbers[of : of + lanes]

    return numbas(in_python)(made)


add_scaled_4 = _add_scaled(4)
add_scaled_16 = _add_scaled(16)


@numbas(bool)
def unlikely() -> Any:
    """Return a function that returns its argument, a condition, and tells the compiler that it is seldom true."""
    from llvmlite.ir import Constant, FunctionType, IntType
    from numba.core import types
    from numba.extending import intrinsic

    def unlikely(context: Any, condition: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            bit = IntType(1)
            expect = builder.module.declare_intrinsic("llvm.expect", [bit], FunctionType(bit, [bit, bit]))
            return builder.call(expect, [given[0], Constant(bit, 0)])

        return types.boolean(types.boolean), generate

    return intrinsic(unlikely)
