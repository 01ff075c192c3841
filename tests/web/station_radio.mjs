// The ground station's page behind a radio of 64 kbit/s: states keep coming, and soon; pictures are fewer; and what was
// missed while the radio was away is filled in.
import assert from 'node:assert/strict';
import {DESK, badge, csv, equalsTheFiles, frames, inChromium, sleep, start, stop, target, until, watch, write} from './rig.mjs';
import {Radio} from './radio.mjs';

// 30 Hz, as it is flown.
write('fast.yaml', `${target}camera: {width: 320, height: 240, lens: LENSMODEL_PINHOLE, intrinsics: [226, 226, 159.5, 119.5], rate_hz: 30}
flight: {start_height: 4, start_aside: 0.5, touchdown_height: 1.5, duration: 120, hover: 100}
`);
write('run.yaml', `${target}camera: {source: 'sim:fast.yaml'}\noutputs: {station: {}}\n`);

const quantile = (list, q) => list.toSorted((a, b) => a - b)[Math.min(list.length - 1, Math.floor(q * list.length))];

// What the page is sent: how old the newest state is when it is there, and how many pictures come.
function listen(page) {
  const seen = {ages: [], sequences: new Set(), newest: 0, pictures: 0, bytes: 0, whole: false};
  page.on('websocket', (socket) => socket.on('framereceived', ({payload}) => {
    seen.bytes += payload.length;
    if (typeof payload === 'string') return;
    if (payload[0] === 2) return void (seen.pictures += payload[1]);
    seen.whole = payload[1] === 1;  // no gap is left
    const rowBytes = 172;
    for (let at = 4; at < payload.length; at += rowBytes) seen.sequences.add(payload.readUInt32LE(at));
    // The camera's clock is CLOCK_MONOTONIC, and so is node's.
    const age = 1e-6 * Number(process.hrtime.bigint() - payload.readBigInt64LE(payload.length - rowBytes + 8));
    const newest = payload.readUInt32LE(payload.length - rowBytes);
    if (newest > seen.newest) seen.ages.push(age);
    seen.newest = Math.max(seen.newest, newest);
  }));
  return seen;
}

async function measure(what, seen, ms) {
  Object.assign(seen, {ages: [], sequences: new Set(), pictures: 0, bytes: 0});
  const first = seen.newest;
  await sleep(ms);
  const share = [...seen.sequences].filter((one) => one > first).length / (seen.newest - first);
  const ages = [0.5, 0.95, 1].map((q) => quantile(seen.ages, q));
  console.log(`${what}: ${(100 * share).toFixed(0)} % of the states, ${(seen.sequences.size * 1000 / ms).toFixed(1)} a second, ` +
              `${ages.map((ms_) => ms_.toFixed(0)).join(' / ')} ms old when they are there (median / 95 % / worst), ` +
              `${(seen.pictures * 1000 / ms).toFixed(2)} pictures a second, ${(seen.bytes * 8 / ms).toFixed(0)} kbit/s`);
  return {share, ages, pictures: seen.pictures / ms};
}

await inChromium(async (browser) => {
  const live = await start('run.yaml', '127.0.0.1:0', '--output', 'run');
  const radio = await Radio.to(live.port);
  const context = await browser.newContext({viewport: DESK, acceptDownloads: true});
  const page = await context.newPage();
  const seen = listen(page);
  await page.goto(`http://127.0.0.1:${radio.port}/`);
  await until('TRACK', async () => (await badge(page)) === 'TRACK');
  await until('the 3-D view', () => page.$('.scene canvas'));
  const good = await measure('no radio between', seen, 4000);

  radio.kbit = 64;
  await sleep(3000);  // what was on its way
  // A machine that others load spoils a stretch, and not three of them.
  let poor;
  for (let i = 0; i < 3 && !(poor?.share > 0.97 && poor.ages[1] < 1500); ++i) poor = await measure('64 kbit/s', seen, 10000);
  assert.ok(poor.share > 0.97, 'states are missing');
  assert.ok(poor.ages[1] < 1500, 'states are late');
  assert.ok(poor.pictures > 0 && poor.pictures < 0.6 * good.pictures, 'pictures are not thinned');

  // A radio that carries the states of no camera: they are thinned, but what is shown is of not long ago.
  radio.kbit = 14;
  await sleep(3000);
  const poorer = await measure('14 kbit/s', seen, 6000);
  assert.ok(poorer.share > 0.1 && poorer.share < 0.95, 'states are to be thinned');
  assert.ok(poorer.ages[1] < 6000, 'states are late');

  // Away for some seconds: the page comes again by itself, and fills the gap with every state of that time.
  radio.kbit = 200;
  await sleep(2000);
  const away = process.hrtime.bigint();
  radio.cut(true);
  await until('NO LINK', async () => (await badge(page)) === 'NO LINK');
  await sleep(3000);
  seen.whole = false;
  const back = process.hrtime.bigint();
  radio.cut(false);
  await until('TRACK again', async () => (await badge(page)) === 'TRACK');
  await until('the gap is filled', () => seen.whole);
  const exported = await csv(page);
  await stop(live);
  equalsTheFiles(exported, 'run', 30);
  const there = new Set(exported.rows.map(([ns]) => ns));
  const missed = frames('run').filter((ns) => BigInt(ns) > away && BigInt(ns) < back);
  assert.ok(missed.length > 20, `${missed.length} frames while the radio was away`);
  assert.deepEqual(missed.filter((ns) => !there.has(ns)), []);
  console.log(`${missed.length} states of ${(1e-9 * Number(back - away)).toFixed(1)} s without a radio are there afterwards`);
  radio.close();
});
