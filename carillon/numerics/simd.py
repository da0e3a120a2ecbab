"""Numbers side by side: a numba type for a vector of `LANES` doubles, and tiles of such.

Problems that take the same steps do each for `LANES` of them by one machine instruction. Arrays of
lanes are (entries, `LANES`), one row per number of a problem. Inside compiled functions a `Lanes`
value adds and multiplies like a float; a tile is a small matrix of them that stays in registers.
How many lanes there are is the processor's, see `carillon.numerics.simd_width`; what a lane
computes does not depend on it.
"""

import hashlib
import operator
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic as numba_intrinsic
from numba.extending import models, overload, register_model
from numpy.typing import NDArray

from carillon.numerics.simd_width import LANES, REGISTERS

BYTES = 8 * LANES

_NUMBER = ir.DoubleType()
_VECTOR = ir.VectorType(_NUMBER, LANES)
_INDEX = ir.IntType(64)


def compiler(*sources: Path) -> Callable[[Callable[..., Any]], Any]:
    """Compile with numba and cache the result under a name that changes with the `sources`.

    They are the files of all functions of lanes that call each other: numba's cache notices a
    change of the function's own file, not of the files it calls, nor of the width.

    Never compile closures: code from the cache is linked by the function's name and the types of
    its arguments, and one closure would be taken for another that a second process compiled.
    """
    digest = digest_of(*sources)

    def compiled(function: Callable[..., Any]) -> Any:
        function.__qualname__ += f"_{digest}"
        return njit(cache=True, nogil=True)(function)

    return compiled


def digest_of(*sources: Path) -> str:
    """Digest of files, of this one, and of the registers."""
    digest = hashlib.sha256(f"{REGISTERS}".encode())
    for path in (Path(__file__), *sources):
        digest.update(path.read_bytes() if path.exists() else b"")
    return digest.hexdigest()[:12]


class LanesType(types.Type):
    """`LANES` doubles."""

    def __init__(self) -> None:
        super().__init__(name="Lanes")


class TileType(types.Type):
    """Small matrix of lanes."""

    def __init__(self, rows: int, columns: int) -> None:
        super().__init__(name=f"Tile({rows}, {columns})")
        self.rows, self.columns = rows, columns


LANES_TYPE = LanesType()
intrinsic: Any = numba_intrinsic
Vector = Any
"""Name of a `LanesType` value in compiled functions."""


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: LanesType) -> None:
        super().__init__(manager, kind, _VECTOR)


@register_model(TileType)
class _TileModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: TileType) -> None:
        super().__init__(manager, kind, ir.ArrayType(_VECTOR, kind.rows * kind.columns))


# What follows emits LLVM instructions. `builder` appends them to the function being compiled.


def _splat(builder: Any, scalar: Any) -> Any:
    undefined = ir.Constant(_VECTOR, ir.Undefined)
    single = builder.insert_element(undefined, scalar, ir.Constant(ir.IntType(32), 0))
    everywhere = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(single, undefined, everywhere)


def _address(context: Any, builder: Any, kind: types.Array, array: Any, entry: Any) -> Any:
    data = context.make_array(kind)(context, builder, array).data
    if kind.ndim == 1:
        return builder.gep(data, [entry])
    # Rows of a `sliding` array follow each other by a number.
    start = builder.mul(entry, _INDEX(LANES)) if kind.layout == "C" else entry
    first = builder.gep(data, [start])
    return builder.bitcast(first, _VECTOR.as_pointer())


def _load(context: Any, builder: Any, kind: types.Array, array: Any, entry: Any) -> Any:
    """A row of an array of lanes, or a number of a flat array, in all lanes."""
    address = _address(context, builder, kind, array, entry)
    if kind.ndim == 1:
        number = builder.load(address)
        if kind.dtype == types.float32:
            number = builder.fpext(number, _NUMBER)
        return _splat(builder, number)
    return builder.load(address, align=8)


def _call(builder: Any, name: str, *arguments: Any) -> Any:
    kind = ir.FunctionType(_VECTOR, [_VECTOR] * len(arguments))
    function = cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{LANES}f64")
    return builder.call(function, arguments)


def _at(builder: Any, start: Any, *steps: tuple[Any, int]) -> Any:
    for stride, count in steps:
        start = builder.add(start, builder.mul(stride, _INDEX(count)))
    return start


@intrinsic
def load(context: Any, array: Any, entry: Any) -> Any:
    """Row `entry` of an array of lanes; of a flat array, that number in all lanes."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _load(context, builder, signature.args[0], *arguments)

    return LANES_TYPE(array, types.intp), emit


@intrinsic
def store(context: Any, array: Any, entry: Any, value: Any) -> Any:
    """Write row `entry` of an array of lanes."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, entry, value = arguments
        address = _address(context, builder, signature.args[0], array, entry)
        builder.store(value, address, align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, LANES_TYPE), emit


@intrinsic
def spread(context: Any, number: Any) -> Any:
    """The same number in all lanes."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _splat(builder, arguments[0])

    return LANES_TYPE(types.float64), emit


@intrinsic
def root(context: Any, value: Any) -> Any:
    """Square root, lane by lane."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _call(builder, "sqrt", arguments[0])

    return LANES_TYPE(LANES_TYPE), emit


@intrinsic
def where_less(context: Any, left: Any, right: Any, yes: Any, no: Any) -> Any:
    """`yes` in the lanes with left < right, `no` in the others."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        left, right, yes, no = arguments
        return builder.select(builder.fcmp_ordered("<", left, right), yes, no)

    return LANES_TYPE(*[LANES_TYPE] * 4), emit


@intrinsic
def larger(context: Any, left: Any, right: Any) -> Any:
    """The larger of two, lane by lane."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        left, right = arguments
        return builder.select(builder.fcmp_ordered("<", left, right), right, left)

    return LANES_TYPE(LANES_TYPE, LANES_TYPE), emit


def _operate(symbol: Any, instruction: str) -> None:
    """Let `symbol` act on lanes; a product and a sum may become one fused instruction."""

    @intrinsic
    def apply(context: Any, left: Any, right: Any) -> Any:
        def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return getattr(builder, instruction)(*arguments, flags=("contract",))

        return LANES_TYPE(LANES_TYPE, LANES_TYPE), emit

    def implementation(left: Any, right: Any) -> Any:
        return apply(left, right)

    implementation.__qualname__ += f"_{instruction}"  # unlike the other operators', see `compiler`

    @overload(symbol)
    def operate(left: Any, right: Any) -> Any:
        return implementation if left == right == LANES_TYPE else None


_operate(operator.add, "fadd")
_operate(operator.sub, "fsub")
_operate(operator.mul, "fmul")
_operate(operator.truediv, "fdiv")


@intrinsic(prefer_literal=True)
def zeros(context: Any, rows: Any, columns: Any) -> Any:
    """Tile of zeros; `rows` and `columns` are literal numbers."""
    tile = TileType(rows.literal_value, columns.literal_value)

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return context.get_constant_null(tile)

    return tile(rows, columns), emit


@intrinsic(prefer_literal=True)
def load_tile(context: Any, source: Any, rows: Any, columns: Any) -> Any:
    """Tile at `source`: (array, first entry, stride of rows, stride of columns)."""
    tile = TileType(rows.literal_value, columns.literal_value)

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, start, row, column = cgutils.unpack_tuple(builder, arguments[0])
        entries = [
            _load(context, builder, signature.args[0][0], array, entry)
            for entry in _entries(builder, tile, start, row, column)
        ]
        return cgutils.pack_array(builder, entries)

    return tile(types.unliteral(source), rows, columns), emit


@intrinsic
def store_tile(context: Any, target: Any, tile: Any) -> Any:
    """Write a tile at `target`: (array, first entry, stride of rows, stride of columns)."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, start, row, column = cgutils.unpack_tuple(builder, arguments[0])
        values = cgutils.unpack_tuple(builder, arguments[1])
        for entry, value in zip(_entries(builder, tile, start, row, column), values):
            address = _address(context, builder, signature.args[0][0], array, entry)
            builder.store(value, address, align=8)
        return context.get_dummy_value()

    return types.void(types.unliteral(target), tile), emit


@intrinsic
def scale_tile(context: Any, tile: Any, factor: Any) -> Any:
    """A tile times a number."""

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        factor = _splat(builder, arguments[1])
        values = cgutils.unpack_tuple(builder, arguments[0])
        return cgutils.pack_array(builder, [builder.fmul(value, factor) for value in values])

    return tile(tile, types.float64), emit


def _entries(builder: Any, tile: TileType, start: Any, row: Any, column: Any) -> list[Any]:
    places = [(i, j) for i in range(tile.rows) for j in range(tile.columns)]
    return [_at(builder, start, (row, i), (column, j)) for i, j in places]


def _vectors(emitting: Any, kind: Any, operand: Any, index: Any, count: int) -> list[Any]:
    """Entries of an operand (array, first, stride, stride of depth) at depth `index`."""
    at = cgutils.unpack_tuple(emitting[1], operand)
    return _entries_of(emitting, kind[0], at, index, count)


def _entries_of(emitting: Any, kind: Any, at: Any, index: Any, count: int) -> list[Any]:
    context, builder = emitting
    array, start, stride, depth = at
    start = builder.add(start, builder.mul(depth, index))
    entries = [_at(builder, start, (stride, n)) for n in range(count)]
    return [_load(context, builder, kind, array, entry) for entry in entries]


def _product(sign: int) -> Any:
    @intrinsic
    def product(context: Any, tile: Any, left: Any, right: Any, depth: Any) -> Any:
        kinds = types.unliteral(left), types.unliteral(right)

        def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            given, left, right, depth = arguments
            emitting = context, builder
            # Local variables that LLVM keeps in registers.
            sums = [
                cgutils.alloca_once_value(builder, value)
                for value in cgutils.unpack_tuple(builder, given)
            ]
            with cgutils.for_range(builder, depth) as loop:
                rows = _vectors(emitting, kinds[0], left, loop.index, tile.rows)
                columns = _vectors(emitting, kinds[1], right, loop.index, tile.columns)
                if sign < 0:
                    rows = [builder.fneg(value) for value in rows]
                for n, total in enumerate(sums):
                    i, j = divmod(n, tile.columns)
                    fused = _call(builder, "fmuladd", rows[i], columns[j], builder.load(total))
                    builder.store(fused, total)
            return cgutils.pack_array(builder, [builder.load(total) for total in sums])

        return tile(tile, *kinds, types.intp), emit

    return product


# tile +- A B. A is (array, first entry, stride of rows, stride of depth), B likewise with the
# stride of columns; a flat array holds numbers common to all lanes.
add_product = _product(1)
subtract_product = _product(-1)


@intrinsic
def add_gathered(context: Any, tile: Any, left: Any, right: Any, chosen: Any, few: Any) -> Any:
    """tile + the sum of A_n B_m over the numbers n from few[0] to few[1], with m = chosen[n].

    A_n is the n-th square block of a flat array, row by row; B is (array, first entry, stride of
    columns, stride of depth, stride of blocks).
    """
    kinds = types.unliteral(left), types.unliteral(right)

    def emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        given, left, right, chosen, few = arguments
        emitting = context, builder
        sums = [
            cgutils.alloca_once_value(builder, value)
            for value in cgutils.unpack_tuple(builder, given)
        ]
        *operand, stride = cgutils.unpack_tuple(builder, right)
        numbers = context.make_array(signature.args[3])(context, builder, chosen).data
        first, last = cgutils.unpack_tuple(builder, few)
        with cgutils.for_range_slice(builder, first, last, _INDEX(1), _INDEX) as (number, _):
            of_block = builder.mul(builder.load(builder.gep(numbers, [number])), stride)
            block = builder.mul(number, _INDEX(tile.rows**2))
            for k in range(tile.rows):
                array, start, across, down = operand
                at = array, builder.add(start, of_block), across, down
                columns = _entries_of(emitting, kinds[1][0], at, _INDEX(k), tile.columns)
                for i in range(tile.rows):
                    entry = builder.add(block, _INDEX(tile.rows * i + k))
                    factor = _load(context, builder, kinds[0], left, entry)
                    for total, column in zip(sums[i * tile.columns :], columns):
                        fused = _call(builder, "fmuladd", factor, column, builder.load(total))
                        builder.store(fused, total)
        return cgutils.pack_array(builder, [builder.load(total) for total in sums])

    return tile(tile, *kinds, chosen, few), emit


@compiler()
def empty(entries: int) -> NDArray[np.float64]:
    """Uninitialised array of lanes whose rows do not straddle cache lines."""
    raw = np.empty((entries + 1) * LANES)
    skip = -(raw.ctypes.data // 8) % LANES
    return raw[skip : skip + entries * LANES].reshape(entries, LANES)


def sliding(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    """Array of lanes over a flat array: row k holds the numbers from k on, and shares them."""
    rows = max(0, len(numbers) - LANES + 1)
    return np.lib.stride_tricks.as_strided(numbers, (rows, LANES), 2 * numbers.strides)
