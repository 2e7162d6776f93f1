"""Code on the pages: commands and options exist, Python runs, or the page says why not."""

from __future__ import annotations

import ast
import re

import pytest
import yaml
from page_code import PAGES, ROOT, Block, blocks, calls, inline_code, options_of, parsers, words
from page_runs import run_page

from nanorocks_ros.cli.main import build_parser
from nanorocks_ros.experiment.trays import load_trays
from nanorocks_ros.nodes.run import NODES

PARSER = build_parser()
TEXTS = {str(page.relative_to(ROOT)): page.read_text(encoding='utf-8') for page in PAGES}
BLOCKS = [(name, block) for name, text in TEXTS.items() for block in blocks(text)]
SHELL = [
    (name, call)
    for name, block in BLOCKS
    if block.language in ('', 'bash')
    for call in calls(block.text)
]
# Made by the recipes of CONTRIBUTING.md.
RECIPES = {'nanorocks trays', 'nanorocks figure clusters'}
RUN_BY_THEIR_OWN_TESTS = ('CONTRIBUTING.md', 'docs/start/tutorial.md')

# Programs of others, which have tests of their own.
FOREIGN = {
    *(
        'cd',
        'export',
        'source',
        'pip',
        'dask',
        'colcon',
        'rosdep',
        'ssh',
        'rviz2',
        'ros2',
        'docker',
    ),
    *('make', 'python', 'nanorocks', '.venv/bin/python'),
}
# Options named in a sentence, and whose they are.
FOREIGN_OPTIONS = {
    '--keep': 'python -m benchmarks golden',
    '--against': 'python -m benchmarks golden',
    '--tolerance': 'python -m benchmarks golden',
    '--ros-args': 'ros2',
    '--params-file': 'ros2',
    '--symlink-install': 'colcon',
    '--break-system-packages': 'pip',
    '--upgrade': 'pip',
}


KNOWN = parsers(PARSER)


def test_blocks_of_a_page_are_found_with_their_marks():
    page = (
        'text\n\n    one\n    two\n\n<!-- not run: why -->\n\n    three\n\n<!-- Ctrl-C -->\n'
        '```text\nfour\n```\n'
    )
    assert blocks(page) == [
        Block('', '', 'one\ntwo\n'),
        Block('not run: why', '', 'three\n'),
        Block('Ctrl-C', '', ''),
        Block('', 'text', 'four\n'),
    ]


def refused(call):
    """Why a call is refused, or abbreviates an option; '' if it is as it should be."""
    options = [word for word in words(call) if word.startswith('--')]
    offered = KNOWN[named_command(call)]._option_string_actions
    unknown = [word for word in options if word.partition('=')[0] not in offered]
    if unknown:
        return f'no option {", ".join(unknown)}'
    try:
        PARSER.parse_args(words(call)[1:])
    except SystemExit as stop:
        return f'exit code {stop.code}' if stop.code else ''
    return ''


def named_command(code):
    """The words of the command that a code names; `nanorocks` if there is none such."""
    tokens = code.split()
    return next(words for k in (3, 2, 1) if (words := ' '.join(tokens[:k])) in KNOWN)


def test_every_command_in_a_block_is_accepted_by_the_parser(capsys):
    commands = [(name, call) for name, call in SHELL if call.startswith('nanorocks ')]
    assert len(commands) > 100
    wrong = [f'{name}: {call}: {why}' for name, call in commands if (why := refused(call))]
    assert wrong == [], capsys.readouterr().err


def test_a_command_that_does_not_exist_is_noticed(capsys):
    assert refused('nanorocks figure packing --simulat -o packing.png')
    assert refused('nanorocks analyze BAG')
    assert not refused('nanorocks figure impacts RESULTS... -o impacts.png [--tray K]')


@pytest.mark.parametrize('name', sorted(TEXTS))
def test_commands_and_options_in_sentences_exist(name):
    every = options_of(PARSER)
    wrong = []
    for code in inline_code(TEXTS[name]):
        options = re.findall(r'(?:^|\s)(--[a-z][\w-]*)', code)
        if re.match(r'nanorocks [a-z]', code) and code not in RECIPES:
            command = named_command(code)
            if command == 'nanorocks':
                wrong.append(code)
            offered = set(KNOWN[command]._option_string_actions)
            wrong += [f'{code}: {option}' for option in options if option not in offered]
        elif code.startswith('--'):
            unknown = [o for o in options if o not in every and o not in FOREIGN_OPTIONS]
            wrong += unknown
    assert wrong == []


def test_nodes_modules_and_targets_that_pages_name_exist():
    targets = set(re.findall(r'^([a-z-]+):', (ROOT / 'Makefile').read_text(), re.MULTILINE))
    from benchmarks.__main__ import ALL

    checks = {'documented', 'golden', 'fuzz', 'kills', 'signals', 'structure'}
    wrong = []
    for name, text in TEXTS.items():
        if name == 'CONTRIBUTING.md':
            continue
        spoken = ' '.join(text.split())
        found = {
            'node': (
                re.findall(r'(?:ros2 run nanorocks_ros|-m nanorocks_ros\.nodes) (\w+)', spoken),
                {*NODES, 'NAME'},
            ),
            'benchmark': (re.findall(r'-m benchmarks ([a-z_]+)', spoken), {*ALL, *checks}),
            'target': (re.findall(r'[`\s]make ([a-z][a-z-]+)[`\n]', text), targets),
        }
        for kind, (used, existing) in found.items():
            wrong += [f'{name}: {kind} {word}' for word in used if word not in existing]
        for module in re.findall(r'-m ((?:benchmarks|nanorocks_ros)\.[\w.]*\w)', spoken):
            path = ROOT / module.replace('.', '/')
            if not (path.with_suffix('.py').exists() or (path / '__main__.py').exists()):
                wrong.append(f'{name}: module {module}')
    assert wrong == []


def test_parameters_that_pages_set_exist():
    reference = TEXTS['docs/reference/parameters.md'] + TEXTS['docs/reference/node_reference.md']
    known = set(re.findall(r'`([\w.]+)`', reference)) | {'use_sim_time'}
    heads = {'qos_overrides', 'address'}
    used = {
        (name, word)
        for name, text in TEXTS.items()
        for word in re.findall(r'(?<=-p )([\w./]+):=', text)
    }
    assert len(used) > 10
    wrong = [
        (name, word)
        for name, word in sorted(used)
        if word not in known
        and word.partition('.')[0] not in heads
        and not any(word.endswith(f'.{k}') or k == word.partition('.')[2] for k in known)
    ]
    assert wrong == []


def test_every_program_in_a_block_is_known():
    first = {(name, call.split()[0]) for name, call in SHELL}
    assert {(name, word) for name, word in first if word not in FOREIGN} == set(), (
        'fence what is no command, with its language: ```text, ```math, ```yaml'
    )


@pytest.mark.parametrize(
    ('name', 'block'),
    [(n, b) for n, b in BLOCKS if b.language == 'yaml'],
    ids=lambda value: value if isinstance(value, str) else value.text.split()[0],
)
def test_yaml_is_read(name, block, tmp_path):
    content = yaml.safe_load(block.text)
    if 'trays' in content:
        path = tmp_path / 'trays.yaml'
        path.write_text(block.text, encoding='utf-8')
        assert load_trays(str(path))


def python_pages():
    """Pages with Python, but those of CONTRIBUTING.md and the tutorial."""
    return sorted(
        {n for n, b in BLOCKS if b.language == 'python' and n not in RUN_BY_THEIR_OWN_TESTS}
    )


@pytest.mark.parametrize('name', python_pages())
def test_python_runs(name, tmp_path):
    kept = [
        block
        for block in blocks(TEXTS[name])
        if block.language == 'python' or block.mark == 'prints'
    ]
    page = '\n'.join(
        (f'<!-- {block.mark} -->\n\n' if block.mark else '')
        + f'```{block.language}\n{block.text}```\n'
        for block in kept
    )
    wrong, _ = run_page(page, tmp_path)
    assert wrong == []


@pytest.mark.parametrize(
    'block', [b for _, b in BLOCKS if b.mark.startswith('sketch')], ids=lambda b: b.text.split()[0]
)
def test_names_that_a_sketch_calls_exist(block):
    code = '\n'.join(p.read_text('utf-8') for p in (ROOT / 'nanorocks_ros').rglob('*.py'))
    defined = (
        set(re.findall(r'(?:def|class) (\w+)', code)) | set(dir(__builtins__)) | {'isinstance'}
    )
    tree = ast.parse(block.text)
    called = {
        node.func.id if isinstance(node.func, ast.Name) else node.func.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
    }
    assert called - defined == set()
