// The six states against time: vision with its band of one sigma, navigation's values over it. The report's and the
// ground station's alike.
import {fixed} from '../common/format.js';
import {STATES, isAngle, unwrap} from '../common/names.js';
import {theme} from '../common/theme.js';
import {element} from '../common/element.js';
import {line, shadeGaps, timePlot} from './plots.js';

/**
 * @typedef {object} StateColumns
 * @property {number[]} times s
 * @property {(number|null)[][]} vision x y z [m], yaw pitch roll [deg]
 * @property {(number|null)[][]} [sigma] of each
 * @property {(number|null)[][]} [navigation]
 * @property {number[][]} gaps stretches without a pose
 */

export class StatePlots {
  /** @param {StateColumns} columns what is shown first */
  constructor(group, columns, height = 210) {
    this.element = element('div', {class: 'six'});
    this.group = group;
    this.height = height;
    this.columns = columns;
    this.plots = [];
    this.figures = STATES.map(() => this.element.appendChild(element('figure')));
  }

  // Once the element is in the page: a plot is as wide as its place.
  draw() {
    const count = this.columns.times.length;
    STATES.forEach((name, i) => {
      const value = (plot, v) => fixed(v, isAngle(i) ? 2 : 3);
      const none = {stroke: 'transparent', width: 0, points: {show: false}, value};
      const plot = timePlot(this.figures[i], this.group, {
        label: `${name} [${isAngle(i) ? '°' : 'm'}]`, height: this.height, drawUnder: shadeGaps(() => this.columns.gaps),
        series: [
          Object.assign({label: '+σ'}, none), Object.assign({label: '−σ'}, none),
          line('vision', theme('vision'), count, {value}),
          line('navigation', theme('navigation'), count, {width: 2, points: {show: false}, value}),
        ],
        bands: [{series: [1, 2], fill: theme('sigma')}],
        data: this.dataOf(i),
      });
      this.plots.push(plot);
    });
  }

  /** @param {StateColumns} columns */
  set(columns) {
    this.columns = columns;
    this.plots.forEach((plot, i) => plot.setData(this.dataOf(i), false));
  }

  dataOf(i) {
    const {times, sigma} = this.columns;
    let navigation = this.columns.navigation?.[i] ?? times.map(() => null);
    let vision = this.columns.vision[i];
    if (isAngle(i)) {
      navigation = unwrap(navigation);
      vision = unwrap(vision, navigation);
    }
    const bound = (sign) => vision.map((v, k) => (v == null || sigma?.[i][k] == null ? null : v + sign * sigma[i][k]));
    return [times, bound(1), bound(-1), vision, navigation];
  }
}
