// How the pictures' grey levels went over time: the paper's plot_hist for a whole flight.
import {theme} from '../common/theme.js';
import {line, timePlot} from './plots.js';

/**
 * @param {{times: number[], threshold: (number|null)[], white: (number|null)[], black: (number|null)[],
 *          grey: {from_s: number[], bins: number, levels: string}}} what levels: a digit of base 36 each, 35 times the root of a share
 */
export function greyPlot(parent, group, what) {
  const {times, threshold, white, black, grey} = what;
  const {from_s: from, bins, levels} = grey;
  const end = times[times.length - 1];
  const drawUnder = (plot) => {
    const {ctx, bbox} = plot;
    const x = (t) => Math.round(plot.valToPos(t, 'x', true)), y = (level) => Math.round(plot.valToPos(level, 'y', true));
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.fillStyle = theme('muted');
    from.forEach((start, column) => {
      const left = x(start), right = column + 1 < from.length ? x(from[column + 1]) : x(end);
      for (let bin = 0; bin < bins; ++bin) {
        const depth = parseInt(levels[column * bins + bin], 36);
        if (!depth) continue;
        ctx.globalAlpha = Math.min(1, depth / 24);
        const top = y((bin + 1) * 256 / bins);
        ctx.fillRect(left, top, Math.max(1, right - left), y(bin * 256 / bins) - top);
      }
    });
    ctx.restore();
  };
  const level = (name, colour, values, dash) => ({values, series: line(name, theme(colour), times.length, {dash, points: {show: times.length < 3}, value: (p, v) => (v == null ? '–' : String(v))})});
  const lines = [level('white of the target', 'vision', white), level('black of the target', 'navigation', black), level('threshold', 'text', threshold, [6, 3])]
      .filter(({values}) => values.some((v) => v != null));
  timePlot(parent, group, {
    label: 'grey level', height: 260, drawUnder, scales: {y: {range: [0, 256]}},
    series: [...lines.map((l) => l.series)],
    data: [times, ...lines.map((l) => l.values)],
  });
}
