// Normalised errors squared against time: single ones, their running mean, and the bounds of both.
import {short} from '../common/format.js';
import {theme} from '../common/theme.js';
import {line, shadeGaps, timePlot} from './plots.js';

const DEGREES = 6;    // of freedom of a pose
const RUNNING = 25;   // frames: a second at a camera's usual rate

// The value that chi-square is below with the probability whose normal quantile is z (Wilson and Hilferty): good to 2 %
// at 6 degrees of freedom, to 0.1 % at 150.
function chiSquare(degrees, z) {
  const a = 2 / (9 * degrees);
  return degrees * (1 - a + z * Math.sqrt(a)) ** 3;
}

// Means of up to RUNNING values about each that is there.
export function runningMean(values) {
  const at = values.map((v, i) => i).filter((i) => values[i] != null);
  const sums = [0];
  for (const i of at) sums.push(sums[sums.length - 1] + values[i]);
  const means = values.map(() => null);
  at.forEach((i, k) => {
    const from = Math.max(0, k - (RUNNING >> 1)), to = Math.min(at.length, k + (RUNNING >> 1) + 1);
    means[i] = (sums[to] - sums[from]) / (to - from);
  });
  return means;
}

/** @param {{label: string, times: number[], values: (number|null)[], gaps: number[][]}} what */
export function consistencyPlot(parent, group, what) {
  const {label, times, values, gaps} = what;
  // On a logarithmic scale; what is beyond it is as wrong as can be, and drawn at its end.
  const [least, most] = [1e-2, 1e4];
  const shown = (list) => list.map((v) => (v != null && v > 0 ? Math.max(least, Math.min(most, v)) : null));
  const constant = (value) => times.map(() => value);
  const dashed = (name, dash, colour = 'muted') => ({label: name, stroke: theme(colour), width: 1, dash, points: {show: false}, value: (p, v) => short(v)});
  const bound = (z) => chiSquare(DEGREES * RUNNING, z) / RUNNING;
  timePlot(parent, group, {
    label, height: 230, scales: {y: {distr: 3}}, drawUnder: shadeGaps(gaps),
    series: [dashed('2.5 %', [2, 4]), dashed('97.5 %', [2, 4]),
             dashed('mean 2.5 %', [8, 4], 'navigation'), dashed('mean 97.5 %', [8, 4], 'navigation'),
             line('a frame', theme('vision'), times.length, {width: 0, paths: () => null, points: {show: true, size: times.length > 600 ? 2 : 4, fill: theme('vision'), width: 0}}),
             line('mean', theme('navigation'), times.length, {width: 2, points: {show: false}})],
    data: [times, constant(1.2373), constant(14.4494), constant(bound(-1.96)), constant(bound(1.96)),
           shown(values), shown(runningMean(values))],
  });
}
