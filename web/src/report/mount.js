// Builds the page of a mount calibration from the JSON in it. Text goes in as text, never as HTML.
import {element, legend} from '../common/element.js';
import {short} from '../common/format.js';
import {theme} from '../common/theme.js';
import {TimeGroup, axis, line, place, timePlot, yAxis} from '../views/plots.js';
import {Scene} from '../views/scene.js';
import {redrawWhenColoursChange, section, table, tileRow} from './parts.js';

const AXES = ['x', 'y', 'z', 'rotation x', 'rotation y', 'rotation z'];
const unitOf = (i) => (i < 3 ? 'cm' : '°');
const withUnit = (value, unit) => (value == null ? '–' : short(value) + (unit === '°' ? '' : ' ') + unit);
const signed = (value, unit) => (value > 0 ? '+' : '') + withUnit(value, unit);
const scatterText = ([mm, deg]) => `${withUnit(mm, 'mm')}, ${withUnit(deg, '°')}`;

function lead(data) {
  const flights = data.flights.map((f) => `${f.name}: ${f.used} of ${f.pictures} pictures used, the pad as they place it scatters by ${scatterText(f.scatter_after)} RMS, with the mount of the start by ${scatterText(f.scatter_before)}.`);
  const told = data.untold.length ? 'The flights do not tell everything: no mount was written.' : 'The flights tell everything that was sought.';
  return [element('p', {class: 'lead'}, told + ' ' + flights.join(' ')), ...data.untold.map((words) => element('p', {class: 'notice'}, words)),
    ...data.flights.filter((f) => f.wander).map((f) => element('p', {class: 'notice'}, `${f.name}: ${f.wander}`))];
}

function tiles(data) {
  return tileRow([
    ['chi-square', short(data.chi_square), 'a degree of freedom; 1 is right'],
    ...data.effect.map(([range, mm, deg]) => [`at ${range} m`, withUnit(mm, 'mm'), `the mount’s uncertainty moves a pad seen there (1 σ); it turns it by ${withUnit(deg, '°')}`]),
    ...data.flights.map((f) => ['clock offset', withUnit(f.offset_ms, 'ms'), `camera minus navigation, ${f.name}`]),
  ]);
}

function parameterTable({parameters}) {
  const priors = parameters.some((p) => p.alone !== p.sigma);
  const rows = parameters.map((p) => [p.name, withUnit(p.value, p.unit), signed(p.change, p.unit), withUnit(p.sigma, p.unit), ...(priors ? [withUnit(p.alone, p.unit)] : [])]);
  return section('What was found', 'The change is from where the search started: the drawing, or T_BS. Rotations are about the axes of the frame that a pose maps to; the angles themselves are in mount.yaml below.' +
      (priors ? ' Where the flights alone say much less than the deviation, it is a prior’s.' : ''),
      table(['', 'value', 'change', 'deviation', ...(priors ? ['by the flights alone'] : [])], rows));
}

function heldOutTable({held_out: parts}) {
  const rows = parts.map((part, i) => (part.problem ? [String(i + 1), part.problem, '', '', '']
    : [String(i + 1), `${withUnit(part.moved_mm, 'mm')}, ${withUnit(part.turned_deg, '°')}`, short(part.moved_sigmas),
       part.within.map(scatterText).join('; '), part.beyond.map(scatterText).join('; ')]));
  return section('Held-out parts', 'Each flight in nine pieces of time, every third piece held out, three times: the mount from the rest, and how that places the pad in the pictures it has not seen. A mount that is known moves by what its deviations allow: in units of what leaving these pictures out should change (largest of the six), 3 is much.',
      table(['part', 'the mount moves by', 'in deviations', 'pad scatter in its own pictures', 'in those held out'], rows));
}

// Orange for +1, blue for -1, as deep as it is large.
function correlationTable({parameters, correlation}) {
  const cell = (row, column) => {
    const value = correlation[row][column];
    const colour = value > 0 ? 'var(--vision)' : 'var(--navigation)';
    return element('td', {style: value == null ? '' : `background: color-mix(in srgb, ${colour} ${(100 * Math.abs(value)).toFixed(0)}%, transparent)`,
                          title: `${parameters[row].name} with ${parameters[column].name}: ${short(value)}`});
  };
  return section('Correlations', 'Deep: the two trade with each other, and the flights tell them apart badly. Orange: together; blue: against each other.',
      element('div', {class: 'scroll'}, element('table', {class: 'matrix'},
          element('thead', {}, element('tr', {}, element('th', {}), ...parameters.map((p) => element('th', {scope: 'col'}, element('span', {}, p.name))))),
          element('tbody', {}, ...parameters.map((p, row) => element('tr', {}, element('th', {scope: 'row'}, p.name), ...parameters.map((q, column) => cell(row, column))))))));
}

function costPlot({offset_costs: costs, flights}, draw) {
  const figure = element('figure', {class: 'wide'});
  draw.push(() => place(figure, {
    height: 240, scales: {x: {time: false}, y: {distr: 3}},
    axes: [axis('camera clock minus navigation [ms]', {size: 28}), yAxis('median misfit squared')],
    series: [{label: 'offset', value: (plot, v) => withUnit(v, 'ms')}, line('cost', theme('navigation'), costs.length)],
  }, [costs.map((c) => c[0]), costs.map((c) => c[1])]));
  return section('Cost against time offset', `Of ${flights[0].name}: the middle picture’s misfit, in units of 1° and 3 cm + 1 % of the range, mount and pad fitted anew at each offset. A flat valley: the flight hardly tells the offset; more than one: look which is right.`, figure);
}

function residualPlots(flight, key, draw) {
  const group = new TimeGroup(key);
  const grid = (errors, colour, height) => {
    const six = element('div', {class: 'six'});
    AXES.forEach((name, i) => {
      const figure = six.appendChild(element('figure'));
      draw.push(() => timePlot(figure, group, {
        label: `${name} [${unitOf(i)}]`, height,
        series: [line('navigation − vision', theme(colour), flight.time_s.length, {paths: () => null, points: {show: true, size: flight.time_s.length < 100 ? 6 : 3, fill: theme(colour), width: 0}})],
        data: [flight.time_s, errors[i]],
      }));
    });
    return six;
  };
  return [
    section('Navigation minus vision, calibrated', 'The body in the world’s axes. It should look like noise: waves are drift, steps a lost fix, a spread that grows with speed or turn rate a wrong clock. What lasts for the whole flight is not here: it has gone into the pad’s place.', grid(flight.after, 'vision', 190)),
    section('The same before', 'With the mount, pad and clock that the search started from; mind the scales.', grid(flight.before, 'muted', 150)),
  ];
}

function offsetTable(flight) {
  const rows = AXES.map((name, i) => [name, signed(flight.dc_before[i], unitOf(i)), signed(flight.dc_after[i], unitOf(i)),
                                      withUnit(flight.rms_before[i], unitOf(i)), withUnit(flight.rms_after[i], unitOf(i))]);
  return section('DC offset', 'The mean of navigation minus vision over the flight, what the paper’s calc_dc_offset finds, and the RMS.',
      table(['axis', 'offset before', 'after', 'RMS before', 'after'], rows));
}

function paths(flight, pad, draw) {
  const scene = new Scene();
  scene.element.addEventListener('perch-remove', () => scene.dispose(), {once: true});
  draw.push(() => {
    if (pad) scene.setPad(pad);
    scene.overlay(flight.path.navigation, flight.path.vision);
  });
  return section('Where it flew', 'The body over the pad as calibrated. Drag to turn, wheel or pinch to zoom.',
      legend([['background:var(--navigation)', 'navigation'], ['background:var(--vision);width:.5em;height:.5em;border-radius:50%', 'vision']]), scene.element);
}

function flightPart(flight, index, pad, draw) {
  return element('article', {},
      element('h2', {}, flight.name, element('small', {}, `${flight.used} of ${flight.pictures} pictures`)),
      offsetTable(flight), ...residualPlots(flight, 'flight' + index, draw), paths(flight, pad, draw));
}

function main() {
  const data = JSON.parse(document.getElementById('calibration')?.textContent ?? '{}');
  const root = /** @type {HTMLElement} */ (document.getElementById('report'));
  const show = () => {
    root.querySelectorAll('figure, .scene').forEach((figure) => figure.dispatchEvent(new Event('perch-remove')));
    const draw = [];
    root.replaceChildren(
        element('header', {}, element('h1', {}, 'Perch mount calibration')), ...lead(data), tiles(data),
        parameterTable(data), heldOutTable(data), correlationTable(data), costPlot(data, draw),
        ...data.flights.map((flight, i) => flightPart(flight, i, data.pad, draw)),
        element('details', {}, element('summary', {}, 'mount.yaml'), element('pre', {}, data.yaml)));
    for (const one of draw) one();
  };
  show();
  redrawWhenColoursChange(show);
}

main();
