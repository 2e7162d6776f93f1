"""Size of the package by folder, and what a change in it costs; of this tree or of a commit.

    python -m benchmarks structure [COMMIT]

prints modules and lines of each folder, the largest folder, modules without a test file of their
own, and the changes in existing files that the recipe for a stage needs.
"""

from __future__ import annotations

import re
import subprocess
from collections import Counter
from pathlib import Path, PurePosixPath

_ROOT = Path(__file__).parents[1]
_PACKAGE = 'nanorocks_ros'
_RECIPE = re.compile(r'^```diff\n\+\+\+ (\S+)', re.MULTILINE)
_LARGEST = 12


def report(commit: str = 'HEAD') -> None:
    """Print the tables of a commit."""
    files = _git('ls-tree', '-r', '--name-only', commit).splitlines()
    modules = [
        PurePosixPath(file)
        for file in files
        if file.startswith(f'{_PACKAGE}/') and file.endswith('.py')
    ]
    lines = {module: _git('show', f'{commit}:{module}').count('\n') for module in modules}
    counted = [module for module in modules if module.name != '__init__.py']
    folders = Counter(str(module.parent) for module in counted)
    sizes = Counter[str]()
    for module, size in lines.items():
        sizes[str(module.parent)] += size
    print(f'{commit}: {len(counted)} modules, {sum(lines.values())} lines, {len(folders)} folders')
    print('| folder | modules | lines |\n| --- | --- | --- |')
    for folder, count in folders.most_common(_LARGEST):
        print(f'| `{folder}` | {count} | {sizes[folder]} |')
    tests = {PurePosixPath(file) for file in files if file.startswith('test/')}
    untested = [module for module in counted if _own_test(module) not in tests]
    _, _, section = _git('show', f'{commit}:CONTRIBUTING.md').partition('## Recipe: add a stage\n')
    recipe = _RECIPE.findall(section.partition('\n## ')[0])
    print(f'\nmodules without a test file of their own: {len(untested)} of {len(counted)}')
    print(f'recipe for a stage: {len(recipe)} changes in {len(set(recipe))} existing files')


def _own_test(module: PurePosixPath) -> PurePosixPath:
    folder = module.parent.relative_to(_PACKAGE)
    return PurePosixPath('test') / folder / f'test_{module.stem.strip("_")}.py'


def _git(*arguments: str) -> str:
    return subprocess.run(
        ['git', *arguments], cwd=_ROOT, check=True, capture_output=True, text=True
    ).stdout
