"""The reference of Python has an entry for everything that the package exports."""

from __future__ import annotations

from types import ModuleType

import nanorocks_ros
from nanorocks_ros.tools.docs_pages.python_page import exported_names, python_page


def example():
    module = ModuleType('example')
    exec(
        'from math import pi\n'
        'LIMIT = 3\n'
        'class Bead: "A bead."\n'
        'class Lost(Exception): "No bead."\n'
        'def look(): "See."\n'
        'def _hidden(): pass\n',
        vars(module),
    )
    return module


def test_each_kind_has_its_directive():
    module = example()
    module.__all__ = ['Bead', 'LIMIT', 'Lost', 'look']
    page = python_page(module)
    for line in (
        '.. autoclass:: example.Bead\n   :members:',
        '.. autoclass:: example.Lost\n```',
        '.. autofunction:: example.look',
        '.. autodata:: example.LIMIT',
    ):
        assert line in page
    assert page.count('## ') == 4


def test_without_a_list_it_is_what_the_module_defines():
    assert exported_names(example()) == ['Bead', 'Lost', 'look']


def test_the_package_exports_what_exists():
    assert all(hasattr(nanorocks_ros, name) for name in exported_names(nanorocks_ros))
