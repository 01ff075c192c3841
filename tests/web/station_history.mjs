// Five minutes back, without waiting for them: the page's WebSocket is answered here, with the rows of six minutes at 30 Hz.
import assert from 'node:assert/strict';
import {DESK, csv, inChromium, number, press, seconds, shoot, sleep, start, target, until, write} from './rig.mjs';

const SECONDS = 360, RATE = 30, ROW_BYTES = 172, VALUES = (ROW_BYTES - 16) / 4;
write('run.yaml', `${target}camera: {source: 'sim:sim.yaml'}\noutputs: {station: {}}\n`);

// x is the time in seconds, so that what is shown tells of when it is; every tenth second nothing is seen.
const xAt = (i) => i / RATE;
function rows(from, to) {
  const bytes = Buffer.alloc(4 + (to - from) * ROW_BYTES);
  bytes.set([1, Number(to === SECONDS * RATE)]);
  for (let i = from; i < to; ++i) {
    const at = 4 + (i - from) * ROW_BYTES, seen = Math.floor(xAt(i)) % 10 !== 0;
    bytes.writeUInt32LE(i + 1, at);
    bytes.writeUInt8(seen ? 0 : 1, at + 4);
    bytes.writeUInt8(seen ? 1 : 2, at + 5);
    bytes.writeBigInt64LE(1_700_000_000_000_000_000n + BigInt(Math.round(i * 1e9 / RATE)), at + 8);
    for (let k = 0; k < VALUES; ++k) bytes.writeFloatLE(k === 0 ? xAt(i) : Math.sin(k + i / 200), at + 16 + 4 * k);
  }
  return bytes;
}

await inChromium(async (browser) => {
  const live = await start('run.yaml', '127.0.0.1:0');
  const page = await (await browser.newContext({viewport: DESK, acceptDownloads: true})).newPage();
  let acknowledged = 0;
  await page.routeWebSocket(/\/live$/, (socket) => {
    const server = socket.connectToServer();
    socket.onMessage((message) => { acknowledged = Math.max(acknowledged, JSON.parse(String(message)).ack ?? 0); });
    server.onMessage((message) => {
      if (typeof message !== 'string' || !message.includes('"hello"')) return;
      assert.equal(JSON.parse(message).hello.row_bytes, ROW_BYTES);
      socket.send(message);
      for (let i = 0; i < SECONDS * RATE; i += 30) socket.send(rows(i, i + 30));
    });
  });
  await page.goto(`http://127.0.0.1:${live.port}/`);
  const end = xAt(SECONDS * RATE - 1);
  await until('the last row', async () => Math.abs((await number(page, 'value-x')) - end) < 0.006);
  assert.equal(acknowledged, SECONDS + 1);  // each message, and the hello

  // All of five minutes in the plots, and in the file.
  await press(page, 'w', 'w');
  assert.equal(await page.textContent('#stretch'), '300 s');
  await sleep(500);
  const whole = await csv(page);
  assert.ok(Math.abs(whole.rows.length - 300 * RATE) <= 1, `${whole.rows.length} rows`);
  assert.ok(Math.abs(Number(whole.at(whole.rows[0], 'x')) - (end - 300)) < 0.04);
  await shoot(page, 'five_minutes');

  // The slider's end is five minutes back.
  await page.focus('#slider');
  await page.$eval('#slider', (slider) => { slider.value = slider.min; slider.dispatchEvent(new Event('input')); });
  await until('five minutes back', async () => Math.abs((await seconds(page)) + 300) < 0.05);
  assert.ok(Math.abs((await number(page, 'value-x')) - (end - 300)) < 0.04);
  // From there a second at a time.
  await press(page, 'Shift+ArrowRight', 'Shift+ArrowRight');
  await until('two seconds on', async () => Math.abs((await number(page, 'value-x')) - (end - 298)) < 0.04);
  // What is saved is the stretch around it: here what there is of its first half, and its second.
  await press(page, 'w', 'w');
  assert.equal(await page.textContent('#stretch'), '30 s');
  await sleep(500);
  const some = await csv(page);
  const times = some.rows.map((row) => Number(some.at(row, 'x')));
  assert.ok(Math.abs(times.at(-1) - (end - 283)) < 0.04 && times[0] >= end - 313.04, `${times[0]} to ${times.at(-1)}, not about ${end - 298}`);
  await press(page, 'End');
  await until('live', async () => (await page.textContent('#when')) === 'live');

  // What drawing all of five minutes takes, five times a second.
  await press(page, 'w', 'w');
  const session = await page.context().newCDPSession(page);
  await session.send('Performance.enable');
  const busy = async () => (await session.send('Performance.getMetrics')).metrics.find(({name}) => name === 'TaskDuration').value;
  const before = await busy();
  const began = performance.now();
  for (let i = 0; i < 10; ++i) {
    await press(page, 'ArrowLeft');
    await sleep(210);
  }
  console.log(`${whole.rows.length} rows drawn five times a second: ${(100 * ((await busy()) - before) / (1e-3 * (performance.now() - began))).toFixed(0)} % of a core`);
});
