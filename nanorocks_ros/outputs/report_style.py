"""The look of reports: on a phone, on a screen, bright or dark, and on paper with page numbers.

Tested by ``test/outputs/test_html_report.py``.
"""

from __future__ import annotations

STYLE = """\
:root { color-scheme: light dark; --line: #8886; --soft: #8882; --muted: #595959;
  --link: #0b5cad; --bad: #b03a00; --paper: #fff; }
@media (prefers-color-scheme: dark) {
  :root { --muted: #b4b4b4; --link: #7db8ff; --bad: #ff9a5c; } }
* { box-sizing: border-box; }
body { font: 16px/1.55 system-ui, sans-serif; max-width: 64rem; margin: 1.5rem auto;
  padding: 0 1rem; overflow-wrap: anywhere; }
h1 { font-size: 1.7rem; line-height: 1.25; } h2 { font-size: 1.25rem; margin-top: 2.5rem; }
h2, nav { border-top: 1px solid var(--line); padding-top: 1rem; }
nav ol { columns: 2 18rem; } a { color: var(--link); }
.conclusion { font-size: 1.1rem; border-left: 4px solid var(--link); padding-left: .8rem; }
.made, figcaption { color: var(--muted); font-size: .92rem; }
figure { margin: 1rem 0; } figcaption { padding: .3rem 0; }
figure img { max-width: 100%; height: auto; background: #fff; padding: 4px; border-radius: 4px; }
.scroll { overflow-x: auto; background: no-repeat Canvas;
  /* Shades at the sides to which a table goes on; it covers them with the two before them. */
  background-image: linear-gradient(to right, Canvas 30%, transparent),
    linear-gradient(to left, Canvas 30%, transparent),
    linear-gradient(to right, #8889, transparent), linear-gradient(to left, #8889, transparent);
  background-position: left, right, left, right;
  background-attachment: local, local, scroll, scroll;
  background-size: 2.5rem 100%, 2.5rem 100%, 1rem 100%, 1rem 100%; }
code { font-size: .92em; } code span { white-space: nowrap; }
@media (max-width: 600px) {
  figure.text { overflow-x: auto; } figure.text img { width: 640px; max-width: none; } }
table { border-collapse: collapse; font-size: .92rem; overflow-wrap: normal; }
th, td { padding: .25rem .7rem; border-bottom: 1px solid var(--line); text-align: left;
  vertical-align: top; }
th { background: var(--soft); }
@media (max-width: 1000px) { th, td { padding: .25rem .4rem; } }
td.n { font-variant-numeric: tabular-nums; white-space: nowrap; }
.errs { border-left: 4px solid var(--bad); padding-left: .8rem; }
@page { size: A4; margin: 18mm 15mm 20mm;
  @bottom-center { content: counter(page) " / " counter(pages); font: 9pt sans-serif; } }
@media print {
  :root { color-scheme: light; --muted: #444; --link: #000; --bad: #b03a00; }
  body { font-size: 10pt; max-width: none; margin: 0; padding: 0; }
  nav { display: none; } a { text-decoration: none; }
  h1, h2 { break-after: avoid; } h2 { margin-top: 1.5rem; }
  figure.picture, tr { break-inside: avoid; } figure img { max-height: 230mm; padding: 0; }
  thead { display: table-header-group; } .scroll { overflow: visible; background: none; }
  table { font-size: 7.5pt; width: 100%; overflow-wrap: anywhere; }
  th, td { padding: 1pt 3pt; } th { overflow-wrap: break-word; } td.n { white-space: normal; }
}
"""
