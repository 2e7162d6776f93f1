"""``python -m nanorocks_ros.nodes NAME``: starts a node without an installed executable.

Tested by ``test/nodes/test_graph.py``.
"""

from __future__ import annotations

import sys

from nanorocks_ros.nodes.run import NODES, main

if __name__ == '__main__':
    if len(sys.argv) < 2 or sys.argv[1] not in NODES:
        sys.exit(f'usage: python -m nanorocks_ros.nodes {{{",".join(NODES)}}}')
    main(sys.argv.pop(1))
