// The time plots of the page: the six states, velocities, reprojection error, latency. All show the same stretch.
import {element, legend} from '../common/element.js';
import {short} from '../common/format.js';
import {STATES} from '../common/names.js';
import {theme} from '../common/theme.js';
import {TimeGroup, gapsOf, line, shadeGaps, timePlot} from '../views/plots.js';
import {StatePlots} from '../views/state_plots.js';

const COLOURS = ['#d55e00', '#009e73', '#0072b2', '#cc79a7'];
const value = (plot, v) => short(v);
const nothing = {times: [], vision: STATES.map(() => []), gaps: []};

/** @type {[string, string[], string[]][]} label, columns, what each is called */
const OTHERS = [
  ['velocity [m/s]', ['v_x', 'v_y', 'v_z'], ['x', 'y', 'z']],
  ['angular velocity [°/s]', ['w_x', 'w_y', 'w_z'], ['x', 'y', 'z']],
  ['reprojection [px]', ['reprojection'], ['RMS']],
  ['time [ms]', ['estimate_ms', 'latency_ms'], ['estimate', 'since exposure']],
];
const HEAD = /** @type {typeof OTHERS} */ ([['head [°]', ['pan', 'tilt'], ['pan', 'tilt']]]);

export class LivePlots {
  constructor(choose) {
    this.shown = OTHERS;
    this.choose = choose;  // a time was pointed at
    this.legend = legend([['background:var(--vision)', 'vision'], ['background:var(--sigma);height:.8em', '± 1 σ'],
                          ['background:var(--navigation)', 'navigation'], ['background:var(--gap);height:.8em', 'no pose']]);
    this.element = element('section', {'aria-label': 'plots'}, this.legend);
    /** @type {number[][]} */
    this.gaps = [];
    this.group = new TimeGroup('station');
    this.states = new StatePlots(this.group, nothing, 190);
    /** @type {any[]} */
    this.others = [];
    this.draw();
  }

  // Anew: colours are painted in.
  draw() {
    this.element.querySelectorAll('figure').forEach((figure) => figure.dispatchEvent(new Event('perch-remove')));
    this.element.replaceChildren(this.legend);
    this.gaps = [];
    this.group = new TimeGroup('station');
    this.states = new StatePlots(this.group, nothing, 190);
    this.element.append(this.states.element);
    this.states.draw();
    const grid = this.element.appendChild(element('div', {class: 'others'}));
    this.others = this.shown.map(([label, columns, names]) => {
      const parent = grid.appendChild(element('figure'));
      const colours = [theme('vision'), ...COLOURS.slice(1)];
      return timePlot(parent, this.group, {
        label, height: 170, drawUnder: shadeGaps(() => this.gaps),
        series: names.map((name, i) => line(name, colours[i], 1000, {value})), data: [[], ...columns.map(() => [])]});
    });
    for (const plot of this.all()) plot.over.addEventListener('click', () => {
      const t = plot.posToVal(plot.cursor.left, 'x');
      if (isFinite(t) && plot.cursor.left >= 0) this.choose(t);
    });
  }

  // With a head that turns the camera, its angles, too.
  setHead(turns) {
    const shown = turns ? [...OTHERS, ...HEAD] : OTHERS;
    if (shown.length === this.shown.length) return;
    this.shown = shown;
    this.draw();
  }

  all() { return [...this.states.plots, ...this.others]; }

  /** @param {import('./store.js').Row[]} rows of the stretch @param {Record<string, number>} column */
  show(rows, column, from, to) {
    const times = rows.map((row) => row.t);
    const get = (name) => rows.map((row) => (isFinite(row.values[column[name]]) ? row.values[column[name]] : null));
    this.gaps = gapsOf(times, rows.map((row) => String(row.status)));
    this.states.set({times, vision: STATES.map(get), sigma: STATES.map((name) => get('sigma_' + name)),
                     navigation: STATES.map((name) => get('nav_' + name)), gaps: this.gaps});
    this.others.forEach((plot, i) => plot.setData([times, ...this.shown[i][1].map(get)], false));
    this.group.quiet = true;
    for (const plot of this.all()) plot.setScale('x', {min: from, max: to});
    this.group.quiet = false;
    // Without a pointer in it a plot's legend says what is now.
    for (const plot of this.all()) if (times.length && !(plot.cursor.left >= 0)) plot.setLegend({idx: times.length - 1}, false);
  }
}
