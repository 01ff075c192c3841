// What the pages of a run and of a calibration are made of.
import {element} from '../common/element.js';

export function section(title, note, ...children) {
  return element('section', {}, element('h3', {}, title), note ? element('p', {class: 'note'}, note) : null, ...children);
}

// Numbers right, first column left; `rows` of strings or elements.
export function table(header, rows, attributes = {}) {
  return element('div', {class: 'scroll'}, element('table', attributes,
      element('thead', {}, element('tr', {}, ...header.map((h) => element('th', {scope: 'col'}, h)))),
      element('tbody', {}, ...rows.map((row) => element('tr', {}, ...row.map((cell, i) =>
          element(i ? 'td' : 'th', i ? {} : {scope: 'row'}, cell)))))));
}

/** @param {any[][]} all name, value and a note each */
export function tileRow(all) {
  return element('dl', {class: 'tiles'}, ...all.map(([name, value, note]) =>
      element('div', {}, element('dt', {}, name), element('dd', {}, value), element('small', {}, note))));
}

// Plots have their colours painted in: a new scheme needs new plots. Paper is always white.
export function redrawWhenColoursChange(show) {
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', show);
  addEventListener('beforeprint', () => { document.documentElement.classList.add('paper-page'); show(); });
  addEventListener('afterprint', () => { document.documentElement.classList.remove('paper-page'); show(); });
}

/**
 * A histogram's columns, in HTML: they print and fit any width.
 * @param {{title: string, counts: number[], behind?: number[], tip: (i: number) => string, ends: string[]}} what
 */
export function histogramFigure(what) {
  const {title, counts, behind, tip, ends} = what;
  const most = Math.max(...counts, ...(behind || []));
  const height = (n) => `${(100 * n / most).toFixed(1)}%`;
  return element('figure', {class: 'histogram'}, element('b', {}, title),
      element('div', {class: 'columns'}, ...counts.map((n, i) => element('i', {title: tip(i)}, element('b', {style: 'height:' + height(n)}), behind ? element('u', {style: 'height:' + height(behind[i])}) : null))),
      element('div', {class: 'ends'}, ...ends.map((end) => element('span', {}, end))));
}
