// What is drawn, as a table (CSV) or as a picture (PNG), for the folder of downloads.

const MARGIN = 12;
const TITLE = 22;

function save(blob, name) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}

const cell = (value) => (value === null || value === undefined ? '' : String(value));

/** A table as `nanorocks analyse` writes them: names in the first line, SI, what is not known empty. */
function saveTable(name, columns, rows) {
  const lines = [columns, ...rows.map((row) => row.map(cell))].map((row) => row.join(','));
  save(new Blob([`${lines.join('\n')}\n`], { type: 'text/csv' }), `${name}.csv`);
}

/** The plot as it is seen, with its title above it. */
function savePicture(name, title, plot) {
  const style = getComputedStyle(document.documentElement);
  const colour = (of) => style.getPropertyValue(of).trim();
  const { canvas } = plot.ctx;
  const scale = devicePixelRatio || 1;
  const picture = document.createElement('canvas');
  picture.width = canvas.width + 2 * MARGIN * scale;
  picture.height = canvas.height + (2 * MARGIN + TITLE) * scale;
  const brush = picture.getContext('2d');
  brush.fillStyle = colour('--panel');
  brush.fillRect(0, 0, picture.width, picture.height);
  brush.fillStyle = colour('--text');
  brush.font = `600 ${14 * scale}px system-ui, sans-serif`;
  brush.fillText(title, MARGIN * scale, (MARGIN + 13) * scale);
  brush.drawImage(canvas, MARGIN * scale, (MARGIN + TITLE) * scale);
  picture.toBlob((blob) => save(blob, `${name}.png`), 'image/png');
}

/** Let the buttons of a figure save its plot; `nameOf` and `table` are asked for then. */
export function offerExports(figure, chart, nameOf, table) {
  const title = () => `${figure.querySelector('h3').textContent.replace(/\s+/g, ' ')}, ${nameOf().replaceAll('_', ' ')}`;
  const fileOf = () => `${nameOf()}_${figure.id.replace('-chart', '').replace('-', '_')}`;
  const [csv, png] = ['.csv', '.png'].map((name) => figure.querySelector(name));
  csv.addEventListener('click', () => saveTable(fileOf(), ...table()));
  png.addEventListener('click', () => savePicture(fileOf(), title(), chart.plot));
  chart.exporters = [csv, png];
  for (const button of chart.exporters) button.disabled = !chart.plot;
}
