// What attacks on the ground station cost the estimator: a simulated landing three times over, alone, with two pages that
// watch, and with 1000 connections, slow requests, wrong tokens, malformed frames and pages that stall besides.
//   node benchmarks/station_load.mjs build/release/bin/perch-live [SECONDS]
// Prints the latencies of perch-live's own summary. The attacker runs on the same machine, at the lowest priority: what it
// takes of the processor itself is in the numbers.
import {spawn} from 'node:child_process';
import {mkdtempSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import net from 'node:net';
import {setPriority, tmpdir} from 'node:os';
import {join, resolve} from 'node:path';

const [program, seconds = '12'] = process.argv.slice(2);
const source = resolve(import.meta.dirname ?? new URL('.', import.meta.url).pathname, '..');
const folder = mkdtempSync(join(tmpdir(), 'perch-load-'));
const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
setPriority(19);
writeFileSync(join(folder, 'run.yaml'), `target: ${source}/configs/targets/sharp.yaml
camera: {source: 'sim:${source}/configs/simulation/landing.yaml'}
outputs: {station: {listen: '127.0.0.1:0'}}
`);

const key = 'Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n';
const upgrade = (port) => `GET /live HTTP/1.1\r\nHost: 127.0.0.1:${port}\r\nOrigin: http://127.0.0.1:${port}\r\n${key}\r\n`;
const frame = (text) => Buffer.concat([Buffer.from([0x81, 128 | text.length, 0, 0, 0, 0]), Buffer.from(text)]);
const open = (port, first) => {
  const socket = net.connect(port, '127.0.0.1', () => socket.write(first));
  socket.on('error', () => {});
  socket.setTimeout(20000, () => socket.destroy());
  return socket;
};

// A page: acknowledges whatever comes, message by message as far as it can be told from the headers.
function page(port) {
  const socket = open(port, upgrade(port));
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

async function attack(port, until) {
  const held = [];
  while (Date.now() < until) {
    for (let i = 0; i < 40 && held.length < 1000; ++i) held.push(open(port, 'GET / HTTP/1.1\r\nHo'));            // slow-loris
    open(port, `POST /login HTTP/1.1\r\nHost: 127.0.0.1:${port}\r\nOrigin: http://evil.example\r\nContent-Length: 5\r\n\r\ntoken`);
    open(port, '\0\x01\x02 / HTTP/9.9\r\n\r\n');
    open(port, `GET /../../etc/passwd HTTP/1.1\r\nHost: 127.0.0.1:${port}\r\n\r\n`);
    open(port, upgrade(port).replace('Origin: http://127.0.0.1', 'Origin: http://evil.example'));
    const bad = open(port, upgrade(port));
    setTimeout(() => bad.write(Buffer.from([0xf3, 0xff, 1, 2, 3])), 50);
    const stalled = open(port, upgrade(port));
    setTimeout(() => stalled.write(frame('{"from":{"session":"","sequence":0}}')), 50);
    stalled.pause();
    held.push(stalled);
    await sleep(50);
  }
  for (const socket of held) socket.destroy();
}

async function run(name, load) {
  const live = spawn(program, ['--config', 'run.yaml', '--duration', seconds, '--summary', 'summary.json'], {cwd: folder});
  setPriority(live.pid, 0);
  let log = '';
  live.stderr.on('data', (text) => { log += text; });
  while (!/station: port \d+/.test(log)) await sleep(20);
  const port = Number(/station: port (\d+)/.exec(log)[1]);
  const ended = new Promise((done) => live.on('exit', done));
  const sockets = await load(port, Date.now() + 1000 * Number(seconds) - 500);
  await ended;
  sockets?.forEach((socket) => socket.destroy());
  const summary = JSON.parse(readFileSync(join(folder, 'summary.json'), 'utf8'));
  const stage = (s) => `${s} ${summary.latency_us[s].median.toFixed(0)} / ${summary.latency_us[s].p99.toFixed(0)}`;
  console.log(`${name.padEnd(16)} ${stage('estimate')}   ${stage('total')} us (median / p99), ${summary.frames} frames, station ${summary.station.cpu_s.toFixed(2)} s of CPU, ` +
              `${summary.station.refused} refused, ${(summary.station.bytes_out / 1000).toFixed(0)} kB out, peak ${(summary.peak_memory_bytes / 1e6).toFixed(0)} MB`);
}

await run('alone', () => null);
await run('two pages', (port) => [page(port), page(port)]);
await run('under attack', async (port, until) => { const pages = [page(port), page(port)]; await attack(port, until); return pages; });
rmSync(folder, {recursive: true, force: true});
