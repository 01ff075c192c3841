// Builds the report from the JSON in the page. Text goes in as text, never as HTML.
import {element, legend} from '../common/element.js';
import {DEG, short} from '../common/format.js';
import {STATES, STATUSES, isAngle} from '../common/names.js';
import {theme} from '../common/theme.js';
import {consistencyPlot} from '../views/consistency.js';
import {greyPlot} from '../views/grey.js';
import {TimeGroup, errorScatter, gapsOf, line, shadeGaps, statusStrip, timePlot} from '../views/plots.js';
import {StatePlots} from '../views/state_plots.js';
import {Scene} from '../views/scene.js';
import {histogramFigure, redrawWhenColoursChange, section, table, tileRow} from './parts.js';
import {seasonPage} from './season.js';

const shownScale = (i) => (isAngle(i) ? DEG : 100);  // rad to degrees, m to cm
const shownUnit = (i) => (isAngle(i) ? '°' : 'cm');
const withUnit = (number, i) => number + (isAngle(i) ? '°' : ' cm');

// What the paper reached at 320 x 240 and about 1 m (its figure 3.5), cm and degrees.
const PAPER_RMS = [4.9, 2.9, 3.6, 4.4, 3.3, 1.1];

const percent = (fraction, digits = 1) => (fraction == null ? '–' : (100 * fraction).toFixed(digits) + ' %');
const signed = (value) => (value > 0 ? '+' : '') + short(value);
const scaled = (value, scale) => (value == null ? null : value * scale);
const cm = (metres) => (metres == null ? '–' : short(100 * metres) + ' cm');
const deg = (rad) => (rad == null ? '–' : short(DEG * rad) + '°');
const ms = (us) => (us == null ? '–' : short(us / 1000) + ' ms');
const plural = (count, word) => `${count} ${word}${count === 1 ? '' : 's'}`;

// ---- the words and figures at the top ----

function inWords(summary) {
  const {detection, errors} = summary;
  const ok = detection.counts.ok;
  const words = [`${plural(summary.frames, 'frame')} in ${short(summary.duration_s)} s; a pose in ${ok} of them (${percent(detection.rate)}).`];
  if (summary.comparison === 'compared') {
    words.push(`Against navigation on ${plural(summary.compared_frames, 'frame')} the position is off by ${cm(errors.position_m.rms)} RMS` +
               (errors.position_over_range_rms == null ? '' : `, ${percent(errors.position_over_range_rms, 2)} of the distance`) +
               `, half of the time by less than ${cm(errors.position_m.median)}; the attitude is off by ${deg(errors.rotation_rad.rms)} RMS.`);
  }
  if (summary.truth) {
    const {position_m, position_over_range_rms, rotation_rad} = summary.truth;
    words.push(`Against the flight’s exact truth it is off by ${cm(position_m.rms)}, ${percent(position_over_range_rms, 3)} of the distance, and ${deg(rotation_rad.rms)} RMS.`);
  }
  if (detection.gaps.length) {
    const longest = detection.gaps.reduce((a, b) => (b.duration_s > a.duration_s ? b : a));
    words.push(`The longest of ${plural(detection.gaps.length, 'gap')} is ${plural(longest.frames, 'frame')} (${short(longest.duration_s)} s) at ${short(longest.start_s)} s.`);
  }
  if (summary.total_us.mean != null) words.push(`A frame takes ${ms(summary.total_us.mean)}.`);
  return words.join(' ');
}

function tiles(summary) {
  const {errors, consistency} = summary;
  const all = [
    ['detection rate', percent(summary.detection.rate), `${summary.detection.counts.ok} of ${summary.frames}`],
    ['position RMS', errors.position_m.rms == null ? null : cm(errors.position_m.rms), `95 % ≤ ${cm(errors.position_m.p95)}`],
    ['over distance', errors.position_over_range_rms == null ? null : percent(errors.position_over_range_rms, 2), 'error / range, RMS'],
    ['attitude RMS', errors.rotation_rad.rms == null ? null : deg(errors.rotation_rad.rms), `95 % ≤ ${deg(errors.rotation_rad.p95)}`],
    ['mean NEES', consistency.mean_nees == null ? null : short(consistency.mean_nees), consistency.reference === 'truth' ? '6 is honest' : 'navigation’s noise in it'],
    ['reprojection', summary.reprojection_rms_px.rms == null ? null : short(summary.reprojection_rms_px.rms) + ' px', 'RMS'],
    ['time a frame', summary.total_us.mean == null ? null : ms(summary.total_us.mean), `99 % ≤ ${ms(summary.total_us.p99)}`],
  ];
  return tileRow(all.filter((tile) => tile[1]));
}

const WHY_NOT_COMPARED = {
  'not estimated': 'The flight could not be estimated; the problem below says why.',
  'no navigation': 'The flight has no navigation, so there is nothing to compare with: vision alone is shown.',
  'no world_from_pad': 'The configuration has no frames.world_from_pad, so navigation cannot be brought into the pad frame: vision alone is shown.',
};

// ---- figures ----

function statePlots(flight, group) {
  const {frames} = flight;
  const compared = frames.navigation.some((column) => column.some((v) => v != null));
  // One sigma, as the ground station shows it; given in cm and degrees.
  const sigma = frames.sigma_cm_deg.map((column, i) => column.map((s) => (s == null ? null : isAngle(i) ? s : s / 100)));
  const plots = new StatePlots(group, {times: frames.time_s, vision: frames.vision, sigma,
                                       navigation: compared ? frames.navigation : undefined, gaps: gapsOf(frames.time_s, frames.status)});
  flight.draw.push(() => plots.draw());
  const note = (compared ? 'The paper’s figure 3.4. ' : '') + 'The body in the pad frame' +
      (compared ? ': vision over navigation. ' : ', by vision. ') + 'Shaded: frames without a pose. Drag to zoom all, double-click to see all again.';
  return section(compared ? 'Vision and navigation' : 'Vision', note,
      legend([[`background:${'var(--vision)'}`, 'vision'], ['background:var(--sigma);height:.8em', '± 1 σ'],
              ...(compared ? [['background:var(--navigation)', 'navigation']] : []), ['background:var(--gap);height:.8em', 'no pose']]), plots.element);
}

// The way the vehicle came, as the ground station shows it.
function flightScene(flight) {
  const scene = new Scene();
  const {vision} = flight.frames;
  const trail = flight.frames.time_s.map((t, i) => [vision[0][i], vision[1][i], vision[2][i]]).filter((p) => p.every((v) => v != null));
  scene.element.addEventListener('perch-remove', () => scene.dispose(), {once: true});
  flight.draw.push(() => {
    if (flight.pad) scene.setPad(flight.pad);
    scene.show(trail.length ? {position: trail[trail.length - 1]} : null, trail);
  });
  return section('The way it came', 'In the pad frame, the vehicle where it was last. Drag to turn, wheel or pinch to zoom.', scene.element);
}

function residualPlots(flight, group) {
  const {frames} = flight;
  const under = shadeGaps(gapsOf(frames.time_s, frames.status));
  const grid = element('div', {class: 'six'});
  for (let i = 0; i < 6; ++i) {
    const parent = grid.appendChild(element('figure'));
    const error = frames.error_cm_deg[i];
    const sigma = frames.sigma_cm_deg[i];
    const bound = (sign) => sigma.map((s, k) => (s == null || error[k] == null ? null : sign * 2 * s));
    const none = {stroke: 'transparent', points: {show: false}};
    flight.draw.push(() => timePlot(parent, group, {
      label: `${STATES[i]} error [${shownUnit(i)}]`, drawUnder: under,
      series: [Object.assign({label: '+2σ', value: (p, v) => short(v)}, none), Object.assign({label: '−2σ', value: (p, v) => short(v)}, none),
               line('error', theme('vision'), frames.time_s.length)],
      bands: [{series: [1, 2], fill: theme('band')}],
      data: [frames.time_s, bound(1), bound(-1), error],
    }));
  }
  return section('Residuals', 'Vision minus navigation. The band is ± 2 σ of vision’s own covariance: 95 % of the errors belong in it. A line beside zero is a DC offset: calibration, not noise.',
      legend([['background:var(--vision)', 'error'], ['background:var(--band);height:.8em', '± 2 σ as vision claims']]), grid);
}

// The paper's figure 3.5 as bars in HTML: they print and fit any width.
function rmsBars(summary) {
  const half = (states) => {
    const values = states.map((i) => [scaled(summary.errors[STATES[i]].rms, shownScale(i)),
                                      scaled(summary.errors[STATES[i]].rms_without_dc_offset, shownScale(i))]);
    const most = Math.max(...values.flat(), ...states.map((i) => PAPER_RMS[i]));
    const width = (value) => `width:${(100 * value / most).toFixed(2)}%`;
    return element('div', {class: 'bars'}, ...states.flatMap((i, k) => [
      element('b', {}, STATES[i]),
      element('div', {class: 'bar'},
          element('div', {class: 'paper', style: width(PAPER_RMS[i])}, element('span', {}, 'paper ' + withUnit(PAPER_RMS[i], i))),
          element('div', {class: 'rms', style: width(values[k][0])}), element('div', {class: 'noise', style: width(values[k][1])})),
      element('span', {class: 'values'}, element('b', {}, withUnit(short(values[k][0]), i)),
          element('small', {}, `${short(values[k][1])} without DC`)),
    ]));
  };
  return section('RMS error of each state', 'The paper’s figure 3.5. Its own values, from a 320 × 240 camera about 1 m above the pad, stand faint behind.',
      legend([['background:var(--vision);height:.7em', 'RMS'], ['background:var(--navigation);height:.7em', 'RMS without the DC offset'],
              ['background:var(--paper);height:.9em', 'the paper']]),
      element('div', {class: 'halves'}, half([0, 1, 2]), half([3, 4, 5])));
}

function errorTable(summary) {
  const rows = STATES.map((state, i) => {
    const e = summary.errors[state];
    const cell = (value, format = short) => withUnit(format(scaled(value, shownScale(i))), i);
    return [state, cell(e.rms), cell(e.dc_offset, signed), cell(e.rms_without_dc_offset), cell(e.median), cell(e.p95), cell(e.max)];
  });
  const size = (name, e, shown) => [name, shown(e.rms), '', '', shown(e.median), shown(e.p95), shown(e.max)];
  rows.push(size('position', summary.errors.position_m, cm), size('attitude', summary.errors.rotation_rad, deg));
  return section('Errors and DC offsets', 'The DC offset is the mean of vision minus navigation, what the paper’s calc_dc_offset removes: mount, intrinsics or pad place that are off. Median, 95th percentile and largest are of absolute values.',
      table(['', 'RMS', 'DC offset', 'RMS without it', 'median', '95 %', 'largest'], rows));
}

// What errors may depend on: where the frames have it, and how it is shown.
const CURVES = {
  distance: {column: 'range_m', words: 'distance', label: 'distance camera to target [m]', scale: 1, unit: ' m'},
  view_angle: {column: 'view_angle_deg', words: 'view angle', label: 'angle to the target’s normal [°]', scale: DEG, unit: '°'},
  visible: {column: 'visible', words: 'visible', label: 'visible part of the target', scale: 1, unit: ''},
  speed: {column: 'speed_m_s', words: 'speed', label: 'speed, by navigation [m/s]', scale: 1, unit: ' m/s'},
};

function errorCurves(flight) {
  const {summary, frames} = flight;
  const curves = summary.error_curves.filter((curve) => curve.bins.length);
  const byTruth = summary.truth != null;
  const figures = curves.map((curve) => {
    const {column, label, scale, unit} = CURVES[curve.by];
    const parent = element('figure', {class: 'wide'});
    flight.draw.push(() => errorScatter(parent, {x: frames[column], y: frames.position_error_cm, label, unit, errorLabel: 'position error [cm]', errorUnit: ' cm',
      bins: curve.bins.map((b) => ({from: scale * b.from, to: scale * b.to, rms: scaled(b.position_rms_m, 100), low: scaled(b.position_rms_low_m, 100), high: scaled(b.position_rms_high_m, 100)}))}));
    return parent;
  });
  const edge = (value) => String(+value.toPrecision(6));
  const rows = curves.flatMap((curve) => curve.bins.filter((b) => b.frames).map((b) => {
    const {words, scale, unit} = CURVES[curve.by];
    return [`${words} ${edge(scale * b.from)} – ${edge(scale * b.to)}${unit}`, String(b.frames), cm(b.position_rms_m),
            b.position_rms_low_m == null ? '–' : `${short(100 * b.position_rms_low_m)} – ${cm(b.position_rms_high_m)}`, cm(b.position_median_m), deg(b.rotation_rms_rad)];
  }));
  return section('What the error depends on', `Against ${byTruth ? 'the flight’s exact truth' : 'navigation'}. The band is the RMS’s 95 % interval, by how it varies from second to second; there is none of less than three seconds.`,
      legend([['background:var(--vision);width:.5em;height:.5em;border-radius:50%', 'a frame'], ['background:var(--text)', 'RMS of a bin'], ['background:var(--band);height:.8em', '95 % interval']]),
      element('div', {class: 'pairs'}, ...figures),
      element('details', {}, element('summary', {}, 'In numbers'), table(['', 'frames', 'position RMS', '95 % interval', 'median', 'attitude RMS'], rows)));
}

function touchDown(flight) {
  const {touch_down: down} = flight.summary, {forecasts} = flight;
  const figure = (values, label, unit) => {
    const parent = element('figure', {class: 'wide'});
    const largest = Math.max(...forecasts.to_go_s, 0.1);
    flight.draw.push(() => errorScatter(parent, {x: forecasts.to_go_s, y: values, label: 'before touch-down [s]', unit: ' s', errorLabel: label, errorUnit: unit, height: 200,
      bins: [{from: 0, to: largest, rms: null, low: null, high: null}]}));
    return parent;
  };
  return section('Touch-down foretold', `Navigation has the body on the pad at ${short(down.at_s)} s, at x ${short(100 * down.place_m[0])}, y ${short(100 * down.place_m[1])} cm. Each frame’s state, going on as it then moved, says where and when that will be; this is how far off it was. Close to the ground it is what a landing acts on.`,
      forecasts.to_go_s.length ? element('div', {class: 'pairs'}, figure(forecasts.place_cm, 'place off by [cm]', ' cm'), figure(forecasts.time_s.map(Math.abs), 'time off by [s]', ' s')) : element('p', {class: 'note'}, 'No state of the last ten seconds came down.'),
      down.forecasts.length ? table(['before touch-down', 'frames', 'place RMS', 'median', 'time RMS', 'mean, late is above 0'], down.forecasts.map((f) =>
          [`${f.from_s} – ${f.to_s} s`, String(f.frames), cm(f.place_rms_m), cm(f.place_median_m), short(f.time_rms_s) + ' s', signed(f.time_mean_s) + ' s'])) : null);
}

function greyLevels(flight, group) {
  const {frames} = flight;
  const parent = element('figure', {class: 'wide'});
  const {time_s: times, threshold, white, black, grey} = frames;
  flight.draw.push(() => greyPlot(parent, group, {times, threshold, white, black, grey}));
  return section('Light', 'The paper’s plot_hist over the flight: how dark or light the pictures are, deeper where more pixels are of that grey; what the target’s white and black are in them; and the threshold, in the frames in which the method took one.', parent);
}

function detectionTimeline(flight, group) {
  const {summary, frames} = flight;
  const {counts, gaps} = summary.detection;
  const parent = element('figure', {class: 'wide strip'});
  flight.draw.push(() => statusStrip(parent, group, frames.time_s, frames.status));
  const present = STATUSES.map((s, i) => [`background:${i === 5 ? 'var(--text)' : s.colour};height:.8em`, `${s.words} ${counts[s.name]}`, counts[s.name]])
      .filter((item) => item[2]);
  const reasons = (gap) => Object.entries(gap.reasons).map(([name, n]) => `${name.replace('_', ' ')} ${n}`).join(', ');
  const longest = [...gaps].sort((a, b) => b.frames - a.frames).slice(0, 20).sort((a, b) => a.first_frame - b.first_frame);
  return section('Detection', gaps.length ? null : 'Every frame has a pose.', legend(present), parent,
      gaps.length > longest.length ? element('p', {class: 'note'}, `The ${longest.length} longest of ${gaps.length} gaps:`) : null,
      gaps.length ? table(['gap at', 'first frame', 'frames', 'length', 'reasons'], longest.map((g) =>
          [`${g.start_s.toFixed(3)} s`, String(g.first_frame), String(g.frames), `${g.duration_s.toFixed(3)} s`, reasons(g)]), {class: 'reasons'}) : null);
}

const CAUSE_UNITS = {rad: [DEG, '°'], m: [100, ' cm'], s: [1000, ' ms'], '': [100, ' %']};

function attributionTable({attribution: a}) {
  const values = (cause) => cause.value.map((value, i) => {
    const [scale, unit] = CAUSE_UNITS[cause.unit];
    return `${signed(scale * value)} ± ${short(scale * cause.sigma[i])}${unit}`;
  }).join(', ');
  return section('What would explain the errors', `Of ${cm(a.position_rms_m)} and ${deg(a.rotation_rms_rad)} RMS, the six constant mistakes below together explain all but ${cm(a.position_noise_rms_m)} and ${deg(a.rotation_noise_rms_rad)}: noise, drift, or what is not among them. Fitted to vision minus navigation; the value is what the configuration lacks, mount and lever arm in the axes of the body, the pad's in its own. Where "alone" is large and "only by it" small, another cause would do as well; perch-calibrate-mount tells such apart. The deviations take errors for independent from frame to frame: where navigation drifts they are too small.`,
      table(['cause', 'lacks', 'alone explains', 'only by it'], a.causes.map((cause) =>
          [cause.cause, values(cause), percent(cause.alone_explains), percent(cause.only_it_explains)])));
}

function consistency(flight, group) {
  const {summary: {consistency: c}, frames} = flight;
  const parts = [];
  const show = (label, values) => {
    const parent = element('figure', {class: 'wide'});
    flight.draw.push(() => consistencyPlot(parent, group, {label, times: frames.time_s, values, gaps: gapsOf(frames.time_s, frames.status)}));
    parts.push(parent);
  };
  const totals = (mean, [low, high], inside) => `an honest covariance gives 6, with independent frames within ${short(low)} to ${short(high)} 95 times of 100; within the single frame’s bounds, 1.24 to 14.4: ${percent(inside)} (95 % when honest).`;
  const judge = (mean, [low, high], worse, better) => (mean > high ? worse : mean < low ? better : 'As honest as it can be told.');
  if (c.mean_nees != null) {
    const byTruth = c.reference === 'truth';
    const verdict = judge(c.mean_nees, c.mean_nees_bounds_95, byTruth ? 'Vision is less accurate than it claims.' : 'Vision is less accurate than it claims, or navigation is the noisier: its noise counts as vision’s here.', 'Vision is more accurate than it claims.');
    parts.push(element('p', {class: 'note'}, `NEES: vision against ${byTruth ? 'the flight’s exact truth' : 'navigation'}. Mean ${short(c.mean_nees)} over ${plural(c.frames, 'frame')}; ${totals(c.mean_nees, c.mean_nees_bounds_95, c.fraction_of_frames_inside_95)} ${verdict}`));
    show('NEES', frames.nees);
  }
  if (c.mean_nis != null) {
    const verdict = judge(c.mean_nis, c.mean_nis_bounds_95, 'Poses jump more than vision claims and the motion allows for.', 'Vision and the motion allow for more than happens.');
    parts.push(element('p', {class: 'note'}, `NIS: each pose against what the filter expected, which needs no reference. Mean ${short(c.mean_nis)} over ${plural(c.innovations, 'frame')}; ${totals(c.mean_nis, c.mean_nis_bounds_95, c.fraction_of_innovations_inside_95)} ${verdict}`));
    show('NIS', frames.nis);
  }
  return section('Consistency', null, legend([['background:var(--vision);width:.5em;height:.5em;border-radius:50%', 'a frame'], ['background:var(--navigation)', 'running mean of 25'], ['background:var(--muted);height:1px', 'bounds: dotted of a frame, dashed of the mean']]), ...parts);
}

function latencies(frames) {
  const values = frames.total_us.filter((us, i) => us > 0 && frames.status[i] !== '5').sort((a, b) => a - b);
  if (values.length < 2) return null;
  const low = values[0], high = values[values.length - 1], bins = 48;
  const step = Math.log(high / low) / bins || 1;
  const counts = new Array(bins).fill(0);
  for (const us of values) counts[Math.min(bins - 1, Math.floor(Math.log(us / low) / step))]++;
  const edge = (i) => ms(low * Math.exp(i * step));
  return histogramFigure({title: 'Time a frame, on a logarithmic scale', counts, tip: (i) => `${plural(counts[i], 'frame')}: ${edge(i)} to ${edge(i + 1)}`,
                          ends: [ms(low), 'median ' + ms(values[values.length >> 1]), ms(high)]});
}

function stageTable({summary, frames}) {
  const stages = summary.stages;
  const most = Math.max(...stages.map((s) => s.share || 0), 1e-9);
  const bar = (share) => element('span', {class: 'share'}, element('i', {style: `width:${(100 * share / most).toFixed(1)}%`}), percent(share));
  const rows = stages.map((s) => [s.stage, short(s.mean_us), short(s.median_us), short(s.p99_us), String(s.frames), bar(s.share)]);
  const t = summary.total_us;
  rows.push(['total', short(t.mean), short(t.median), short(t.p99), '', percent(1)]);
  return section('Cost of each stage', 'The paper’s table 3.2; there segmentation and threshold took 72 % and all image processing 90 % of 33 ms on a 233 MHz Pentium. Mean, median and 99 % are of the frames in which a stage ran.',
      latencies(frames), table(['stage', 'mean µs', 'median µs', '99 % µs', 'frames', 'share of the total'], rows, {class: 'stages'}));
}

function pictureStrip(pictures, compared) {
  return section('Pictures', `The recovered outline (orange) and the measured points (blue) in the best, the median and the worst frame by ${compared ? 'position error' : 'reprojection error'}, and in the longest gap.`,
      element('div', {class: 'pictures'}, ...pictures.map((p) => {
        const facts = [];
        if (p.range_m != null) facts.push(`${short(p.range_m)} m away`);
        if (p.position_error_cm != null) facts.push(`off by ${short(p.position_error_cm)} cm, ${short(p.rotation_error_deg)}°`);
        if (p.reprojection_px != null) facts.push(`reprojection ${short(p.reprojection_px)} px`);
        if (p.status !== 'ok') facts.push(p.status.replace('_', ' '));
        return element('figure', {}, element('img', {src: 'data:image/jpeg;base64,' + p.jpeg, alt: `frame ${p.frame} with the recovered target`}),
            element('figcaption', {}, element('b', {}, p.why), ` frame ${p.frame}${p.name ? ', ' + p.name : ''}`, element('br'), facts.join(' · ')));
      })));
}

function problemList(problems) {
  const shown = problems.slice(0, 200);
  return section('Problems met', problems.length ? null : 'None.',
      problems.length ? element('ul', {class: 'problems'}, ...shown.map((p) => element('li', {}, p))) : null,
      problems.length > shown.length ? element('p', {class: 'note'}, `and ${problems.length - shown.length} more, all in summary.json`) : null);
}

// ---- the page ----

function flightPage(flight, index) {
  const {summary, pictures, frames} = flight;
  flight.draw = [];
  const group = new TimeGroup('flight' + index);
  const compared = summary.comparison === 'compared';
  const page = element('article', {},
      element('h2', {}, summary.flight || 'flight', summary.target ? element('small', {}, summary.target) : null),
      element('p', {class: 'lead'}, inWords(summary)),
      compared ? null : element('p', {class: 'notice'}, WHY_NOT_COMPARED[summary.comparison] || `Nothing to compare with: ${summary.comparison}. Vision alone is shown.`),
      tiles(summary),
      frames.each > 1 ? element('p', {class: 'notice'}, `A long flight: of every ${frames.each} frames the worst is plotted. Numbers and the Light are of all.`) : null);
  if (frames.time_s.length) page.append(statePlots(flight, group), flightScene(flight), detectionTimeline(flight, group));
  if (compared) page.append(rmsBars(summary), errorTable(summary), residualPlots(flight, group));
  if (summary.error_curves.some((curve) => curve.bins.length)) page.append(errorCurves(flight));
  if (summary.touch_down) page.append(touchDown(flight));
  if (summary.attribution) page.append(attributionTable(summary));
  if (summary.consistency.mean_nees != null || summary.consistency.mean_nis != null) page.append(consistency(flight, group));
  if (frames.grey) page.append(greyLevels(flight, group));
  if (summary.stages.length) page.append(stageTable(flight));
  if (pictures.length) page.append(pictureStrip(pictures, compared));
  page.append(problemList(summary.problems));
  return page;
}

function main() {
  const root = /** @type {HTMLElement} */ (document.getElementById('report'));
  const json = (id) => JSON.parse(document.getElementById(id)?.textContent ?? 'null');
  const configuration = json('configuration'), season = json('season'), before = json('before');
  const parsed = [...document.querySelectorAll('script.flight')].map((source) => JSON.parse(source.textContent));
  const many = season && season.flight.length > 1 ? season : null;
  root.replaceChildren(element('header', {}, element('h1', {}, many ? 'Perch season report' : 'Perch flight report')));
  const place = element('div');
  let shown = 0;

  const show = (index) => {
    if (!parsed.length) return;
    shown = index;
    place.querySelectorAll('figure, .scene').forEach((figure) => figure.dispatchEvent(new Event('perch-remove')));
    const flight = parsed[index];
    place.replaceChildren(flightPage(flight, index));
    for (const draw of flight.draw) draw();
  };
  const choose = (index) => {
    history.replaceState(null, '', '#' + index);
    show(index);
    place.scrollIntoView({behavior: 'smooth'});
  };

  // Few flights are in this page, many have pages of their own.
  const inPage = many && parsed.length === many.flight.length;
  const overview = many ? seasonPage(many, before, (i) => (inPage ? '#' + i : encodeURIComponent(many.flight[i]) + '/report.html'), inPage ? choose : null) : null;
  if (overview) root.append(overview.element);
  root.append(place);
  if (configuration) root.append(element('details', {}, element('summary', {}, 'Configuration'), element('pre', {}, configuration)));
  if (!parsed.length && !many) return place.append(element('p', {class: 'notice'}, 'No flight.'));

  const draw = (index) => {
    if (overview) overview.draw();
    show(index);
  };
  const wanted = parseInt(location.hash.slice(1), 10);
  draw(wanted >= 0 && wanted < parsed.length ? wanted : 0);
  redrawWhenColoursChange(() => draw(shown));
}

main();
