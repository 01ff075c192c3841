// Builds the report from the JSON in the page. Text goes in as text, never as HTML.
import {element, legend} from '../common/element.js';
import {DEG, short} from '../common/format.js';
import {STATES, STATUSES, isAngle} from '../common/names.js';
import {theme} from '../common/theme.js';
import {TimeGroup, gapsOf, line, scatterPlot, shadeGaps, statusStrip, timePlot} from '../views/plots.js';
import {StatePlots} from '../views/state_plots.js';
import {Scene} from '../views/scene.js';
import {redrawWhenColoursChange, section, table, tileRow} from './parts.js';
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

function distances(flight) {
  const {summary, frames} = flight;
  const parent = element('figure', {class: 'wide'});
  flight.draw.push(() => scatterPlot(parent, frames.range_m, frames.position_error_cm, summary.distance_bins));
  return section('Error against distance', null,
      legend([['background:var(--vision);width:.5em;height:.5em;border-radius:50%', 'a frame'], ['background:var(--text)', 'RMS of a bin']]), parent,
      table(['distance', 'frames', 'position RMS', 'median', 'attitude RMS'], summary.distance_bins.map((b) =>
          [`${+b.from_m.toPrecision(6)} – ${+b.to_m.toPrecision(6)} m`, String(b.frames), cm(b.position_rms_m), cm(b.position_median_m), deg(b.rotation_rms_rad)])));
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

function consistencyPlot(flight, group) {
  const {summary, frames} = flight;
  const c = summary.consistency;
  const parent = element('figure', {class: 'wide'});
  const constant = (value) => frames.time_s.map(() => value);
  const dashed = (label, dash) => ({label, stroke: theme('muted'), width: 1, dash, points: {show: false}, value: (p, v) => short(v)});
  flight.draw.push(() => timePlot(parent, group, {
    label: 'NEES', height: 230,
    scales: {y: {distr: 3}},
    drawUnder: shadeGaps(gapsOf(frames.time_s, frames.status)),
    series: [dashed('2.5 %', [2, 4]), dashed('97.5 %', [2, 4]), dashed('expected', [8, 4]),
             line('NEES', theme('vision'), frames.time_s.length)],
    data: [frames.time_s, constant(1.2373), constant(14.4494), constant(6), frames.nees.map((v) => (v > 0 ? v : null))],
  }));
  const [low, high] = c.mean_nees_bounds_95;
  const byTruth = c.reference === 'truth';
  const verdict = c.mean_nees > high ? (byTruth ? 'vision is less accurate than it claims.' : 'vision is less accurate than it claims, or navigation is the noisier: its noise counts as vision’s here.') : c.mean_nees < low ? 'vision is more accurate than it claims.' : 'as honest as it can be told.';
  return section('Consistency', `Against ${byTruth ? 'the flight’s exact truth' : 'navigation'}: mean NEES ${short(c.mean_nees)} over ${plural(c.frames, 'frame')}; an honest covariance gives 6, with independent frames within ${short(low)} to ${short(high)} 95 times of 100: ${verdict} Within the single frame’s bounds, 1.24 to 14.4: ${percent(c.fraction_of_frames_inside_95)} (95 % when honest).`, parent);
}

function stageTable(summary) {
  const stages = summary.stages;
  const most = Math.max(...stages.map((s) => s.share || 0), 1e-9);
  const bar = (share) => element('span', {class: 'share'}, element('i', {style: `width:${(100 * share / most).toFixed(1)}%`}), percent(share));
  const rows = stages.map((s) => [s.stage, short(s.mean_us), short(s.median_us), short(s.p99_us), String(s.frames), bar(s.share)]);
  const t = summary.total_us;
  rows.push(['total', short(t.mean), short(t.median), short(t.p99), '', percent(1)]);
  return section('Cost of each stage', 'The paper’s table 3.2; there segmentation and threshold took 72 % and all image processing 90 % of 33 ms on a 233 MHz Pentium. Mean, median and 99 % are of the frames in which a stage ran.',
      table(['stage', 'mean µs', 'median µs', '99 % µs', 'frames', 'share of the total'], rows, {class: 'stages'}));
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
      tiles(summary));
  if (frames.time_s.length) page.append(statePlots(flight, group), flightScene(flight), detectionTimeline(flight, group));
  if (compared) page.append(rmsBars(summary), errorTable(summary), residualPlots(flight, group), distances(flight));
  if (summary.attribution) page.append(attributionTable(summary));
  if (summary.consistency.mean_nees != null) page.append(consistencyPlot(flight, group));
  if (summary.stages.length) page.append(stageTable(summary));
  if (pictures.length) page.append(pictureStrip(pictures, compared));
  page.append(problemList(summary.problems));
  return page;
}

function main() {
  const root = /** @type {HTMLElement} */ (document.getElementById('report'));
  const json = (id) => JSON.parse(document.getElementById(id)?.textContent ?? 'null');
  const configuration = json('configuration'), season = json('season');
  const parsed = [...document.querySelectorAll('script.flight')].map((source) => JSON.parse(source.textContent));
  const many = season && season.flight.length > 1 ? season : null;
  root.append(element('header', {}, element('h1', {}, many ? 'Perch season report' : 'Perch flight report')));
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
  const overview = many ? seasonPage(many, (i) => (inPage ? '#' + i : encodeURIComponent(many.flight[i]) + '/report.html'), inPage ? choose : null) : null;
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
