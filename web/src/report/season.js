// All flights of a run at once: what they come to, how they are spread, how they went over time, and which to look at.
import uPlot from 'uplot';
import {element} from '../common/element.js';
import {DEG, short} from '../common/format.js';
import {theme} from '../common/theme.js';
import {axis, place, yAxis} from '../views/plots.js';

const ROWS = 100;  // of the table at a time: a page of thousands of rows is slow

// What a flight is judged by: where the season has it, how it is shown, and which end is the bad one.
const MEASURES = [
  {key: 'rate', words: 'with a pose', unit: '%', scale: 100, worst: -1},
  {key: 'position_rms_m', words: 'position RMS', unit: 'cm', scale: 100, worst: 1},
  {key: 'over_range', words: 'over distance', unit: '%', scale: 100, worst: 1},
  {key: 'rotation_rms_rad', words: 'attitude RMS', unit: '°', scale: DEG, worst: 1},
  {key: 'truth_rms_m', words: 'position RMS, truth', unit: 'cm', scale: 100, worst: 1},
  {key: 'mean_nees', words: 'mean NEES', unit: '', scale: 1, worst: 1},
  {key: 'total_us', words: 'time a frame', unit: 'ms', scale: 1e-3, worst: 1},
  {key: 'problems', words: 'problems', unit: '', scale: 1, worst: 1},
];

const unitOf = (m) => (m.unit === '°' || m.unit === '' ? m.unit : ' ' + m.unit);
const shown = (m, value) => (value == null ? '–' : m.key === 'problems' ? String(value) : short(value * m.scale) + unitOf(m));
const failed = (season, i) => season.comparison[i] === 'not estimated';

export function quantile(sorted, fraction) {
  const at = fraction * (sorted.length - 1), below = Math.floor(at);
  return sorted[below] + (at - below) * (sorted[Math.min(below + 1, sorted.length - 1)] - sorted[below]);
}

const sortedValues = (season, m) => season[m.key].filter((v, i) => v != null && !failed(season, i)).sort((a, b) => a - b);

// ---- in words ----

function inWords(season) {
  const count = season.flight.length;
  const lost = season.flight.filter((f, i) => failed(season, i)).length;
  const sum = (key) => season[key].reduce((a, b) => a + (b || 0), 0);
  const frames = sum('frames');
  const words = [`${count} flights, ${frames} frames, a pose in ${frames ? (100 * sum('ok') / frames).toFixed(2) : 0} % of them.`];
  if (lost) words.push(`${lost} could not be estimated.`);
  const position = sortedValues(season, MEASURES[1]);
  if (position.length) {
    words.push(`Half of the flights have a position RMS below ${shown(MEASURES[1], quantile(position, 0.5))}, ` +
               `nine of ten below ${shown(MEASURES[1], quantile(position, 0.9))}.`);
  }
  return words.join(' ');
}

// ---- distributions: columns of a histogram, up to the 98th percentile so that one outlier does not flatten all ----

function histogram(season, m) {
  const values = sortedValues(season, m);
  if (values.length < 2) return null;
  const low = quantile(values, 0.02), high = quantile(values, 0.98), bins = 24;
  const width = (high - low) / bins || 1;
  const counts = new Array(bins).fill(0);
  for (const v of values) counts[Math.max(0, Math.min(bins - 1, Math.floor((v - low) / width)))]++;
  const most = Math.max(...counts);
  const columns = counts.map((n, i) => element('i', {style: `height:${(100 * n / most).toFixed(1)}%`,
      title: `${n} flights: ${shown(m, low + i * width)} to ${shown(m, low + (i + 1) * width)}${i === bins - 1 ? ' and more' : i === 0 ? ' and less' : ''}`}));
  return element('figure', {class: 'histogram'}, element('b', {}, m.words),
      element('div', {class: 'columns'}, ...columns),
      element('div', {class: 'ends'}, element('span', {}, shown(m, low)), element('span', {}, 'median ' + shown(m, quantile(values, 0.5))), element('span', {}, shown(m, high))));
}

// ---- over time ----

function trend(season, m, open) {
  // A clock that counts from the computer's start says nothing of the day.
  const dated = season.start_s.every((t, i) => failed(season, i) || t > 1e9);
  const timed = dated && new Set(season.start_s.filter((t) => t != null)).size > 1;
  const order = season.flight.map((f, i) => i).filter((i) => season[m.key][i] != null && !failed(season, i) && (!timed || season.start_s[i] != null));
  if (order.length < 3) return null;
  if (timed) order.sort((a, b) => season.start_s[a] - season.start_s[b]);
  const y = order.map((i) => season[m.key][i] * m.scale);
  const half = Math.max(1, Math.floor(order.length / 20));
  const median = y.map((v, i) => quantile(y.slice(Math.max(0, i - half), i + half + 1).sort((a, b) => a - b), 0.5));
  const parent = element('figure', {class: 'wide'});
  const draw = () => place(parent, {
    height: 220,
    scales: {x: {time: timed}},
    axes: [axis(timed ? '' : 'flight, in the order given', {size: 28}), yAxis(m.words + (m.unit ? ` [${m.unit}]` : ''))],
    series: [{label: timed ? 'start' : 'flight'},
             {label: m.words, stroke: theme('vision'), paths: () => null, points: {show: true, size: 4, fill: theme('vision'), width: 0}, value: (p, v) => short(v) + unitOf(m)},
             {label: 'running median', stroke: theme('text'), width: 2, points: {show: false}, value: (p, v) => short(v) + unitOf(m)}],
    cursor: {drag: {x: true, y: false}},
    hooks: {ready: [(/** @type {uPlot} */ plot) => plot.over.addEventListener('dblclick', () => { if (plot.cursor.idx != null) open(order[plot.cursor.idx]); })]},
  }, [timed ? order.map((i) => season.start_s[i]) : order.map((i) => i + 1), y, median]);
  return {parent, draw};
}

function trends(season, open) {
  const possible = MEASURES.filter((m) => sortedValues(season, m).length > 2);
  const box = element('div');
  const select = /** @type {HTMLSelectElement} */ (element('select', {'aria-label': 'what is shown over time',
      onchange: () => show(possible[select.selectedIndex])}, ...possible.map((m) => element('option', {}, m.words))));
  const show = (m) => {
    box.querySelectorAll('figure').forEach((figure) => figure.dispatchEvent(new Event('perch-remove')));
    const made = trend(season, m, open);
    box.replaceChildren(...(made ? [made.parent] : []));
    if (made) made.draw();
  };
  return possible.length ? {element: element('section', {}, element('h3', {}, 'Over time ', select),
      element('p', {class: 'note'}, 'A point a flight, and the median of the flights about it. Drag to zoom, double-click a point to open its flight.'), box),
                            draw: () => show(possible[Math.max(0, select.selectedIndex)])} : null;
}

// ---- the flights, the worst first ----

function flightTable(season, link) {
  const columns = MEASURES.filter((m) => m.key === 'problems' || sortedValues(season, m).length);
  let by = columns.find((m) => m.key === 'over_range') || columns[0];
  let most = ROWS;
  const body = element('tbody');
  const more = element('p', {class: 'note'});
  const find = /** @type {HTMLInputElement} */ (element('input', {type: 'search', placeholder: 'name', 'aria-label': 'flights whose name contains', oninput: () => { most = ROWS; show(); }}));

  const badness = (i) => (failed(season, i) ? Infinity : season[by.key][i] == null ? -Infinity : by.worst * season[by.key][i]);
  const show = () => {
    const wanted = find.value.toLowerCase();
    const order = season.flight.map((f, i) => i).filter((i) => !wanted || season.flight[i].toLowerCase().includes(wanted));
    order.sort((a, b) => badness(b) - badness(a) || a - b);
    body.replaceChildren(...order.slice(0, most).map((i) => element('tr', failed(season, i) ? {class: 'failed', title: season.first_problem[i]} : {},
        element('th', {scope: 'row'}, link(i)), element('td', {}, String(season.frames[i])),
        ...(failed(season, i) ? [element('td', {colspan: String(columns.length), class: 'cause'}, season.first_problem[i])]
                              : columns.map((m) => element('td', {}, shown(m, season[m.key][i])))))));
    more.replaceChildren(...(order.length > most ? [`${most} of ${order.length}. `, element('button', {onclick: () => { most *= 5; show(); }}, 'Show more')] : []));
    heads.forEach((head, k) => head.classList.toggle('chosen', columns[k] === by));
  };
  const heads = columns.map((m) => element('th', {scope: 'col'}, element('button', {title: 'the worst first', onclick: () => { by = m; show(); }}, m.words)));
  show();
  return element('section', {}, element('h3', {}, 'Flights, the worst first ', find),
      element('div', {class: 'scroll'}, element('table', {class: 'overview'},
          element('thead', {}, element('tr', {}, element('th', {scope: 'col'}, 'flight'), element('th', {scope: 'col'}, 'frames'), ...heads)), body)), more);
}

/**
 * @param {any} season the columns that season.cc wrote
 * @param {(i: number) => string} address of a flight's page
 * @param {((i: number) => void) | null} choose shows a flight that is in this page
 * @returns {{element: HTMLElement, draw: () => void}}
 */
export function seasonPage(season, address, choose) {
  const open = (i) => { if (choose) choose(i); else if (!failed(season, i)) location.href = address(i); };
  const link = (i) => (choose || !failed(season, i)
    ? element('a', {href: address(i), onclick: (event) => { if (choose) { event.preventDefault(); choose(i); } }}, season.flight[i])
    : element('span', {}, season.flight[i]));
  const histograms = MEASURES.filter((m) => m.key !== 'problems').map((m) => histogram(season, m)).filter((h) => h);
  const overTime = trends(season, open);
  const page = element('div', {class: 'season'}, element('p', {class: 'lead'}, inWords(season)));
  if (histograms.length) {
    page.append(element('section', {}, element('h3', {}, 'Distributions over the flights'),
        element('p', {class: 'note'}, 'From the 2nd to the 98th percentile; what lies beyond is in the outer columns.'),
        element('div', {class: 'histograms'}, ...histograms)));
  }
  if (overTime) page.append(overTime.element);
  page.append(flightTable(season, link));
  return {element: page, draw: () => { if (overTime) overTime.draw(); }};
}
