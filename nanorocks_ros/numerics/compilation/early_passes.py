"""Simplifies the code of a function that compiled functions call, once instead of at every call.

numba keeps each local variable, and each argument, in memory. The state of a simulation is a tuple
of twenty arrays, some 150 numbers: a function that reads one of them stores all and loads all, and
so did every place that it is compiled into. LLVM needed most of its time to remove that there.

Functions with loops are left alone: in what order LLVM simplifies a loop and the code around it
decides its speed (an event of 15 beads took 7 % longer). No pass changes the order or the rounding
of arithmetic.
"""

from __future__ import annotations

import dis
from typing import TYPE_CHECKING, Any

from llvmlite import binding

if TYPE_CHECKING:
    from collections.abc import Callable

# Names of the passes, with the pass managers that LLVM has now and with those it had before.
_PASSES = (
    ('add_sroa_pass', 'add_sroa_pass'),
    ('add_simplify_cfg_pass', 'add_cfg_simplification_pass'),
    ('add_instruction_combine_pass', 'add_instruction_combining_pass'),
    ('add_aggressive_dce_pass', 'add_aggressive_dead_code_elimination_pass'),
)


def has_loops(function: Callable[..., Any]) -> bool:
    """Whether a Python function jumps back."""
    jumps = {*dis.hasjrel, *dis.hasjabs}
    return any(
        step.opcode in jumps and step.argval <= step.offset
        for step in dis.get_instructions(function)
    )


def simplify(module: Any, codegen: Any) -> None:
    """Keep variables in registers instead of memory, and remove what is not used.

    Parameters
    ----------
    module : llvmlite ModuleRef
        Changed.
    codegen : numba codegen
    """
    module.data_layout = codegen._data_layout
    if hasattr(binding, 'create_new_module_pass_manager'):
        options = binding.create_pipeline_tuning_options()
        builder = binding.create_pass_builder(codegen._tm, options)
        passes = binding.create_new_module_pass_manager()
        for name, _ in _PASSES:
            getattr(passes, name)()
        passes.run(module, builder)
    else:
        passes = binding.create_module_pass_manager()
        for _, name in _PASSES:
            getattr(passes, name)()
        passes.run(module)
