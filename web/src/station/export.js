// What is seen, as files: the rows of the stretch as CSV, the page's pictures and plots as one PNG.
import {STATUSES} from '../common/names.js';
import {theme} from '../common/theme.js';

const SOURCES = ['', 'vision', 'predicted', 'lost'];

function save(blob, name) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

const fileName = (title, row, kind) => `${title.replace(/[^\w.-]+/g, '_').slice(-40)}_${row?.ns ?? 0}.${kind}`;

// Numbers as JavaScript writes a float's shortest text that reads back as the same float, or as good as that.
const shortest = (value) => (isFinite(value) ? String(Number(value.toPrecision(9))) : '');

/** @param {import('./store.js').Row[]} rows @param {string[]} columns */
export function csvOf(rows, columns) {
  const lines = rows.map((row) => [row.ns, STATUSES[row.status].name, SOURCES[row.source], ...Array.from(row.values, shortest)].join(','));
  return [`timestamp [ns],status,source,${columns.join(',')}`, ...lines].join('\n') + '\n';
}

export function saveCsv(rows, hello) {
  save(new Blob([csvOf(rows, hello.columns)], {type: 'text/csv'}), fileName(hello.title, rows[0], 'csv'));
}

// What is written in one line, where it is; the header, which stays in sight, at the top.
function drawTexts(context, root, all, ratio) {
  const header = root.querySelector('header');
  for (const one of root.querySelectorAll('#badge, .title, .numerals dt, .numerals dd, .numerals small, .card:not(.status, .log) h2')) {
    const place = one.getBoundingClientRect(), style = getComputedStyle(one);
    const top = place.top - (header.contains(one) ? header.getBoundingClientRect().top : all.top);
    context.fillStyle = style.backgroundColor;
    context.fillRect((place.left - all.left) * ratio, top * ratio, place.width * ratio, place.height * ratio);
    context.fillStyle = style.color;
    context.font = `${style.fontWeight} ${parseFloat(style.fontSize) * ratio}px ${style.fontFamily}`;
    context.textBaseline = 'middle';
    context.fillText(one.textContent, (place.left - all.left + parseFloat(style.paddingLeft)) * ratio, (top + place.height / 2) * ratio);
  }
}

// Every canvas of the page that is in it, where it is, and the numerals.
export function savePng(root, row, hello) {
  const all = root.getBoundingClientRect();
  const ratio = Math.min(devicePixelRatio, 2);
  const sheet = document.createElement('canvas');
  sheet.width = all.width * ratio;
  sheet.height = all.height * ratio;
  const context = /** @type {CanvasRenderingContext2D} */ (sheet.getContext('2d'));
  context.fillStyle = theme('page');
  context.fillRect(0, 0, sheet.width, sheet.height);
  for (const canvas of root.querySelectorAll('canvas')) {
    const place = canvas.getBoundingClientRect();
    if (!place.width || !canvas.width) continue;
    context.drawImage(canvas, (place.left - all.left) * ratio, (place.top - all.top) * ratio, place.width * ratio, place.height * ratio);
  }
  drawTexts(context, root, all, ratio);
  sheet.toBlob((blob) => blob && save(blob, fileName(hello.title, row, 'png')));
}
