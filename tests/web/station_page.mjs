// The ground station's page in a browser, on a simulated run: what it shows, its controls, a client that stalls, a server
// that is started anew.
import assert from 'node:assert/strict';
import {readdirSync} from 'node:fs';
import {join} from 'node:path';
import {DESK, PHONE, badge, csv, download, equalsTheFiles, folder, inChromium, number, press, seconds, shoot, sleep, start, stop, target, until, watch, write} from './rig.mjs';

write('run.yaml', `${target}camera: {source: 'sim:sim.yaml'}\noutputs: {station: {control: true, bandwidth: 400}, record: flights}\n`);

async function shows(page) {
  await until('TRACK', async () => (await badge(page)) === 'TRACK');
  await until('a value', async () => isFinite(await number(page, 'value-z')));
  await until('a picture', () => page.evaluate(() => document.querySelector('.picture canvas').width > 300));
  // Plots move: their pixels change.
  for (const plot of ['.six canvas', '.others canvas', '.scene canvas']) {
    const pixels = () => page.evaluate((selector) => document.querySelector(selector).toDataURL(), plot);
    const before = await pixels();
    await until(`${plot} moves`, async () => (await pixels()) !== before);
  }
}

// A second client stalls: the first goes on, and the phone comes again by itself.
async function oneStalls(page, phone) {
  await until('TRACK on the phone', async () => (await badge(phone)) === 'TRACK');
  const stall = await phone.context().newCDPSession(phone);
  await stall.send('Debugger.enable');
  await stall.send('Debugger.pause');
  await sleep(1500);
  const lastRow = async () => BigInt((await csv(page)).rows.at(-1)[0]);
  const then = await lastRow();
  await until('rows go on beside a stalled client', async () => (await lastRow()) > then + 1_000_000_000n);
  await stall.send('Debugger.resume').catch(() => {});
  await stall.send('Debugger.disable');
  await until('the phone is back', async () => (await badge(phone)) === 'TRACK');
}

// Paused, what is shown stands still, the keyboard steps, and the files are of what is seen.
async function pauses(page) {
  await press(page, 'Space');
  await until('paused', async () => (await page.textContent('#when')) !== 'live');
  const still = await page.textContent('#value-z');
  await sleep(600);
  assert.equal(await page.textContent('#value-z'), still);
  const before = await seconds(page);
  await press(page, ...Array(5).fill('Shift+ArrowLeft'));
  await until('five seconds back', async () => (await seconds(page)) < before - 4.9);
  const png = await download(page, 'png');
  assert.deepEqual([...png.subarray(1, 4)], [...Buffer.from('PNG')]);
  assert.ok(png.readUInt32BE(16) > 1000 && png.length > 20000, `${png.readUInt32BE(16)} px wide, ${png.length} bytes`);
  await press(page, 'End');
  await until('live', async () => (await page.textContent('#when')) === 'live');
}

// All of it by keyboard alone: what has the focus is seen, and every control is reached.
async function byKeyboard(page) {
  const reached = new Set();
  await page.evaluate(() => document.activeElement.blur());
  for (let i = 0; i < 40; ++i) {
    await page.keyboard.press('Tab');
    const [id, outlined] = await page.evaluate(() => [document.activeElement.id, getComputedStyle(document.activeElement).outlineStyle !== 'none']);
    if (id) assert.ok(outlined, `${id} has the focus and does not show it`);
    reached.add(id);
  }
  for (const id of ['record', 'mark', 'csv', 'png', 'theme', 'help', 'close', 'pause', 'slider', 'stretch']) assert.ok(reached.has(id), `${id} is not reached`);
  await press(page, '?');
  assert.ok(await page.isVisible('dialog'));
  await page.keyboard.press('Escape');
  assert.ok(!(await page.isVisible('dialog')));
  await press(page, 'w');
  assert.equal(await page.textContent('#stretch'), '60 s');
}

// Recording and marks, as the configuration allows them.
async function controls(page) {
  const events = () => page.textContent('#events');
  await until('recording', async () => (await page.textContent('#record')) === 'Stop');
  await press(page, 'r');
  await until('recorded', async () => /recorded .* pictures/.test(await events()));
  await until('not recording', async () => (await page.textContent('#record')) === 'Record');
  page.once('dialog', (dialog) => dialog.accept('gust <b>from</b> behind'));
  await press(page, 'm');
  await until('marked', async () => /mark: gust <b>from<\/b> behind/.test(await events()));
  await press(page, 'r');
  await until('recording again', async () => (await page.textContent('#record')) === 'Stop');
  assert.equal(readdirSync(join(folder, 'flights')).length, 2);
}

await inChromium(async (browser) => {
  let live = await start('run.yaml', '127.0.0.1:0', '--output', 'first');
  const url = `http://127.0.0.1:${live.port}/`;
  const page = await watch(browser, url, DESK);
  const phone = await watch(browser, url, PHONE, {deviceScaleFactor: 2, hasTouch: true, colorScheme: 'dark'});
  await shows(page);
  await oneStalls(page, phone);
  await shoot(page, 'desktop_light');
  await shoot(phone, 'phone_dark');
  await pauses(page);
  await byKeyboard(page);
  await controls(page);
  await press(page, 't', 'z');
  await press(phone, 't');
  await sleep(1500);
  await shoot(page, 'desktop_dark');
  await shoot(phone, 'phone_light');

  const exported = await csv(page);
  await stop(live);
  console.log(`${equalsTheFiles(exported, 'first')} rows on the page equal the files`);

  // The server is gone, and another comes.
  await until('NO LINK', async () => (await badge(page)) === 'NO LINK');
  live = await start('run.yaml', `127.0.0.1:${live.port}`, '--output', 'second');
  await until('TRACK again', async () => (await badge(page)) === 'TRACK');
  await until('rows of the new run', async () => (await csv(page)).rows.length > 30);
  const again = await csv(page);
  await stop(live);
  equalsTheFiles(again, 'second');
});
