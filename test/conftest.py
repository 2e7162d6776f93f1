"""What several tests need."""

import os
import shutil
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import settings

# How long an example takes says something of the machine.
settings.register_profile('nanorocks', deadline=None)
settings.load_profile('nanorocks')

pytest_plugins = ['dask_fixtures']

ROOT = Path(__file__).resolve().parent.parent
NOT_PACKAGED = ('.*', '__pycache__', '*.egg-info', 'build', 'install', 'log', 'dist')

_BROWSERS = ('chromium', 'chromium-browser', 'google-chrome')
# No word to anybody but us.
_SWITCHES = (
    '--no-sandbox',
    '--disable-gpu',
    '--disable-quic',
    '--no-first-run',
    '--disable-background-networking',
    '--disable-component-update',
    '--disable-sync',
)

# Files that fork this process hundreds of times come first: after kernels have been compiled its
# memory is larger, and each fork takes up to four times as long.
FORKING = (
    'test/jobs/test_resumed_tasks.py',
    'test/studies/film_import/test_film_cache.py',
    'test/validation/test_hostile_input.py',
    'test/cli/calibration/test_finished_output.py',
    'test/studies/analysis/results/test_results_folder.py',
)
# Then files that take longest (`--durations`), in the order in which they begin: at the end of a
# run no processor waits for one of them. The first of them compile different functions, so that
# processes that begin side by side do not wait for each other.
LONGEST = (
    'test/simulation/test_shaken_tray.py',
    'test/pipeline/test_tray_measurement.py',
    'test/simulation/engine/flight/test_gas_drag.py',
    'test/stages/restitution/test_restitution_estimator.py',
    'test/test_tutorial.py',
    'test/studies/reproduction/test_reproduce_paper.py',
    'test/studies/batch/test_batch_analysis.py',
    'test/cli/figures/test_figure_cor.py',
    'test/studies/analysis/test_offline_analysis.py',
    'test/test_printed_numbers.py',
    'test/interface/test_notebooks.py',
    'test/stages/bodies/test_turning_bodies.py',
    'test/validation/test_foreign_films.py',
    'test/studies/libraries/test_cluster_simulations.py',
    'test/tools/docs_pages/test_site.py',
)


def pytest_collection_modifyitems(items):
    """Begin with the files that fork, then the longest ones, then those with most tests."""
    sizes = Counter(item.path for item in items)
    places = {ROOT / name: place for place, name in enumerate((*FORKING, *LONGEST))}
    items.sort(key=lambda item: (places.get(item.path, len(places)), -sizes[item.path]))


@pytest.fixture(scope='session')
def root():
    """The source tree."""
    return ROOT


@pytest.fixture(scope='session')
def source_copy(tmp_path_factory):
    """A copy of the source tree that may be built in, without what earlier builds left."""
    copy = tmp_path_factory.mktemp('workspace') / 'nanorocks_ros'
    unneeded = shutil.ignore_patterns(*NOT_PACKAGED, 'bags', 'benchmarks', 'docs', 'test')
    shutil.copytree(ROOT, copy, symlinks=True, ignore=unneeded)
    return copy


@pytest.fixture(scope='module')
def browser():
    """A real browser without a window."""
    path = next(filter(None, map(shutil.which, _BROWSERS)), None)
    if path is None:
        remedy = 'no browser: apt-get install -y --no-install-recommends chromium'
        if os.environ.get('CI') == 'true':
            pytest.fail(remedy)
        pytest.skip(remedy)
    playwright = pytest.importorskip('playwright.sync_api')
    with playwright.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=path, args=list(_SWITCHES))
        yield chromium
        chromium.close()


@pytest.fixture
def look(browser):
    """Open pages; whatever one complains of fails the test."""
    contexts, complaints = [], []

    def open_page(url, **options):
        context = browser.new_context(**{'viewport': {'width': 1440, 'height': 900}, **options})
        contexts.append(context)
        page = context.new_page()
        page.on('pageerror', lambda error: complaints.append(str(error)))
        page.on(
            'console',
            lambda said: (
                said.type == 'error'
                # What the browser says of a server that is gone, or lets nobody in.
                and 'Failed to load resource' not in said.text
                and 'WebSocket connection' not in said.text
                and complaints.append(said.text)
            ),
        )
        page.on(
            'request',
            lambda asked: (
                asked.url.startswith(('http://127.0.0.1:', 'blob:http://127.0.0.1:'))
                or complaints.append(f'asked for {asked.url}')
            ),
        )
        page.on('dialog', lambda dialog: complaints.append(f'dialog: {dialog.message}'))
        page.set_default_timeout(10_000)
        page.goto(url)
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert complaints == []
