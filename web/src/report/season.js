// All flights of a run at once: what they come to, how they are spread, how they went over time, and which to look at.
import uPlot from 'uplot';
import {element} from '../common/element.js';
import {DEG, short} from '../common/format.js';
import {theme} from '../common/theme.js';
import {axis, place, yAxis} from '../views/plots.js';
import {histogramFigure, section, table} from './parts.js';

const ROWS = 100;  // of the table at a time: a page of thousands of rows is slow

// What a flight is judged by: where the season has it, how it is shown, and which end is the bad one.
const MEASURES = [
  {key: 'rate', words: 'with a pose', unit: '%', scale: 100, worst: -1},
  {key: 'position_rms_m', words: 'position RMS', unit: 'cm', scale: 100, worst: 1},
  {key: 'over_range', words: 'over distance', unit: '%', scale: 100, worst: 1},
  {key: 'rotation_rms_rad', words: 'attitude RMS', unit: '°', scale: DEG, worst: 1},
  {key: 'truth_rms_m', words: 'position RMS, truth', unit: 'cm', scale: 100, worst: 1},
  {key: 'mean_nees', words: 'mean NEES', unit: '', scale: 1, worst: 1},
  {key: 'mean_nis', words: 'mean NIS', unit: '', scale: 1, worst: 1},
  {key: 'total_us', words: 'time a frame', unit: 'ms', scale: 1e-3, worst: 1},
  {key: 'problems', words: 'problems', unit: '', scale: 1, worst: 1},
];

// What else the flights differ in.
const CONDITIONS = [
  {key: 'range_m', words: 'distance', unit: 'm', scale: 1},
  {key: 'view_angle_rad', words: 'view angle', unit: '°', scale: DEG},
  {key: 'speed_m_s', words: 'speed', unit: 'm/s', scale: 1},
  {key: 'white', words: 'grey level of the target’s white', unit: '', scale: 1},
  {key: 'visible', words: 'visible part of the target', unit: '%', scale: 100},
  {key: 'rate_hz', words: 'pictures a second', unit: 'Hz', scale: 1},
];
const KINDS = [{key: 'target', words: 'target'}, {key: 'camera', words: 'camera'}];

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

function histogram(season, before, m) {
  const values = sortedValues(season, m);
  if (values.length < 2) return null;
  const low = quantile(values, 0.02), high = quantile(values, 0.98), bins = 24;
  const width = (high - low) / bins || 1;
  const countsOf = (list) => {
    const counts = new Array(bins).fill(0);
    for (const v of list) counts[Math.max(0, Math.min(bins - 1, Math.floor((v - low) / width)))]++;
    return counts;
  };
  const counts = countsOf(values);
  const was = before ? sortedValues(before, m) : [];
  return histogramFigure({title: m.words + (was.length ? `, median before ${shown(m, quantile(was, 0.5))}` : ''), counts, behind: was.length ? countsOf(was) : undefined,
    tip: (i) => `${counts[i]} flights: ${shown(m, low + i * width)} to ${shown(m, low + (i + 1) * width)}${i === bins - 1 ? ' and more' : i === 0 ? ' and less' : ''}`,
    ends: [shown(m, low), 'median ' + shown(m, quantile(values, 0.5)), shown(m, high)]});
}

// ---- over time, and over what the flights differ in ----

// What the flights can be put in order by: `of` a flight, or null.
function orders(season) {
  // A clock that counts from the computer's start says nothing of the day.
  const dated = season.start_s.every((t, i) => failed(season, i) || t > 1e9);
  const timed = dated && new Set(season.start_s.filter((t) => t != null)).size > 1;
  const differ = (key) => new Set(season[key].filter((v, i) => v != null && !failed(season, i))).size;
  return [
    timed ? {words: 'time', label: '', time: true, of: (i) => season.start_s[i]} : {words: 'time', label: 'flight, in the order given', of: (i) => i + 1},
    ...CONDITIONS.filter((c) => differ(c.key) > 2).map((c) => ({words: c.words, label: c.words + (c.unit ? ` [${c.unit}], the flight’s median` : ', the flight’s median'), of: (i) => (season[c.key][i] == null ? null : season[c.key][i] * c.scale)})),
    ...KINDS.filter((k) => differ(k.key) > 1).map((k) => {
      const names = [...new Set(season[k.key].filter((v, i) => v && !failed(season, i)))].sort();
      return {words: k.words, label: '', names, of: (i) => (names.includes(season[k.key][i]) ? names.indexOf(season[k.key][i]) + 1 : null)};
    }),
  ];
}

const medianOf = (values) => quantile([...values].sort((a, b) => a - b), 0.5);

// Of names the median of all that have it, else of the flights about each.
function medians(x, y, names) {
  if (names) {
    const of = names.map((name, k) => medianOf(y.filter((v, i) => x[i] === k + 1)));
    return x.map((k) => of[k - 1]);
  }
  const half = Math.max(1, Math.floor(y.length / 20));
  return y.map((v, i) => medianOf(y.slice(Math.max(0, i - half), i + half + 1)));
}

function trend(season, before, m, by, open) {
  const order = season.flight.map((f, i) => i).filter((i) => season[m.key][i] != null && !failed(season, i) && by.of(i) != null);
  if (order.length < 3) return null;
  order.sort((a, b) => by.of(a) - by.of(b));
  const x = order.map(by.of), y = order.map((i) => season[m.key][i] * m.scale);
  const value = (p, v) => short(v) + unitOf(m);
  /** @type {any[]} */
  const series = [{label: by.words, value: by.names ? (p, v) => (v == null ? '–' : by.names[v - 1]) : undefined},
                  {label: m.words, stroke: theme('vision'), paths: () => null, points: {show: true, size: order.length > 500 ? 2.5 : 4, fill: theme('vision'), width: 0}, value},
                  {label: 'running median', stroke: theme('text'), width: 2, points: {show: false}, value}];
  const data = [x, y, medians(x, y, by.names)];
  if (before) {
    const both = order.map((i, k) => k).filter((k) => before[m.key][order[k]] != null && !failed(before, order[k]));
    const was = both.length > 2 ? medians(both.map((k) => x[k]), both.map((k) => before[m.key][order[k]] * m.scale), by.names) : [];
    const column = x.map(() => null);
    was.forEach((v, k) => { column[both[k]] = v; });
    series.push({label: 'the median before', stroke: theme('navigation'), width: 2, dash: [6, 3], points: {show: false}, value, spanGaps: true});
    data.push(column);
  }
  const parent = element('figure', {class: 'wide'});
  const draw = () => place(parent, {
    height: 220,
    scales: {x: {time: !!by.time, range: by.names ? [0.5, by.names.length + 0.5] : undefined}},
    axes: [axis(by.label, Object.assign({size: 28}, by.names ? {splits: () => by.names.map((n, i) => i + 1), values: () => by.names, grid: {show: false}} : {})),
           yAxis(m.words + (m.unit ? ` [${m.unit}]` : ''))],
    series,
    cursor: {drag: {x: true, y: false}},
    hooks: {ready: [(/** @type {uPlot} */ plot) => plot.over.addEventListener('dblclick', () => { if (plot.cursor.idx != null) open(order[plot.cursor.idx]); })]},
  }, data);
  return {parent, draw};
}

function trends(season, before, open) {
  const possible = MEASURES.filter((m) => sortedValues(season, m).length > 2);
  const by = orders(season);
  const box = element('div');
  const select = (words, choices) => /** @type {HTMLSelectElement} */ (element('select', {'aria-label': words, onchange: () => show()},
      ...choices.map((c) => element('option', {}, c.words))));
  const measure = select('what is shown', possible), over = select('what it is shown over', by);
  const show = () => {
    box.querySelectorAll('figure').forEach((figure) => figure.dispatchEvent(new Event('perch-remove')));
    const made = trend(season, before, possible[Math.max(0, measure.selectedIndex)], by[Math.max(0, over.selectedIndex)], open);
    box.replaceChildren(...(made ? [made.parent] : []));
    if (made) made.draw();
  };
  return possible.length ? {element: element('section', {}, element('h3', {}, 'Trend of ', measure, ' over ', over),
      element('p', {class: 'note'}, 'A point a flight, and the median of the flights about it' + (before ? '; dashed, that of the earlier run' : '') + '. Drag to zoom, double-click a point to open its flight.'), box),
                            draw: show} : null;
}

// ---- the flights by what they were taken with ----

function kindTable(season) {
  const kinds = KINDS.filter((k) => new Set(season[k.key].filter((v, i) => v && !failed(season, i))).size > 1);
  if (!kinds.length) return null;
  const columns = MEASURES.filter((m) => sortedValues(season, m).length);
  const groups = new Map();
  season.flight.forEach((f, i) => {
    if (failed(season, i)) return;
    const name = kinds.map((k) => season[k.key][i]).join(', ');
    groups.set(name, [...(groups.get(name) || []), i]);
  });
  const rows = [...groups].sort(([a], [b]) => (a < b ? -1 : 1)).map(([name, all]) => [name, String(all.length), ...columns.map((m) => {
    const values = all.map((i) => season[m.key][i]).filter((v) => v != null);
    return values.length ? shown(m, medianOf(values)) : '–';
  })]);
  return section('By ' + kinds.map((k) => k.words).join(' and '), 'Medians over the flights.', table(['', 'flights', ...columns.map((m) => m.words)], rows));
}

// ---- the flights, the worst first ----

function flightTable(season, link) {
  const columns = MEASURES.filter((m) => m.key === 'problems' || sortedValues(season, m).length);
  let by = columns.find((m) => m.key === 'over_range') || columns[0];
  let most = ROWS;
  const body = element('tbody');
  const more = element('p', {class: 'note'});
  const find = /** @type {HTMLInputElement} */ (element('input', {type: 'search', placeholder: 'name', 'aria-label': 'flights whose name contains', oninput: () => { most = ROWS; show(); }}));

  const badness = (i) => (season[by.key][i] == null ? -Infinity : by.worst * season[by.key][i]);
  const show = () => {
    const wanted = find.value.toLowerCase();
    const order = season.flight.map((f, i) => i).filter((i) => !failed(season, i)).filter((i) => !wanted || season.flight[i].toLowerCase().includes(wanted));
    order.sort((a, b) => badness(b) - badness(a) || a - b);
    body.replaceChildren(...order.slice(0, most).map((i) => element('tr', {},
        element('th', {scope: 'row'}, link(i)), element('td', {}, String(season.frames[i])),
        ...columns.map((m) => element('td', {}, shown(m, season[m.key][i]))))));
    more.replaceChildren(...(order.length > most ? [`${most} of ${order.length}. `, element('button', {onclick: () => { most *= 5; show(); }}, 'Show more')] : []));
    heads.forEach((head, k) => head.classList.toggle('chosen', columns[k] === by));
  };
  const heads = columns.map((m) => element('th', {scope: 'col'}, element('button', {title: 'the worst first', onclick: () => { by = m; show(); }}, m.words)));
  show();
  return element('section', {}, element('h3', {}, 'Flights, the worst first ', find),
      element('div', {class: 'scroll'}, element('table', {class: 'overview'},
          element('thead', {}, element('tr', {}, element('th', {scope: 'col'}, 'flight'), element('th', {scope: 'col'}, 'frames'), ...heads)), body)), more);
}

// Those that could not be estimated, and why.
function failures(season) {
  const all = season.flight.map((f, i) => i).filter((i) => failed(season, i));
  if (!all.length) return null;
  const most = 500;
  return element('details', {open: all.length <= 20 ? '' : null}, element('summary', {}, `${all.length} of ${season.flight.length} flights could not be estimated`),
      element('ul', {class: 'problems'}, ...all.slice(0, most).map((i) => element('li', {}, season.flight[i] + ': ' + season.first_problem[i]))),
      all.length > most ? element('p', {class: 'note'}, `and ${all.length - most} more, all in summary.csv`) : null);
}

/**
 * @param {any} season the columns that season.cc wrote
 * @param {any} before those of an earlier run of the same flights, or null
 * @param {(i: number) => string} address of a flight's page
 * @param {((i: number) => void) | null} choose shows a flight that is in this page
 * @returns {{element: HTMLElement, draw: () => void}}
 */
export function seasonPage(season, before, address, choose) {
  const open = (i) => { if (choose) choose(i); else if (!failed(season, i)) location.href = address(i); };
  const link = (i) => (choose || !failed(season, i)
    ? element('a', {href: address(i), onclick: (event) => { if (choose) { event.preventDefault(); choose(i); } }}, season.flight[i])
    : element('span', {}, season.flight[i]));
  const histograms = MEASURES.filter((m) => m.key !== 'problems').map((m) => histogram(season, before, m)).filter((h) => h);
  const overTime = trends(season, before, open);
  const page = element('div', {class: 'season'}, element('p', {class: 'lead'}, inWords(season)));
  if (histograms.length) {
    page.append(element('section', {}, element('h3', {}, 'Distributions over the flights'),
        element('p', {class: 'note'}, 'From the 2nd to the 98th percentile; what lies beyond is in the outer columns.' + (before ? ' Outlined: the earlier run.' : '')),
        element('div', {class: 'histograms'}, ...histograms)));
  }
  if (overTime) page.append(overTime.element);
  const kinds = kindTable(season);
  if (kinds) page.append(kinds);
  page.append(flightTable(season, link));
  const lost = failures(season);
  if (lost) page.append(lost);
  return {element: page, draw: () => { if (overTime) overTime.draw(); }};
}
