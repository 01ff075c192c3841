// What attacks on the ground station cost the estimator: a simulated flight with two pages that watch, and the same with an
// attack besides, in turns (without, with, with, without), so that what changes by itself changes both.
//   node benchmarks/station_load.mjs build/release/bin/perch-live [SECONDS [ATTACK...]]
// Prints the estimator's time a frame, of all runs of a kind together, but for the first second of each. The attacker runs on the same machine, at the lowest priority: what it
// takes of the processor itself is in the numbers.
import {spawn} from 'node:child_process';
import {mkdtempSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import net from 'node:net';
import {setPriority, tmpdir} from 'node:os';
import {join, resolve} from 'node:path';

const [program, seconds = '12', ...chosen] = process.argv.slice(2);
const source = resolve(new URL('.', import.meta.url).pathname, '..');
const folder = mkdtempSync(join(tmpdir(), 'perch-load-'));
const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
setPriority(19);
const RATE = 50;  // Hz
const TOKEN = 'correct-horse-battery-staple';
writeFileSync(join(folder, 'token'), TOKEN);
// 50 Hz of small pictures, of which the simulation makes a hundred a second and core.
writeFileSync(join(folder, 'sim.yaml'), `target: ${source}/configs/targets/sharp.yaml
camera: {width: 320, height: 240, rate_hz: ${RATE}, lens: LENSMODEL_PINHOLE, intrinsics: [226, 226, 159.5, 119.5]}
flight: {start_height: 2, start_aside: 0.2, touchdown_height: 1.5, duration: ${Number(seconds) + 2}}
`);
writeFileSync(join(folder, 'run.yaml'), `target: ${source}/configs/targets/sharp.yaml
camera: {source: 'sim:sim.yaml'}
outputs: {station: {listen: '127.0.0.1:0', token: token}}
`);

const open = (port, first) => {
  const socket = net.connect(port, '127.0.0.1', () => socket.write(first));
  socket.on('error', () => {});
  socket.setTimeout(20000, () => socket.destroy());
  return socket;
};
const headers = (port, origin = `http://127.0.0.1:${port}`) => `Host: 127.0.0.1:${port}\r\nOrigin: ${origin}\r\n`;
const logIn = (port, token, origin) => `POST /login HTTP/1.1\r\n${headers(port, origin)}Content-Type: application/x-www-form-urlencoded\r\nContent-Length: ${token.length + 6}\r\n\r\ntoken=${token}`;
const upgrade = (port, cookie, origin) => `GET /live HTTP/1.1\r\n${headers(port, origin)}Cookie: ${cookie}\r\nSec-WebSocket-Version: 13\r\n` +
    'Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n\r\n';
const frame = (text) => Buffer.concat([Buffer.from([0x81, 128 | text.length, 0, 0, 0, 0]), Buffer.from(text)]);

async function session(port) {
  const socket = open(port, logIn(port, TOKEN));
  const reply = await new Promise((done) => socket.once('data', done));
  socket.destroy();
  return /perch_session=[0-9a-f]+/.exec(String(reply))?.[0] ?? '';
}

// A page: acknowledges whatever comes, message by message as far as it can be told from the headers.
function page(port, cookie) {
  const socket = open(port, upgrade(port, cookie));
  let bytes = Buffer.alloc(0), greeted = false, messages = 0;
  socket.on('data', (data) => {
    bytes = Buffer.concat([bytes, data]);
    if (!greeted) {
      const end = bytes.indexOf('\r\n\r\n');
      if (end < 0) return;
      bytes = bytes.subarray(end + 4);
      greeted = true;
      socket.write(frame('{"from":{"session":"","sequence":0}}'));
    }
    while (bytes.length >= 2) {
      const short = bytes[1] & 127, head = short === 126 ? 4 : short === 127 ? 10 : 2;
      if (bytes.length < head) break;
      const length = short === 126 ? bytes.readUInt16BE(2) : short === 127 ? Number(bytes.readBigUInt64BE(2)) : short;
      if (bytes.length < head + length) break;
      bytes = bytes.subarray(head + length);
      socket.write(frame(`{"ack":${++messages}}`));
    }
  });
  return socket;
}

// One turn of each, fifty times a second. `held` are connections that stay.
const attacks = {
  'malformed HTTP': ({port}) => {
    open(port, '\0\x01\x02 / HTTP/9.9\r\n\r\n');
    open(port, `GET /${'a'.repeat(9000)} HTTP/1.1\r\n\r\n`);
    open(port, `POST /login HTTP/1.1\r\n${headers(port)}Transfer-Encoding: chunked\r\n\r\nfffffffffffffffff\r\n`);
    open(port, `GET /../../etc/passwd HTTP/1.1\r\n${headers(port)}\r\n`);
  },
  // By somebody who has a session: nobody else gets so far.
  'malformed frames': ({port, cookie}) => {
    for (const bytes of [[0xf3, 0xff, 1, 2, 3], [0x81, 0x05, 1, 1, 1, 1, 1], [0x81, 0xff, 0x7f, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0, 0, 0, 0], [...frame('{"ack":99999}')]]) {
      const bad = open(port, upgrade(port, cookie));
      bad.once('data', () => bad.write(Buffer.from(bytes)));
    }
  },
  'slow-loris': ({port, held}) => {
    for (let i = 0; i < 8 && held.length < 1000; ++i) held.push(open(port, 'GET / HTTP/1.1\r\nHo'));
    for (let i = 0; i < 20; ++i) held[Math.floor(Math.random() * held.length)].write('s');
  },
  '1000 connections': ({port, held}) => {
    for (let i = 0; i < 20 && held.length < 1000; ++i) held.push(open(port, ''));
    // Whoever was closed comes again.
    for (let i = 0; i < 4; ++i) {
      const k = Math.floor(Math.random() * held.length);
      if (held[k].readyState !== 'open') held[k] = open(port, '');
    }
  },
  'wrong tokens': ({port}) => { for (let i = 0; i < 4; ++i) open(port, logIn(port, `wrong-token-${Math.random()}`)); },
  'another site': ({port, cookie}) => {
    for (let i = 0; i < 2; ++i) open(port, upgrade(port, cookie, 'http://evil.example'));
    for (let i = 0; i < 2; ++i) open(port, logIn(port, TOKEN, 'http://evil.example'));
  },
  'flood of requests': ({port, cookie}) => {
    const one = `GET /station.js HTTP/1.1\r\n${headers(port)}Cookie: ${cookie}\r\n\r\n`;
    open(port, one.repeat(20)).resume();  // a thousand a second, 40 kB each
  },
  'flood of messages': ({port, cookie}) => {
    const bad = open(port, upgrade(port, cookie));
    bad.once('data', () => bad.write(Buffer.concat(Array(500).fill(frame('{"view":{"grey":true,"binary":true,"close":true}}')))));
  },
  'pages that stall': ({port, cookie, held}) => {
    if (held.length > 200) return;
    const stalled = open(port, upgrade(port, cookie));
    stalled.once('data', () => {
      stalled.write(frame('{"from":{"session":"","sequence":0}}'));
      stalled.pause();
    });
    held.push(stalled);
  },
};
attacks['all of them'] = (what) => Object.entries(attacks).forEach(([name, attack]) => name !== 'all of them' && attack(what));

async function run(attack) {
  const live = spawn(program, ['--config', 'run.yaml', '--duration', seconds, '--summary', 'summary.json', '--output', 'out'], {cwd: folder});
  setPriority(live.pid, 0);
  let log = '';
  live.stderr.on('data', (text) => { log += text; });
  while (!/station: port \d+/.test(log)) await sleep(20);
  const port = Number(/station: port (\d+)/.exec(log)[1]);
  let ended = false;
  const end = new Promise((done) => live.on('exit', () => { ended = true; done(null); }));
  const cookie = await session(port), pages = [page(port, cookie), page(port, cookie)], held = [];
  for (const until = Date.now() + 1000 * Number(seconds) - 500; !ended && Date.now() < until; await sleep(20)) attack?.({port, cookie, held});
  await end;
  for (const socket of [...pages, ...held]) socket.destroy();
  const [head, ...rows] = readFileSync(join(folder, 'out/estimates.csv'), 'utf8').trim().split('\n').map((line) => line.split(','));
  const at = head.indexOf('total [us]');
  return {times: rows.slice(RATE).map((row) => Number(row[at])), ...JSON.parse(readFileSync(join(folder, 'summary.json'), 'utf8'))};
}

const mean = (list) => list.reduce((a, b) => a + b, 0) / list.length;
for (const name of chosen.length ? chosen : Object.keys(attacks)) {
  const summaries = [];
  for (const on of [false, true, true, false]) summaries.push({on, ...await run(on ? attacks[name] : null)});
  const of = (on, value) => mean(summaries.filter((one) => one.on === on).map(value));
  const times = (on) => summaries.filter((one) => one.on === on).flatMap((one) => one.times).sort((x, y) => x - y);
  const [without, within] = [times(false), times(true)];
  const both = (q) => [without, within].map((list) => list[Math.min(list.length - 1, Math.floor(q * list.length))]);
  const words = [['median', 0.5], ['95 %', 0.95], ['99 %', 0.99]].map(([quantile, q]) => {
    const [before, after] = both(q);
    return `${quantile} ${before.toFixed(0)} -> ${after.toFixed(0)} us (x${(after / before).toFixed(2)})`;
  });
  console.log(`${name.padEnd(18)} ${words.join(', ')} of ${without.length} and ${within.length} frames; pictures left out ${of(false, (s) => s.replaced + s.camera.dropped)} -> ${of(true, (s) => s.replaced + s.camera.dropped)}; ` +
              `station ${(100 * of(false, (s) => s.station.cpu_s / s.seconds)).toFixed(1)} -> ${(100 * of(true, (s) => s.station.cpu_s / s.seconds)).toFixed(1)} % of a core, ` +
              `refused ${of(true, (s) => s.station.refused)}, peak ${(1e-6 * of(false, (s) => s.peak_memory_bytes)).toFixed(0)} -> ${(1e-6 * of(true, (s) => s.peak_memory_bytes)).toFixed(0)} MB`);
}
rmSync(folder, {recursive: true, force: true});
