// Plots on uPlot: time plots that share cursor and zoom, the status strip, the scatter.
import uPlot from 'uplot';
import {short} from '../common/format.js';
import {STATUSES, statusColour} from '../common/names.js';
import {theme} from '../common/theme.js';

// Plots that show the same stretch of time: zooming one zooms all.
export class TimeGroup {
  constructor(key) {
    this.key = key;
    this.plots = [];
    this.zooming = false;
    this.quiet = false;  // while plots are being set one by one
  }
  zoom(from) {
    if (this.zooming || this.quiet) return;
    this.zooming = true;
    const {min, max} = from.scales.x;
    for (const plot of this.plots) {
      if (plot !== from && (plot.scales.x.min !== min || plot.scales.x.max !== max)) plot.setScale('x', {min, max});
    }
    this.zooming = false;
  }
}

// The time that each frame stands for: halfway to its neighbours, so that the first and the last have some too, but
// not far into a time without frames.
export function spansOf(times) {
  const most = times.length > 1 ? 1.5 * (times[times.length - 1] - times[0]) / (times.length - 1) : 0.5;
  return times.map((time, i) => [
    time - Math.min(most, i > 0 ? (time - times[i - 1]) / 2 : most),
    time + Math.min(most, i + 1 < times.length ? (times[i + 1] - time) / 2 : most)]);
}

// The stretches of time in which no frame has a pose.
export function gapsOf(times, status) {
  const gaps = [];
  spansOf(times).forEach(([from, to], i) => {
    if (status[i] === '0') return;
    if (gaps.length && gaps[gaps.length - 1][1] >= from) gaps[gaps.length - 1][1] = to;
    else gaps.push([from, to]);
  });
  return gaps;
}

// Shades them behind the lines. `gaps`: a list, or a function that says which they are now.
export function shadeGaps(gaps) {
  return (plot) => {
    const {ctx, bbox} = plot;
    ctx.save();
    ctx.fillStyle = theme('gap');
    for (const [from, to] of typeof gaps === 'function' ? gaps() : gaps) {
      const x0 = Math.max(plot.valToPos(from, 'x', true), bbox.left);
      const x1 = Math.min(plot.valToPos(to, 'x', true), bbox.left + bbox.width);
      if (x1 > bbox.left && x0 < bbox.left + bbox.width) ctx.fillRect(x0, bbox.top, Math.max(1, x1 - x0), bbox.height);
    }
    ctx.restore();
  };
}

export function axis(label, more) {
  return Object.assign({
    label, stroke: theme('muted'), labelFont: '12px system-ui, sans-serif', font: '11px system-ui, sans-serif',
    labelSize: 18, labelGap: 0, grid: {stroke: theme('grid'), width: 1}, ticks: {stroke: theme('grid'), size: 4},
  }, more);
}

const numbers = (plot, ticks) => ticks.map((v) => (v == null ? '' : String(+v.toPrecision(6)).replace('-', '−')));

export const yAxis = (label, more) => axis(label, Object.assign({size: 52, values: numbers}, more));

// A line; `count` decides whether single points can be told apart.
export function line(label, colour, count, more) {
  return Object.assign({
    label, stroke: colour, width: 1.5, points: {show: count < 400, size: 4, fill: colour, stroke: colour},
    value: (plot, v) => short(v),
  }, more);
}

// Puts a plot into `parent`, as wide as it, and keeps it so. Returns the uPlot.
export function place(parent, options, data) {
  const width = () => Math.max(240, parent.clientWidth);
  const plot = new uPlot(Object.assign({width: width(), height: 210}, options), data, parent);
  const observer = new ResizeObserver(() => {
    if (plot.width !== width()) plot.setSize({width: width(), height: options.height || 210});
  });
  observer.observe(parent);
  parent.addEventListener('perch-remove', () => { observer.disconnect(); plot.destroy(); }, {once: true});
  return plot;
}

/**
 * One plot against time in a group. `series` without the time's own.
 * @param {{label: string, series: any[], data: any[], bands?: any, height?: number, scales?: any, axes?: any, drawUnder?: any, drawOver?: any}} what
 */
export function timePlot(parent, group, what) {
  const {label, series, bands, data, height = 210, scales, axes, drawUnder, drawOver} = what;
  const options = {
    height,
    scales: Object.assign({x: {time: false}}, scales),
    axes: axes || [axis('time [s]', {size: 28, values: numbers}), yAxis(label)],
    series: [{label: 'time', value: (plot, v) => (v == null ? '–' : v.toFixed(3) + ' s')}, ...series],
    bands,
    cursor: {
      sync: {key: group.key, setSeries: false, scales: ['x', null],
             filters: {pub: (type) => type === 'mousemove' || type === 'mouseleave'}},
      drag: {x: true, y: false}, points: {size: 6},
    },
    legend: {live: true},
    hooks: {
      drawClear: drawUnder ? [drawUnder] : [],
      draw: drawOver ? [drawOver] : [],
      setScale: [(plot, key) => { if (key === 'x') group.zoom(plot); }],
    },
  };
  const plot = place(parent, options, data);
  group.plots.push(plot);
  return plot;
}

// The frames' statuses as a strip of colours; the worse status wins a pixel.
export function statusStrip(parent, group, times, status) {
  const drawOver = (plot) => {
    const {ctx, bbox} = plot;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    const spans = spansOf(times);
    for (let pass = 0; pass < 2; ++pass) {  // the few that failed over the many that did not
      for (let i = 0; i < status.length; ++i) {
        if ((status[i] === '0') !== (pass === 0)) continue;
        // Whole pixels: two half-covered ones would let the page shine through between frames.
        const x0 = Math.floor(plot.valToPos(spans[i][0], 'x', true));
        const x1 = Math.ceil(plot.valToPos(spans[i][1], 'x', true));
        ctx.fillStyle = statusColour(+status[i]);
        ctx.fillRect(x0, bbox.top, Math.max(1, x1 - x0), bbox.height);
      }
    }
    ctx.restore();
  };
  timePlot(parent, group, {
    label: '', height: 92, drawOver,
    scales: {y: {range: [0, 1]}},
    axes: [axis('time [s]', {size: 28, grid: {show: false}}), yAxis('', {values: () => [], ticks: {show: false}, grid: {show: false}})],
    series: [{label: 'status', stroke: 'transparent', points: {show: false}, scale: 'y',
              value: (plot, v, s, i) => (i == null ? '–' : STATUSES[+status[i]].words)}],
    data: [times, times.map(() => 0.5)],
  });
}

/**
 * Errors against something: a point a frame, and of each bin the RMS as a step with its 95 % interval as a band.
 * @param {{x: (number|null)[], y: (number|null)[], label: string, errorLabel: string, unit: string, errorUnit: string, height?: number,
 *          bins: {from: number, to: number, rms: number|null, low: number|null, high: number|null}[]}} what
 */
export function errorScatter(parent, what) {
  const {x, y, bins} = what;
  const points = x.flatMap((v, i) => (v != null && y[i] != null ? [{x: v, y: Number(y[i])}] : []));
  points.sort((a, b) => a.x - b.x);
  const shown = bins.filter((bin) => bin.rms != null);
  const drawBins = (plot) => {
    const {ctx, bbox} = plot;
    const at = (v, scale) => plot.valToPos(v, scale, true);
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.strokeStyle = theme('text');
    ctx.fillStyle = theme('band');
    ctx.lineWidth = 2.5 * devicePixelRatio;
    for (const bin of shown) {
      const left = at(bin.from, 'x'), right = at(bin.to, 'x');
      if (bin.low != null) ctx.fillRect(left, at(bin.high, 'y'), right - left, at(bin.low, 'y') - at(bin.high, 'y'));
      ctx.beginPath();
      ctx.moveTo(left, at(bin.rms, 'y'));
      ctx.lineTo(right, at(bin.rms, 'y'));
      ctx.stroke();
    }
    ctx.restore();
  };
  // One wild bin's interval would flatten all the others.
  const most = points.concat(shown.map((bin) => ({x: 0, y: Number(bin.rms)}))).reduce((top, point) => Math.max(top, point.y), 0);
  place(parent, {
    height: what.height || 240,
    scales: {x: {time: false, range: [bins[0].from, bins[bins.length - 1].to]},
             y: {range: [0, (most || 1) * 1.05]}},
    axes: [axis(what.label, {size: 28}), yAxis(what.errorLabel)],
    series: [{label: what.label.replace(/ \[.*/, ''), value: (plot, v) => short(v) + what.unit},
             {label: 'error', stroke: theme('vision'), paths: () => null,
              points: {show: true, size: points.length > 1000 ? 3 : 4, fill: theme('vision'), stroke: theme('vision'), width: 0}, value: (plot, v) => short(v) + what.errorUnit}],
    cursor: {drag: {x: false, y: false}},
    hooks: {draw: [drawBins]},
  }, [points.map((p) => p.x), points.map((p) => p.y)]);
}
