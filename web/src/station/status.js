// How the run goes: the pad, the link and its clock, why the last frame failed, what the doctor says, the recording.
import {element} from '../common/element.js';
import {fixed, short} from '../common/format.js';
import {STATUSES} from '../common/names.js';

const MOST_EVENTS = 30;
const DOING = {follows: 'follows the pad', searches: 'searches the pad', blind: 'knows no way', rests: 'is not moved', centres: 'goes to its middle'};
const gigabytes = (bytes) => (bytes >= 1e9 ? `${short(bytes / 1e9)} GB` : `${short(bytes / 1e6)} MB`);

export class Status {
  constructor() {
    this.list = element('dl', {class: 'facts'});
    this.findings = element('ul', {class: 'findings'});
    this.events = element('ol', {class: 'events', id: 'events'});
    this.element = element('section', {class: 'card status', 'aria-label': 'status'}, element('h2', {}, 'Status'), this.list, this.findings);
    this.eventsElement = element('section', {class: 'card log', 'aria-label': 'events'}, element('h2', {}, 'Events'), this.events);
    this.facts = new Map();
  }

  fact(name, words, mood = '') {
    let value = this.facts.get(name);
    if (!value) {
      value = element('dd', {id: `fact-${name.replace(' ', '-')}`});
      this.facts.set(name, value);
      this.list.append(element('dt', {}, name), value);
    }
    value.textContent = words;
    value.className = mood;
  }

  // Of the frame that is looked at.
  showRow(row, column, picture, hello) {
    if (!row) return this.fact('frame', 'none yet', 'wait');
    const {words} = STATUSES[row.status];
    const v = (name) => row.values[column[name]];
    const problem = picture?.ns === row.ns ? picture.overlay.problem : '';
    this.fact('frame', row.status === 0 ? `pose of ${v('features')} features, ${short(v('reprojection'))} px` : problem || words, row.status === 0 ? 'ok' : 'bad');
    this.fact('time', `${short(v('estimate_ms'))} ms to estimate` + (isFinite(v('latency_ms')) ? `, ${fixed(v('latency_ms'), 1)} ms since exposure` : ''));
    if (!hello.pan_tilt) return;
    const known = isFinite(v('pan')) && isFinite(v('tilt'));
    this.fact('head', (known ? `pan ${fixed(v('pan'), 1)}°, tilt ${fixed(v('tilt'), 1)}°` : 'angles not known') +
              (isFinite(v('zoom')) ? `, zoom ${fixed(v('zoom'), 2)}` : ''), known ? 'ok' : 'bad');
  }

  /** @param {any} status as perch-live tells it (src/apps/live_station.cc) */
  showStatus(status, lastFailure) {
    const ok = status.counts.ok, all = status.frames;
    this.fact('frames', `${ok} of ${all} with a pose (${all ? fixed(100 * ok / all, 1) : '–'} %)`);
    this.fact('last failure', lastFailure || 'none seen', lastFailure ? 'wait' : 'ok');
    const {camera, recording, link, head} = status;
    this.fact('camera', camera.problem || (camera.dropped ? `${camera.dropped} pictures lost` : 'well'), camera.problem ? 'bad' : camera.dropped ? 'wait' : 'ok');
    if (head) this.fact('head drive', head.ready ? DOING[head.doing] ?? head.doing : 'does not answer', !head.ready ? 'bad' : head.doing === 'follows' ? 'ok' : 'wait');
    if (link) {
      this.fact('link', link.text, link.heard ? 'ok' : 'bad');
      this.fact('autopilot', link.heard ? link.autopilot : 'not heard');
      this.fact('time sync', link.clock_ms == null ? 'clocks not matched' : `clocks matched to ${short(link.clock_ms)} ms`, link.clock_ms == null ? 'bad' : 'ok');
    } else {
      this.fact('link', 'none configured');
    }
    if (recording.on) {
      this.fact('recording', `${recording.folder}: ${recording.frames} pictures` + (recording.dropped ? `, ${recording.dropped} dropped` : ''), recording.problem ? 'bad' : 'ok');
      this.fact('disk left', gigabytes(recording.disk_left), recording.disk_left < 1e9 ? 'bad' : 'ok');
    } else {
      this.fact('recording', recording.problem || (recording.possible ? 'off' : 'no folder configured'), recording.problem ? 'bad' : '');
    }
    this.findings.replaceChildren(...(link?.findings ?? []).map((finding) => element('li', {class: finding.startsWith('error') ? 'bad' : finding.startsWith('warning') ? 'wait' : ''}, finding)));
  }

  clearEvents() { this.events.replaceChildren(); }
  addEvent(what) {
    this.events.prepend(element('li', {}, what));
    while (this.events.children.length > MOST_EVENTS) this.events.lastChild?.remove();
  }
}
