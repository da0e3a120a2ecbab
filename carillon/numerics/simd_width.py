"""How many numbers go side by side: the vector registers of the processor.

It is the processor that numba compiles for: this one, or the one that the variables NUMBA_CPU_NAME
and NUMBA_CPU_FEATURES name. No list of processors could tell; the compiler can, by the registers
that its code puts eight doubles into.
"""

import re
from typing import NamedTuple

from llvmlite import ir
from numba.core.registry import cpu_target


class Registers(NamedTuple):
    """Vector registers: doubles in each, and how many of them."""

    doubles: int
    number: int


X86 = {"zmm": Registers(8, 32), "ymm": Registers(4, 16), "xmm": Registers(2, 16)}
"""AVX-512, AVX and SSE2, by the names of the registers."""

OTHERS = Registers(2, 32)
"""Vector registers of processors without these names, such as those with NEON."""


def registers_in(assembly: str) -> Registers:
    """The widest registers that the code works with.

    Examples
    --------
    >>> registers_in("vaddpd %ymm0, %ymm1, %ymm0")
    Registers(doubles=4, number=16)
    """
    names = set(re.findall(r"\b[xyz]mm", assembly))
    return next((registers for name, registers in X86.items() if name in names), OTHERS)


def assembly_of_a_sum() -> str:
    """What numba's compiler makes of a sum of eight doubles."""
    doubles = ir.VectorType(ir.DoubleType(), 8)
    module = ir.Module(name="sum")
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [doubles.as_pointer()]), "sum")
    builder = ir.IRBuilder(function.append_basic_block())
    numbers = builder.load(function.args[0])
    builder.store(builder.fadd(numbers, numbers), function.args[0])
    builder.ret_void()
    library = cpu_target.target_context.codegen().create_library("sum")
    library.add_ir_module(module)
    return str(library.get_asm_str())


REGISTERS = registers_in(assembly_of_a_sum())

LANES = REGISTERS.doubles
"""Numbers side by side: as many as a register holds.

With more the compiler splits every number over several registers, and tiles no longer fit.
"""
