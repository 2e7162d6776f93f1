"""Code of called functions is simplified before their callers copy it."""

from __future__ import annotations

import pytest
from llvmlite import binding
from numba.core.registry import cpu_target

from nanorocks_ros.numerics.compilation.early_passes import has_loops, simplify

# An argument that is stored and loaded, as numba does with every variable.
IN_MEMORY = """
define {{double, double}} @sum({{double, double}} %pair) {{
    %place = alloca {{double, double}}
    store {{double, double}} %pair, {{double, double}}* %place
    %again = load {{double, double}}, {{double, double}}* %place
    %first = extractvalue {{double, double}} %again, 0
    %second = extractvalue {{double, double}} %again, 1
    %one = fadd double %first, {constant}
    %two = fadd double %one, {constant}
    %result = insertvalue {{double, double}} %again, double %two, 0
    ret {{double, double}} %result
}}
"""


@pytest.fixture
def simplified():
    module = binding.parse_assembly(IN_MEMORY.format(constant='0x3FB999999999999A'))
    simplify(module, cpu_target.target_context.codegen())
    return str(module)


def test_variables_are_kept_in_registers(simplified):
    assert 'extractvalue' in simplified
    for memory in ('alloca', 'store', 'load'):
        assert memory not in simplified


def test_sums_of_constants_are_not_reordered(simplified):
    assert simplified.count('fadd double') == 2


def test_loops_are_noticed():
    def by_for(n):
        for _ in range(n):
            pass

    def by_while(n):
        while n > 0:
            n -= 1

    def without(n):
        return n if n > 0 else -n

    assert has_loops(by_for)
    assert has_loops(by_while)
    assert not has_loops(without)
