// Where the vehicle is, in numerals that can be read in sunlight: what a pilot looks at.
import {element} from '../common/element.js';
import {fixed} from '../common/format.js';

const TILES = [
  ['x', 'm', 2], ['y', 'm', 2], ['z', 'm', 2], ['yaw', '°', 1], ['pitch', '°', 1], ['roll', '°', 1],
];

// A deviation is known to two digits at best, and nobody flies by a tenth of a millimetre.
const two = (value, least) => (value < least ? `< ${least}` : `± ${Number(value.toPrecision(2))}`);

export class Numerals {
  constructor() {
    this.element = element('dl', {class: 'numerals'});
    this.cells = {};
    for (const [name, unit] of [...TILES, ['speed', 'm/s'], ['distance', 'm']]) {
      const value = element('span', {id: `value-${name}`}, '–'), sigma = element('small', {id: `sigma-${name}`}, '');
      this.cells[name] = {value, sigma};
      this.element.append(element('div', {}, element('dt', {}, name, ' ', element('i', {}, unit)), element('dd', {}, value), sigma));
    }
  }

  /** @param {import('./store.js').Row|null} row @param {Record<string, number>} column @param {boolean} old */
  show(row, column, old) {
    this.element.classList.toggle('old', old || !row || row.source === 2);
    const v = (name) => (row ? row.values[column[name]] : NaN);
    for (const [name, unit, digits] of TILES) {
      const {value, sigma} = this.cells[name];
      value.textContent = fixed(v(name), digits);
      const s = v('sigma_' + name);
      sigma.textContent = !isFinite(s) ? '' : unit === 'm' ? `${two(100 * s, 0.1)} cm` : `${two(s, 0.01)}°`;
    }
    this.cells.speed.value.textContent = fixed(Math.hypot(v('v_x'), v('v_y'), v('v_z')), 2);
    this.cells.speed.sigma.textContent = isFinite(v('v_z')) ? `${fixed(v('v_z'), 2)} along z` : '';
    this.cells.distance.value.textContent = fixed(Math.hypot(v('cam_x'), v('cam_y'), v('cam_z')), 2);
    this.cells.distance.sigma.textContent = 'camera to pad';
  }
}
