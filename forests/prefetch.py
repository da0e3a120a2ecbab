"""Ask for memory before it is needed, which numba has no function for."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


def _prefetch(context: Any, array: types.Array, index: types.Integer) -> Any:
    """Bring the beginning and the end of row `index` of a C-contiguous matrix into the cache."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        matrix = context.make_array(signature.args[0])(context, builder, arguments[0])
        byte, word = ir.IntType(8).as_pointer(), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [byte, word, word, word])
        function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        stride = builder.extract_value(matrix.strides, 0)
        first = builder.bitcast(matrix.data, byte)
        row = builder.gep(first, [builder.mul(stride, arguments[1])])
        end = builder.sub(stride, ir.Constant(stride.type, 1))
        # To read, of use again, data.
        options = [word(0), word(3), word(1)]
        for address in (row, builder.gep(row, [end])):
            builder.call(function, [address, *options])
        return context.get_dummy_value()

    return types.void(array, types.int64), generate


prefetch: Any = intrinsic(_prefetch)
